"""Words that hold still: those of a percept changed by the evidence of the last pairs of images."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

from navfw.offis.percept_explanation import front_in, report
from navfw.signals import Percept

_PAIRS = 3
"""Number of pairs whose words count."""
_ENTERS, _LEAVES = 0.6, 0.2
"""Share of them from which on a word is said, and up to which one that was said is not any more."""
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
    """The words of one sequence; a word changes when most of the last pairs say so, near at once.

    A pair without a result says nothing: the words before are held for a few of them.
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
            self._said = _Words(self._layers(), self._front(), self._floor())
        said = self._said
        layers = said.layers or {layer: dict[str, str]() for layer in percept.obstacles}
        sentence = report(layers, said.front, said.floor, said.layers is not None)
        return replace(percept, obstacles=layers, sentence=sentence)

    def _layers(self) -> Layers | None:
        votes = [words.layers for words in self._past if words.layers is not None]
        if not votes:
            return None
        before = (self._said.layers or {}).get("layer1", {})
        counts = Counter(region for layers in votes for region in layers["layer1"])
        newest = votes[-1]["layer1"] if self._past[-1].layers is not None else {}
        terms = {}
        for region, count in counts.items():
            share = count / len(votes)
            seen = [layers["layer1"][region] for layers in votes if region in layers["layer1"]]
            comes_near = newest.get(region) == "near" and "near" not in seen[:-1]
            if share >= _ENTERS or comes_near or (region in before and share > _LEAVES):
                ranks = sorted(map(_TERMS.index, seen))
                terms[region] = "near" if comes_near else _TERMS[ranks[(len(ranks) - 1) // 2]]
        if not terms and 2 * sum(not layers["layer1"] for layers in votes) <= len(votes):
            terms = dict(votes[-1]["layer1"])
        return {layer: _parts(layer, terms, votes) for layer in votes[-1]}

    def _front(self) -> str:
        (front, count), *_ = Counter(words.front for words in self._past).most_common()
        return front if count >= _ENTERS * len(self._past) else self._said.front

    def _floor(self) -> bool:
        share = sum(words.floor for words in self._past) / len(self._past)
        return share >= _ENTERS or (self._said.floor and share > _LEAVES)


def _parts(layer: str, terms: Mapping[str, str], votes: list[Layers]) -> dict[str, str]:
    """The regions of a ``layer`` in the quadrants with ``terms``: those that were seen last."""
    if layer == "layer1":
        return dict(sorted(terms.items()))
    parts = {}
    for quadrant, term in sorted(terms.items()):
        last = next(layers for layers in reversed(votes) if quadrant in layers["layer1"])
        inside = [name for name in last[layer] if name.startswith(f"s{quadrant}")]
        parts.update(dict.fromkeys(inside, term))
    return parts
