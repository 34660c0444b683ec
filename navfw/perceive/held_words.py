"""Words that hold still: those of a percept changed by the evidence of the last pairs of images."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from navfw.offis.percept_explanation import front_in, report
from navfw.signals import Percept

_PAIRS, _RECENT = 5, 3
"""Numbers of pairs whose words count: for the nearest object, for front and floor."""
_CHANGES, _STAYS = 0.75, 0.5
"""Share of them from which on front and nearest object are what they say, whatever was said; the
least one in which all regions of the object that are said are seen, for them to stay."""
_ENTERS, _LEAVES = 0.6, 0.2
"""Share of them from which on the floor is named, and up to which it is not any more."""
_MAX_SILENT = 2
"""Pairs without a result over which words are held."""
_TERMS = "near", "middle", "far"

Layers = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True, slots=True)
class _Words:
    """Of one pair: the regions of the nearest object by layer, None if unknown; front and floor."""

    layers: Layers | None
    front: str
    floor: bool

    @classmethod
    def of(cls, percept: Percept) -> _Words:
        clauses = percept.sentence.split("; ")
        unknown = "Layer1: nearest object is unknown" in clauses
        layers = None if unknown else percept.obstacles
        return cls(layers, front_in(percept.sentence), "Floor in front" in clauses)


class HeldWords:
    """The words of one sequence, which change when most of the last pairs say so.

    The regions of the nearest object are held or changed together: regions that were never seen at
    once would not be true of any pair. What comes near while nothing was is said at once. A pair
    without a result says nothing: the words before are held for a few of them.
    """

    def __init__(self) -> None:
        self._past: deque[_Words] = deque(maxlen=_PAIRS)
        self.interrupt()

    def interrupt(self) -> None:
        """Forget what was said: another scene begins."""
        self._past.clear()
        self._said = _Words(None, "unknown", floor=False)
        self._silent = 0

    def hold(self, percept: Percept, *, known: bool) -> Percept:
        """``percept`` with the words that hold after this pair."""
        self._silent = 0 if known else self._silent + 1
        if self._silent > _MAX_SILENT:
            self.interrupt()
        if known:
            self._past.append(_Words.of(percept))
            recent = list(self._past)[-_RECENT:]
            (front, count), *_ = Counter(words.front for words in recent).most_common()
            front = front if count >= _CHANGES * len(recent) else self._said.front
            share = sum(words.floor for words in recent) / len(recent)
            floor = share >= _ENTERS or (self._said.floor and share > _LEAVES)
            self._said = _Words(self._layers(), front, floor)
        said = self._said
        layers = said.layers or {layer: dict[str, str]() for layer in percept.obstacles}
        sentence = report(layers, said.front, said.floor, said.layers is not None)
        return replace(percept, obstacles=layers, sentence=sentence)

    def _layers(self) -> Layers | None:
        votes = [words.layers for words in self._past if words.layers is not None]
        if not votes:
            return None
        newest = votes[-1] if self._past[-1].layers is not None else {"layer1": {}}
        before = None if self._said.layers is None else self._said.layers["layer1"]
        if "near" in newest["layer1"].values() and "near" not in (before or {}).values():
            return newest
        seen = [frozenset(layers["layer1"]) for layers in votes]
        regions = max(reversed(seen), key=seen.count)
        if before is not None and seen.count(regions) < _CHANGES * len(seen):
            # a pair with all of these regions confirms them; one without any confirms none
            stays = sum(set(before) <= now if before else not now for now in seen)
            stays = stays >= _STAYS * len(seen)
            regions = frozenset(before) if stays else regions
        terms = {region: _term(region, votes, (before or {}).get(region)) for region in regions}
        return {layer: _parts(layer, terms, votes) for layer in votes[-1]}


def _term(region: str, votes: Sequence[Layers], before: str | None) -> str:
    """The distance of a region: that ``before`` unless most of the last pairs say another."""
    seen = [layers["layer1"][region] for layers in votes if region in layers["layer1"]]
    ranks = sorted(map(_TERMS.index, seen))
    term = _TERMS[ranks[(len(ranks) - 1) // 2]]
    return term if before is None or seen.count(term) >= _CHANGES * len(seen) else before


def _parts(layer: str, terms: Mapping[str, str], votes: Sequence[Layers]) -> dict[str, str]:
    """The regions of a ``layer`` in the quadrants with ``terms``: those that were seen last."""
    if layer == "layer1":
        return dict(sorted(terms.items()))
    parts = {}
    for quadrant, term in sorted(terms.items()):
        last = next(layers for layers in reversed(votes) if quadrant in layers["layer1"])
        inside = [name for name in last[layer] if name.startswith(f"s{quadrant}")]
        parts.update(dict.fromkeys(inside, term))
    return parts
