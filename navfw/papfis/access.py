"""Getting on and off the map: which places a point in free space leads to, and at what cost.

A map says nothing about walls, and the place nearest to a robot is often behind one. What it does
say: passages are free, so a point near a passage belongs to it; and a door stands in a wall, so
a straight way that crosses a door's line beside the door is none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.papfis.costs import EdgeCosts
from navfw.topomap.model import Footing, Passage, Place, TopoMap

__all__ = ["AT_PLACE", "OFF_PASSAGE", "Access", "Doorways", "find_access"]

SLACK = 0.3
"""Passages so much farther than the nearest one are still considered [m]."""

SEARCH_RANGE = 3.0
"""How much farther than the nearest passage to look for one that no wall hides [m]."""

OFF_PASSAGE = 2.0
"""A metre away from the passages counts as so many: nobody vouches for it."""

AT_PLACE = 0.05
"""A point so near its place is at it [m]."""

WALL_REACH = 3.5
"""How far to each side of a door its wall is taken to extend [m]."""


@dataclass(frozen=True, slots=True)
class Access:
    """How a point is joined to the map.

    ``costs`` of the way between the point and each place it leads to, never less than the straight
    distance; ``footings`` on the passages it can step onto, nearest first (none where it only leads
    to places that no passage touches); ``distance`` [m] to the nearest of all these.
    """

    costs: Mapping[str, float]
    footings: Sequence[Footing]
    distance: float

    def width_to(self, place: str) -> float:
        """Width [m] of the passage by which the point leads to ``place``; inf if by none."""
        widths = [f.passage.width for f in self.footings if place in f.passage.ends]
        return min(widths, default=math.inf)


class Doorways:
    """The doors of a map as pieces of wall with a gap in them."""

    def __init__(self, topo_map: TopoMap) -> None:
        centers, normals, gaps = [], [], []
        for place in topo_map.places.values():
            normal = _door_normal(topo_map, place) if place.kind == "door" else None
            if normal is not None:
                widths = [passage.width for passage in topo_map.passages_at(place.name)]
                centers.append((place.x, place.y))
                normals.append(normal)
                gaps.append(0.5 * min(widths))
        self._centers = np.array(centers, dtype=np.float64).reshape(-1, 2)
        self._normals = np.array(normals, dtype=np.float64).reshape(-1, 2)
        self._gaps = np.array(gaps, dtype=np.float64)

    def separate(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether the straight way from ``start`` to ``end`` would lead through a door's wall."""
        if len(self._gaps) == 0:
            return False
        from_start = np.array(start) - self._centers
        leg = np.array(end) - np.array(start)
        before = np.sum(from_start * self._normals, axis=1)
        after = before + self._normals @ leg
        crossing = before * after < 0.0
        share = before[crossing] / (before[crossing] - after[crossing])
        point = from_start[crossing] + share[:, None] * leg
        normal = self._normals[crossing]
        beside = np.abs(point[:, 0] * normal[:, 1] - point[:, 1] * normal[:, 0])
        return bool(np.any((beside > self._gaps[crossing]) & (beside < WALL_REACH)))


def find_access(
    topo_map: TopoMap,
    costs: EdgeCosts,
    doorways: Doorways,
    point: tuple[float, float],
    place: str | None = None,
    part: frozenset[str] | None = None,
) -> Access:
    """How (x, y) [m] is joined to the map: by the nearest passages that no wall hides.

    A known ``place`` restricts the choice to that place and the passages that end there, a
    ``part`` (place names) to those places and the passages between them. A point at its known
    place leads to nowhere else.
    """
    among: Sequence[Passage] | None = None
    if place is not None:
        among = topo_map.passages_at(place)
    elif part is not None:
        among = [passage for passage in topo_map.passages if passage.a in part]
    near = topo_map.footings(*point, slack=SEARCH_RANGE, among=among)
    seen = [f for f in near if not doorways.separate(point, _foot(topo_map, f))] or near
    isolated = _nearest_isolated(topo_map, point, place, part)
    distance = min(
        seen[0].aside if seen else math.inf, math.inf if isolated is None else isolated[1]
    )
    footings = [f for f in seen if f.aside <= distance + SLACK]
    if place is not None and (apart := topo_map.places[place].distance(*point)) <= AT_PLACE:
        return Access({place: OFF_PASSAGE * apart}, footings, apart)
    found: dict[str, float] = {}
    for footing in footings:
        for end, cost in _ends(topo_map, costs, footing):
            found[end] = min(cost, found.get(end, math.inf))
    if isolated is not None and isolated[1] <= distance + SLACK:
        found[isolated[0]] = OFF_PASSAGE * isolated[1]
    return Access(found, footings, distance)


def _ends(topo_map: TopoMap, costs: EdgeCosts, footing: Footing) -> Iterator[tuple[str, float]]:
    """The ends of the passage that the footing leads to, with the cost of getting there."""
    passage = footing.passage
    factor = costs.factor(passage)
    ends = [passage.a, passage.b]
    if not math.isfinite(factor):  # shut: of its two ends only the nearer one is on our side
        factor = 1.0
        ends = [min(ends, key=footing.to_end)]
    if footing.aside > 0.5 * passage.width:  # a door is entered along its passage, not along a wall
        ends = [end for end in ends if topo_map.places[end].kind != "door"] or ends
    for end in ends:
        yield end, OFF_PASSAGE * footing.aside + factor * footing.to_end(end)


def _nearest_isolated(
    topo_map: TopoMap,
    point: tuple[float, float],
    place: str | None,
    part: frozenset[str] | None,
) -> tuple[str, float] | None:
    """The nearest place without any passage, and its distance."""
    names = topo_map.isolated if place is None else topo_map.isolated & {place}
    names = names if part is None else names & part
    distances = [(topo_map.places[name].distance(*point), name) for name in names]
    if not distances:
        return None
    distance, name = min(distances)
    return name, distance


def _foot(topo_map: TopoMap, footing: Footing) -> tuple[float, float]:
    a, b = topo_map.places[footing.passage.a], topo_map.places[footing.passage.b]
    share = 0.0 if footing.span == 0.0 else footing.along / footing.span
    return a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)


def _door_normal(topo_map: TopoMap, door: Place) -> tuple[float, float] | None:
    """The unit direction through a door, as its one or two passages tell it."""
    beyond = [topo_map.places[p.other(door.name)] for p in topo_map.passages_at(door.name)]
    if len(beyond) not in {1, 2}:
        return None
    start = beyond[1] if len(beyond) == 2 else door
    dx, dy = beyond[0].x - start.x, beyond[0].y - start.y
    length = math.hypot(dx, dy)
    return None if length == 0.0 else (dx / length, dy / length)
