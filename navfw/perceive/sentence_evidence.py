"""What a sentence says: the front by probability, and words that hold still over pairs of images.

Nearness in heights of the camera, which the floor's motion gives, tells what is near without any
scale. Three features of the thirds of the image, a class each for what is open, a corridor, and
across: logistic regression on the labels of real frames (benchmarks/real-frames.md), so that a
probability is a frequency. Without a floor only a wall can be told, by one plane that fills the
image. Doors and corners are too rare in the labels to be named.

The words of a percept are changed by the evidence of the last pairs.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from navfw.numerics import Array
from navfw.numerics.arrays import Mask
from navfw.offis.percept_explanation import front_in, report
from navfw.offis.pyramid import QUADRANTS, position
from navfw.perceive.floor_motion import MIN_FALL
from navfw.perceive.pair_motion import NO_FLOOR
from navfw.robot import CameraModel
from navfw.signals import Label, Percept

MIN_PROBABILITY = 0.6
"""Least probability of a front that the sentence names."""

_MIN_FLOOR = 0.25
"""Least share of floor below the horizon in the middle third: without it, what is far away may be
what does not move."""

_MIN_CONFIDENCE = 0.15
"""Least confidence of a cell that counts."""

_USUAL = 0.08
"""Nearness [1 / camera height] with which the middle is compared: between open and across."""

_LOG_NEARNESS, _LOG_SIDES, _STEEPNESS = (-2.0, 0.6), (-1.0, 1.5), (-1.0, 1.5)
"""Ranges of the features."""

_MIN_FIT, _ANY_STEEPNESS = 0.5, 0.4
"""Least share of the cells of a half in its plane for its incline to count; the incline [rad] that
speaks for nothing."""

_COEFFICIENTS = np.array(
    [[0.86, -1.69, 0.83], [-4.37, 3.39, 0.97], [-1.52, 2.70, -1.17], [-1.74, 1.79, -0.05]]
)
"""Of 1 and the features (rows), for what is open, a corridor, across (columns)."""

_WALL = 0.85
"""Share of walls, or what may be called so, of what is across: 27 of 31 labels."""

_ONE_PLANE, _FILLED = 0.9, 0.5
"""Without a floor: least fit of one plane to both halves, least confidence of the middle third."""

_SURE_WALL = 0.9
"""Probability of a wall then: 9 of 9 labels, by the rule of succession."""


def front_probabilities(
    percept: Percept, camera: CameraModel, height: float, pitch: float
) -> dict[str, float]:
    """Probabilities of "open", "corridor" and "wall", the rest is "other"; empty if unknown.

    ``height`` [m] is the camera's in the percept's metres, at least ``NO_FLOOR`` without a floor;
    ``pitch`` [rad] the camera's, nose down.
    """
    walls = percept.explanation["walls"]
    fit = min(walls[side]["explained"] for side in ("left", "right"))
    fall = camera.fall_per_depth(percept.points, pitch)
    middle = _thirds(percept)[1]
    if height >= NO_FLOOR:
        filled = float(_weight(percept, np.ones_like(fall, dtype=bool))[:, middle].mean())
        whole = min(fit, walls["shared"]) >= _ONE_PLANE and filled >= _FILLED
        return {"wall": _SURE_WALL, "other": 1.0 - _SURE_WALL} if whole else {}
    floor, below = percept.label == Label.FLOOR, fall > MIN_FALL
    if floor[:, middle].sum() < max(_MIN_FLOOR * below[:, middle].sum(), 1.0):
        return {}
    features = _features(percept, _weight(percept, fall < MIN_FALL), height)
    if features is None:
        return {}
    incline = min(walls[side]["incline"] for side in ("left", "right"))
    steepness = _within(incline if fit >= _MIN_FIT else _ANY_STEEPNESS, _STEEPNESS)
    odds = np.exp(np.array([1.0, *features, steepness]) @ _COEFFICIENTS)
    is_open, corridor, across = (odds / odds.sum()).tolist()
    wall = _WALL * across
    return {"open": is_open, "corridor": corridor, "wall": wall, "other": across - wall}


def probable_front(probabilities: Mapping[str, float]) -> str:
    """The front that the sentence names; "unknown" where none is probable enough."""
    named = {name: p for name, p in probabilities.items() if name != "other"}
    best = max(named, key=named.__getitem__, default="unknown")
    return best if named.get(best, 0.0) >= MIN_PROBABILITY else "unknown"


def _features(percept: Percept, weight: Array, height: float) -> tuple[float, float] | None:
    """Logarithms of the nearness of the middle, and of that of the sides beside the middle's."""
    left, middle, right = (_nearness(percept, weight, third) for third in _thirds(percept))
    if middle is None:
        return None
    ahead = math.log(max(middle * height, 0.01))
    beside = [math.log(max(near * height, 0.01)) for near in (left, right) if near is not None]
    sides = sum(beside) / len(beside) if beside else ahead
    return (
        _within(ahead - math.log(_USUAL), _LOG_NEARNESS),
        _within(sides - ahead, _LOG_SIDES),
    )


def _thirds(percept: Percept) -> list[slice]:
    cols = percept.label.shape[1]
    ends = [round(k * cols / 3.0) for k in range(4)]
    return [slice(a, b) for a, b in pairwise(ends)]


def _weight(percept: Percept, place: Mask) -> Array:
    """Confidence (rows, cols) of the cells in ``place`` that show no floor, otherwise 0."""
    is_object = ~np.isin(percept.label, (Label.FLOOR, Label.DROP))
    counts = place & is_object & (percept.confidence > _MIN_CONFIDENCE)
    return np.where(counts, percept.confidence, 0.0)


def _nearness(percept: Percept, weight: Array, third: slice) -> float | None:
    """The 60th percentile [1/m] of the nearness of the cells in a ``third``; None below three."""
    values, weights = percept.nearness[:, third].ravel(), weight[:, third].ravel()
    if int((weights > 0.0).sum()) < 3:
        return None
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[int(np.searchsorted(total, 0.6 * total[-1]))]])


def _within(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])


_PAIRS, _RECENT = 5, 3
"""Numbers of pairs whose words count: for the nearest object, for front and floor."""
_CHANGES, _STAYS = 0.75, 0.5
"""Share of them from which on front and nearest object are what they say, whatever was said; the
least one in which all regions of the object that are said are seen, for them to stay."""
_ENTERS, _LEAVES = 0.6, 0.2
"""Share of them from which on the floor is named, and up to which it is not any more."""
_COVERED = 0.5
"""Share of a quadrant that is floor, from which on no other pair's object is held there."""
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

    def without(self, places: Collection[str]) -> _Words:
        """These words, but for the regions at these ``position``s."""
        if not any(position(name) in places for name in (self.layers or {}).get("layer1", ())):
            return self
        layers = {
            layer: {name: term for name, term in regions.items() if position(name) not in places}
            for layer, regions in (self.layers or {}).items()
        }
        return replace(self, layers=layers if layers["layer1"] else None)


class HeldWords:
    """The words of one sequence, which change when most of the last pairs say so.

    The regions of the nearest object are held or changed together: regions that were never seen at
    once would not be true of any pair. What comes near while nothing was is said at once; no object
    is held where the floor is seen. A pair without a result says nothing: the words before are held
    for a few of them.
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
            floor_at = _covered(percept)
            self._said = self._said.without(floor_at)
            self._past = deque((words.without(floor_at) for words in self._past), maxlen=_PAIRS)
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


def _covered(percept: Percept) -> list[str]:
    """The quadrants, as ``position``s, in which the floor is seen."""
    halves = np.array_split(percept.label == Label.FLOOR, 2)
    (p2, p1), (p3, p4) = (np.array_split(half, 2, axis=1) for half in halves)
    quadrants = zip(QUADRANTS, (p1, p2, p3, p4), strict=True)
    return [position(name) for name, floor in quadrants if floor.mean() > _COVERED]


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
