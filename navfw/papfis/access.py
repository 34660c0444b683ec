"""Getting on and off the map: which places a point in free space leads to, and at what cost.

A map says nothing about walls, and the place nearest to a robot is often behind one. What it does
say: passages are free in all their width, so a point within it can head for both ends; and a door
stands in a wall, so what lies beyond that wall is not to be headed for from anywhere else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.papfis.edge_costs import EdgeCosts
from navfw.topomap import Footing, Passage, Place, TopoMap

__all__ = ["AT_PLACE", "OFF_PASSAGE", "Access", "Doorways", "find_access"]

SLACK = 0.1
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

    def passage_to(self, place: str) -> Passage | None:
        """The narrowest passage by which the point leads to ``place``; None if by none."""
        passages = [f.passage for f in self.footings if place in f.passage.ends]
        return min(passages, key=lambda passage: passage.width, default=None)


class Doorways:
    """The doors of a map as pieces of the walls that they stand in."""

    def __init__(self, topo_map: TopoMap) -> None:
        centers, normals = [], []
        for place in topo_map.places.values():
            normal = _door_normal(topo_map, place) if place.kind == "door" else None
            if normal is not None:
                centers.append((place.x, place.y))
                normals.append(normal)
        self._centers = np.array(centers, dtype=np.float64).reshape(-1, 2)
        self._normals = np.array(normals, dtype=np.float64).reshape(-1, 2)

    def separate(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether ``start`` and ``end`` are on different sides of a door's wall, near that door."""
        from_start = np.array(start) - self._centers
        leg = np.array(end) - np.array(start)
        before = np.sum(from_start * self._normals, axis=1)
        after = before + self._normals @ leg
        # who stands in the wall's plane itself is on either side
        crossing = (before * after < 0.0) & (np.minimum(np.abs(before), np.abs(after)) > 1e-6)
        share = before[crossing] / (before[crossing] - after[crossing])
        point = from_start[crossing] + share[:, None] * leg
        normal = self._normals[crossing]
        beside = np.abs(point[:, 0] * normal[:, 1] - point[:, 1] * normal[:, 0])
        return bool(np.any(beside < WALL_REACH))


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
    options = [(f, _ends(topo_map, costs, doorways, point, f)) for f in near]
    # where walls hide everything, the map is odd: better a way that may be blocked than none
    options = [option for option in options if option[1]] or [
        (f, [f.passage.a, f.passage.b]) for f in near
    ]
    isolated = _nearest_isolated(topo_map, point, place, part)
    distance = min(
        options[0][0].aside if options else math.inf,
        math.inf if isolated is None else isolated[1],
    )
    options = [option for option in options if option[0].aside <= distance + SLACK]
    footings = [footing for footing, _ in options]
    if place is not None and (apart := topo_map.places[place].distance(*point)) <= AT_PLACE:
        return Access({place: OFF_PASSAGE * apart}, footings, apart)
    found: dict[str, float] = {}
    for footing, ends in options:
        for end in ends:
            found[end] = min(_cost_to(costs, footing, end), found.get(end, math.inf))
    if isolated is not None and isolated[1] <= distance + SLACK:
        found[isolated[0]] = OFF_PASSAGE * isolated[1]
    return Access(found, footings, distance)


def _ends(
    topo_map: TopoMap,
    costs: EdgeCosts,
    doorways: Doorways,
    point: tuple[float, float],
    footing: Footing,
) -> list[str]:
    """The ends of the passage that a point beside it can head for; none if a wall hides it."""
    passage = footing.passage
    ends = [passage.a, passage.b]
    if not math.isfinite(costs.of(passage)):  # shut: only one end is on our side
        barrier = costs.barrier(passage)
        if barrier is None:
            ends = [min(ends, key=footing.to_end)]
        else:
            ends = [passage.a if footing.to_end(passage.a) <= barrier else passage.b]
    if footing.aside <= 0.5 * passage.width:
        return ends
    if doorways.separate(point, _foot(topo_map, footing)):
        return []
    # from beside the passage a door cannot be entered: it is approached along its passage
    places = [topo_map.places[end] for end in ends]
    places = [place for place in places if place.kind != "door"]
    return [at.name for at in places if not doorways.separate(point, (at.x, at.y))]


def _cost_to(costs: EdgeCosts, footing: Footing, end: str) -> float:
    factor = costs.factor(footing.passage)
    along = footing.to_end(end) * (factor if math.isfinite(factor) else 1.0)
    return OFF_PASSAGE * footing.aside + along


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
