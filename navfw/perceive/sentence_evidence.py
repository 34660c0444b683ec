"""Choose the words of a sentence: the front by probability, objects by recent evidence.

Nearness in heights of the camera, which the floor's motion gives, shows what is near without any
scale. Three features of the thirds of the image are classified as open, a corridor, or across:
logistic regression on the labels of real frames (benchmarks/real-frames.md), so that a probability
is a frequency. Planes that meet near by are no corridor, but a corner if the angle is about right.
Without a floor only a wall can be recognized, by a plane that fills the image. Doors are too rare
in the labels to be named.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from navfw.numerics import Array
from navfw.numerics.arrays import Mask
from navfw.offis.elementary_situations import FLOOR_IN_FRONT
from navfw.offis.percept_explanation import report
from navfw.offis.pyramid import QUADRANTS, position
from navfw.offis.walls import SIDES
from navfw.perceive.floor_motion import MIN_FALL
from navfw.perceive.pair_motion import NO_FLOOR
from navfw.perceive.small_things import SmallThing, nearest_clause
from navfw.robot import CameraModel
from navfw.signals import Label, Percept

MIN_PROBABILITY = 0.6
"""Least probability of a front that the sentence names."""

_MIN_FLOOR = 0.25
"""Least share of floor below the horizon in the middle third: with less, an area that seems far
away may be one that does not move."""

_MIN_CONFIDENCE = 0.15
"""Least confidence of a cell that is used."""

_USUAL = 0.08
"""Nearness [1 / camera height] with which the middle is compared: between open and across."""

_LOG_NEARNESS, _LOG_SIDES, _STEEPNESS = (-2.0, 0.6), (-1.0, 1.5), (-1.0, 1.5)
"""Ranges of the features."""

_MIN_FIT, _ANY_STEEPNESS = 0.5, 0.4
"""Least share of the cells of a half in its plane for its incline to be used; the incline [rad]
that is evidence for nothing."""

_COEFFICIENTS = np.array(
    [[0.86, -1.69, 0.83], [-4.37, 3.39, 0.97], [-1.52, 2.70, -1.17], [-1.74, 1.79, -0.05]]
)
"""Coefficients of 1 and the features (rows), for open, a corridor, across (columns)."""

_WALL = 0.85
"""Share of walls, or surfaces that may be called so, in the class across: 27 of 31 labels."""

_ONE_PLANE, _FILLED = 0.9, 0.5
"""Without a floor: least fit of one plane to both halves, least confidence of the middle third."""

_SURE_WALL = 0.9
"""Probability of a wall in this case: 9 of 9 labels, by the rule of succession."""

_CLOSED, _BESIDE, _INCLINES, _PLANES, _CORNER = 0.1, 0.25, (1.2, 2.0), 0.85, 0.85  # measured
"""Nearness [1 / camera height] at which two planes that meet close a corridor. In a corner they do
so at most that far beside the axis, with that sum of inclines [rad] and least fit: 10 of 11 labels
of real and rendered tuning frames, by the rule of succession."""


def front_probabilities(
    percept: Percept, camera: CameraModel, height: float, pitch: float
) -> dict[str, float]:
    """Return probabilities of open, a corridor, a wall, or a corner, and "other"; {} if unknown.

    ``height`` [m] is the camera's in the percept's metres, at least ``NO_FLOOR`` without a floor;
    ``pitch`` [rad] the camera's, nose down.
    """
    walls = percept.explanation["walls"]
    fit = min(walls[side]["explained"] for side in SIDES)
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
    inclines = [walls[side]["incline"] for side in SIDES]
    steepness = _within(min(inclines) if fit >= _MIN_FIT else _ANY_STEEPNESS, _STEEPNESS)
    odds = np.exp(np.array([1.0, *features, steepness]) @ _COEFFICIENTS)
    is_open, corridor, across = (odds / odds.sum()).tolist()
    wall, (near, beside) = _WALL * across, _meeting(walls)
    if near * height > _CLOSED:
        two = walls["shared"] < 0.5 and fit > _PLANES and abs(beside) < _BESIDE
        if two and _INCLINES[0] < sum(inclines) < _INCLINES[1]:
            return {"corner": _CORNER, "other": 1.0 - _CORNER}
        corridor = 0.0
    other = 1.0 - is_open - corridor - wall
    return {"open": is_open, "corridor": corridor, "wall": wall, "other": other}


def _meeting(walls: Mapping[str, Any]) -> tuple[float, float]:
    """Return the nearness [1/m] at which the planes of the halves meet, and how far beside."""
    left, right = (walls[side] for side in SIDES)
    apart = left["slant"] - right["slant"]
    beside = (right["front"] - left["front"]) / apart if apart else 0.0
    return (left["slant"] * beside + left["front"] if apart else 0.0), beside


def probable_front(probabilities: Mapping[str, float]) -> str:
    """Return the front that the sentence names; "unknown" if none is probable enough."""
    named = {name: p for name, p in probabilities.items() if name != "other"}
    best = max(named, key=named.__getitem__, default="unknown")
    return best if named.get(best, 0.0) >= MIN_PROBABILITY else "unknown"


def _features(percept: Percept, weight: Array, height: float) -> tuple[float, float] | None:
    """Return logarithms of the middle's nearness, and of the sides' relative to it; or None."""
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
    """Return the confidence (rows, cols) of cells in ``place`` that show no floor, otherwise 0."""
    is_object = ~np.isin(percept.label, (Label.FLOOR, Label.DROP))
    counts = place & is_object & (percept.confidence > _MIN_CONFIDENCE)
    return np.where(counts, percept.confidence, 0.0)


def _nearness(percept: Percept, weight: Array, third: slice) -> float | None:
    """Return the 60th percentile [1/m] of nearness in a ``third``; None below three cells."""
    values, weights = percept.nearness[:, third].ravel(), weight[:, third].ravel()
    if int((weights > 0.0).sum()) < 3:
        return None
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[int(np.searchsorted(total, 0.6 * total[-1]))]])


def _within(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])


HELD = 0.5
"""Time [s] for which a pair's evidence is used, and words are held without new evidence."""

AT_ONCE = 2.0
"""Time to contact [s] below which nothing is called open, whatever was said."""

_CONTRARY = 0.2
"""Probability by the newest pair below which a front is dropped."""

_COVERED = 0.5
"""Share of a quadrant that is floor, from which no earlier pair's object is held there, and of the
window in front that is none, from which no earlier pair's floor is held."""

_LEADS = 0.34
"""Share of the pairs by which other regions have to lead the present ones to replace them."""

_RIGHT, _FADING = 0.81, 0.15
"""Share of the named nearest objects that are right by the tuning labels, at full, a third and a
seventh of the frame rate, and its loss per second of age; how many pairs agree says nothing."""

_FLOOR, _THING = 0.99, 0.97
"""Share of named floors in front that are right: 346 of 346, by the rule of succession 0.99; of
small things that are something: 864 of 879 rendered images."""

Layers = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of a sentence, and its evidence.

    ``what`` is "nearest", "front" or "floor", ``says`` the clause. It is true with ``probability``;
    ``age`` [s] is the time since the newest pair that shows it by itself, at most ``HELD``.
    """

    what: str
    says: str
    probability: float
    age: float


@dataclass(frozen=True, slots=True)
class _Evidence:
    """The evidence of one pair at ``time`` [s]: regions by layer, None if unknown; the floor.

    ``front`` has the probabilities of fronts, {} if unknown.
    """

    time: float
    layers: Layers | None
    front: Mapping[str, float]
    floor: bool

    def without(self, places: Collection[str]) -> _Evidence:
        """Return the evidence without regions at these ``position``s."""
        if not any(position(name) in places for name in (self.layers or {}).get("layer1", ())):
            return self
        layers = {
            layer: {name: term for name, term in regions.items() if position(name) not in places}
            for layer, regions in (self.layers or {}).items()
        }
        return replace(self, layers=layers if layers["layer1"] else None)

    @property
    def regions(self) -> frozenset[str]:
        """The quadrants of the nearest object."""
        return frozenset((self.layers or {}).get("layer1", ()))


class HeldWords:
    """The words of one sequence, by the evidence of the last ``HELD`` seconds.

    Probabilities of fronts are averaged. The regions of the nearest object are held or changed
    together: regions that were never seen at once would not be true of any pair. Distances are
    those that the newest pair shows. An object that comes near while none was is reported at once;
    contrary evidence ends a word at once. A pair without a result shows nothing.
    """

    def __init__(self) -> None:
        self._past: deque[_Evidence] = deque()
        self.interrupt()

    def interrupt(self) -> None:
        """Forget all evidence and words: another scene begins."""
        self._past.clear()
        self._said: Mapping[str, str] = {}

    def hold(
        self, percept: Percept, front: Mapping[str, float], contact: float, *, known: bool
    ) -> tuple[Percept, tuple[Statement, ...]]:
        """Return ``percept`` with the words after this pair, and these with their evidence.

        ``front`` are the probabilities of fronts by this pair, ``contact`` [s] its time to contact
        with the surface straight ahead; if ``known`` is False the pair shows nothing.
        """
        time = percept.time
        while self._past and time - self._past[0].time > HELD + 1e-6:
            self._past.popleft()
        if known:
            floor_at = _covered(percept)
            self._past = deque(one.without(floor_at) for one in self._past)
            unknown = "Layer1: nearest object is unknown" in percept.sentence
            layers = None if unknown else percept.obstacles
            seen = percept.floor_in_front >= FLOOR_IN_FRONT
            self._past.append(_Evidence(time, layers, front, seen))
        named, ahead = self._front(known=known, soon=contact < AT_ONCE)
        floor = [one.time for one in self._past if one.floor]
        is_floor = bool(floor) and not (known and floor[-1] < time and _stands_in_front(percept))
        layers, shown = self._nearest(percept, known=known)
        obstacles = layers or {layer: dict[str, str]() for layer in percept.obstacles}
        self._said = obstacles["layer1"]
        sentence = report(obstacles, named, is_floor, layers is not None)
        said = [] if layers is None else [("nearest", *shown)]
        said += [("front", *ahead)] if named != "unknown" else []
        said += [("floor", _FLOOR, floor[-1])] if is_floor else []
        clauses = [clause for clause in sentence.split("; ") if not clause.startswith("Layer2")]
        clauses = [clause for clause in clauses if not clause.endswith("unknown")]
        statements = tuple(
            Statement(what, clause.removeprefix("Layer1: "), probability, time - since)
            for (what, probability, since), clause in zip(said, clauses, strict=True)
        )
        return replace(percept, obstacles=obstacles, sentence=sentence), statements

    def _front(self, *, known: bool, soon: bool) -> tuple[str, tuple[float, float]]:
        """Return the front, its probability, and when [s] a pair last showed it."""
        fronts = [one for one in self._past if one.front]
        mean = {
            name: sum(one.front.get(name, 0.0) for one in fronts) / len(fronts)
            for name in {name for one in fronts for name in one.front}
        }
        named = probable_front(mean)
        newest = self._past[-1].front if known else {}
        if named == "unknown" or (newest and newest.get(named, 0.0) < _CONTRARY):
            return "unknown", (0.0, 0.0)
        if soon and named == "open":
            return "unknown", (0.0, 0.0)
        share = mean[named] - 1e-9  # a mean of equal numbers may be rounded up
        since = max(one.time for one in fronts if one.front.get(named, 0.0) >= share)
        return named, (mean[named], since)

    def _nearest(
        self, percept: Percept, *, known: bool
    ) -> tuple[Layers | None, tuple[float, float]]:
        """Return the nearest object by layer, its probability, and when [s] it was shown."""
        votes = [one for one in self._past if one.layers is not None]
        if not votes:
            return None, (0.0, 0.0)
        sets = [one.regions for one in votes]
        regions, before = max(reversed(sets), key=sets.count), frozenset(self._said)
        if before in sets and sets.count(regions) - sets.count(before) < _LEADS * len(sets):
            regions = before
        newest = (self._past[-1].layers if known else None) or {"layer1": {}}
        if "near" in newest["layer1"].values() and "near" not in self._said.values():
            regions = frozenset(newest["layer1"])
        last = next(one for one in reversed(votes) if one.regions == regions)
        assert last.layers is not None  # noqa: S101 - of a vote
        terms = dict(sorted(last.layers["layer1"].items()))
        for name in terms if known else ():
            term = strongest_term(percept.quadrants[name])
            terms[name] = terms[name] if term == "unknown" else term
        layers = {
            layer: terms
            if layer == "layer1"
            else {name: next(t for q, t in terms.items() if q in name) for name in parts}
            for layer, parts in last.layers.items()
        }
        return layers, (_RIGHT - _FADING * (percept.time - last.time), last.time)


def with_nearest(
    said: tuple[Percept, tuple[Statement, ...]], things: Sequence[SmallThing]
) -> tuple[Percept, tuple[Statement, ...]]:
    """Return what is ``said``, with the first of ``things``, if any, before all else."""
    if not things:
        return said
    (percept, statements), says = said, nearest_clause(things[0])
    percept = replace(percept, sentence=f"{says}; {percept.sentence}")
    return percept, (Statement("small", says, _THING, 0.0), *statements)


def strongest_term(degrees: Mapping[str, float]) -> str:
    """Return which of near, middle and far has the largest degree; "unknown" if all are 0."""
    best = max(degrees, key=degrees.__getitem__)
    return best if degrees[best] > 0.0 else "unknown"


def _covered(percept: Percept) -> list[str]:
    """Return the quadrants, as ``position``s, in which the floor is seen."""
    halves = np.array_split(percept.label == Label.FLOOR, 2)
    (p2, p1), (p3, p4) = (np.array_split(half, 2, axis=1) for half in halves)
    quadrants = zip(QUADRANTS, (p1, p2, p3, p4), strict=True)
    return [position(name) for name, floor in quadrants if floor.mean() > _COVERED]


def _stands_in_front(percept: Percept) -> bool:
    """Return whether most of the lowest quarter of the middle third is not floor."""
    rows = percept.label.shape[0]
    low = percept.label[rows - max(rows // 4, 1) :, _thirds(percept)[1]]
    return bool(np.isin(low, (Label.OBSTACLE, Label.DROP)).mean() > _COVERED)
