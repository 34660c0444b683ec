"""OFFIS' fuzzy distances of the quadrants, summed up to left, right and ahead (paper sec 4.5)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from navfw.signals import Percept

_LEFT, _RIGHT = ("P2", "P3"), ("P1", "P4")
# the inner parts of each quadrant (see navfw.offis)
_INNER = ("sP12", "sP13", "sP21", "sP24", "sP31", "sP34", "sP42", "sP43")
_UNKNOWN = 0.5


@dataclass(frozen=True, slots=True)
class QuadrantDistances:
    """Fuzzy distances in [0, 1]: 0 is near, 0.5 middle, 1 far (paper sec 4.5).

    ``left`` and ``right`` are of the nearest object in that half of the image; ``ahead`` of the
    nearest object, if it is in the inner part of the image. An unknown distance is 0.5: neither
    near nor free. ``floor`` is the degree of "Floor in front", ``age`` [s] that of the percept.
    """

    left: float
    right: float
    ahead: float
    floor: float
    age: float


def quadrant_distances(percept: Percept, time: float) -> QuadrantDistances:
    """The distances of ``percept`` at ``time`` [s], from the contents of the paper's report."""
    left, right = _side(percept, _LEFT), _side(percept, _RIGHT)
    deeper = [names for layer, names in percept.obstacles.items() if layer != "layer1"]
    # one layer has no inner parts: an object is ahead if it is near on both sides
    ahead = _ahead(percept, deeper) if deeper else max(left, right)
    return QuadrantDistances(left, right, ahead, percept.floor_in_front, time - percept.time)


def _ahead(percept: Percept, layers: Iterable[Mapping[str, str]]) -> float:
    quadrants = {name[1:3] for regions in layers for name in regions if name[:4] in _INNER}
    return min((_distance(percept.quadrants[name]) for name in quadrants), default=1.0)


def _side(percept: Percept, quadrants: tuple[str, ...]) -> float:
    return min(_distance(percept.quadrants[name]) for name in quadrants)


def _distance(degrees: Mapping[str, float]) -> float:
    """The mean of near (0), middle (0.5) and far (1), weighted by their degrees."""
    total = sum(degrees.values())
    if total <= 0.0:
        return _UNKNOWN
    return (0.5 * degrees["middle"] + degrees["far"]) / total
