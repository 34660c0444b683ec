"""What stands in front of a camera: probabilities of open floor, a corridor and a wall.

Nearness in heights of the camera, which the floor's motion gives, tells what is near without any
scale. Three features of the thirds of the image, a class each for what is open, a corridor, and
across: logistic regression on the labels of real frames (docs/real-frames.md), so that a
probability is a frequency. Without a floor only a wall can be told, by one plane that fills the
image. Doors and corners are too rare in the labels to be named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from navfw.numerics import Array
from navfw.numerics.arrays import Mask
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
    floor = math.log(0.01)
    logs = [
        floor if near is None else max(math.log(max(near * height, 1e-6)), floor)
        for near in (left, middle, right)
    ]
    known = [log for log, near in ((logs[0], left), (logs[2], right)) if near is not None]
    sides = sum(known) / len(known) if known else logs[1]
    return (
        _within(logs[1] - math.log(_USUAL), _LOG_NEARNESS),
        _within(sides - logs[1], _LOG_SIDES),
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
