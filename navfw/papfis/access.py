"""Access from a point in free space to the map: the places it can reach directly, and their costs.

A topological map has no walls, and the place nearest to a robot is often behind one. Two rules
follow from what it has: passages are free over their whole width, so a point within one can reach
both its ends; and doors stand in walls, so a straight line that crosses a door's wall beside the
door is blocked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.numerics.products import product
from navfw.papfis.edge_costs import EdgeCosts
from navfw.topomap import Passage, PassageProjection, TopoMap

_DISTANCE_SLACK = 0.1  # chosen
"""Passages up to this much farther than the nearest accessible one are used too [m]."""

_SEARCH_RANGE = 3.0  # chosen
"""Passages up to this much farther than the nearest are tried where walls hide nearer ones [m]."""

OFF_PASSAGE_COST = 2.0  # chosen
"""Cost per metre off the passages, where the map does not guarantee free space."""

AT_PLACE = 0.05  # chosen
"""Distance up to which a point counts as at its place [m]."""

_WALL_REACH = 3.5  # chosen
"""Assumed extent of a door's wall to each side of the door [m]."""


@dataclass(frozen=True, slots=True)
class Access:
    """How a point in free space is connected to the map: the places that it can reach directly.

    ``costs`` has the cost between the point and each of them, at least the straight distance;
    ``projections`` are those onto the accessible passages, nearest first (empty if only places
    without passages are reachable); ``distance`` [m] is that to the nearest of all these.
    """

    costs: Mapping[str, float]
    projections: Sequence[PassageProjection]
    distance: float

    def passage_to(self, place: str) -> Passage | None:
        """Return the narrowest accessible passage that ends at ``place``; None without one."""
        passages = [p.passage for p in self.projections if place in p.passage.ends]
        return min(passages, key=lambda passage: passage.width, default=None)


class Doorways:
    """Knows in which walls the doors of a map stand, to judge whether a wall separates points."""

    def __init__(self, topo_map: TopoMap) -> None:
        centers, normals = [], []
        for place in topo_map.places.values():
            normal = topo_map.door_normal(place) if place.kind == "door" else None
            if normal is not None:
                centers.append((place.x, place.y))
                normals.append(normal)
        self._centers = np.array(centers, dtype=np.float64).reshape(-1, 2)
        self._normals = np.array(normals, dtype=np.float64).reshape(-1, 2)

    def separate(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Return whether the line ``start`` to ``end`` [m] crosses a door's wall near the door."""
        from_start = np.array(start) - self._centers
        leg = np.array(end) - np.array(start)
        before = np.sum(from_start * self._normals, axis=1)
        after = before + product(self._normals, leg)
        # a point in the wall's plane itself counts as on either side
        crossing = (before * after < 0.0) & (np.minimum(np.abs(before), np.abs(after)) > 1e-6)
        share = before[crossing] / (before[crossing] - after[crossing])
        point = from_start[crossing] + share[:, None] * leg
        normal = self._normals[crossing]
        beside = np.abs(point[:, 0] * normal[:, 1] - point[:, 1] * normal[:, 0])
        return bool(np.any(beside < _WALL_REACH))


def find_access(
    topo_map: TopoMap,
    costs: EdgeCosts,
    doorways: Doorways,
    point: tuple[float, float],
    place: str | None = None,
    component: frozenset[str] | None = None,
) -> Access:
    """Connect ``point`` (x, y) [m] to the map: by the nearest passages that no wall hides.

    If walls hide all passages, the nearest are used. A known ``place`` restricts the choice to it
    and the passages that end there; a connected ``component`` (place names) to its places and
    passages. A point within 5 cm of its known place has access to that place only.
    """
    among: Sequence[Passage] | None = None
    if place is not None:
        among = topo_map.passages_at(place)
    elif component is not None:
        among = [passage for passage in topo_map.passages if passage.a in component]
    near = topo_map.project_onto_passages(*point, slack=_SEARCH_RANGE, among=among)
    options = [(p, _reachable_ends(topo_map, costs, doorways, point, p)) for p in near]
    # where walls hide every passage, use the nearest all the same: a doubtful route, but a route
    options = [option for option in options if option[1]] or [
        (p, [p.passage.a, p.passage.b]) for p in near
    ]
    isolated = _nearest_isolated(topo_map, point, place, component)
    distance = min(
        options[0][0].aside if options else math.inf,
        math.inf if isolated is None else isolated[1],
    )
    options = [option for option in options if option[0].aside <= distance + _DISTANCE_SLACK]
    projections = [projection for projection, _ in options]
    if place is not None and (apart := topo_map.places[place].distance(*point)) <= AT_PLACE:
        return Access({place: OFF_PASSAGE_COST * apart}, projections, apart)
    end_costs: dict[str, float] = {}
    for projection, ends in options:
        for end in ends:
            end_costs[end] = min(_cost_to(costs, projection, end), end_costs.get(end, math.inf))
    if isolated is not None and isolated[1] <= distance + _DISTANCE_SLACK:
        end_costs[isolated[0]] = OFF_PASSAGE_COST * isolated[1]
    return Access(end_costs, projections, distance)


def _reachable_ends(
    topo_map: TopoMap,
    costs: EdgeCosts,
    doorways: Doorways,
    point: tuple[float, float],
    projection: PassageProjection,
) -> list[str]:
    """Return the ends of the passage that the point can reach directly; none behind a wall."""
    passage = projection.passage
    ends = [passage.a, passage.b]
    if not math.isfinite(costs.of(passage)):  # impassable: only the end on this side
        barrier = costs.barrier(passage)
        if barrier is None:
            ends = [min(ends, key=projection.to_end)]
        else:
            ends = [passage.a if projection.to_end(passage.a) <= barrier else passage.b]
    if projection.aside <= 0.5 * passage.width:
        return ends
    if doorways.separate(point, _foot(topo_map, projection)):
        return []
    # a door is approached along its passage, not from beside it
    places = [topo_map.places[end] for end in ends]
    places = [place for place in places if place.kind != "door"]
    return [at.name for at in places if not doorways.separate(point, (at.x, at.y))]


def _cost_to(costs: EdgeCosts, projection: PassageProjection, end: str) -> float:
    factor = costs.factor(projection.passage)
    along = projection.to_end(end) * (factor if math.isfinite(factor) else 1.0)
    return OFF_PASSAGE_COST * projection.aside + along


def _nearest_isolated(
    topo_map: TopoMap,
    point: tuple[float, float],
    place: str | None,
    component: frozenset[str] | None,
) -> tuple[str, float] | None:
    names = topo_map.isolated if place is None else topo_map.isolated & {place}
    names = names if component is None else names & component
    distances = [(topo_map.places[name].distance(*point), name) for name in names]
    return min(distances)[::-1] if distances else None


def _foot(topo_map: TopoMap, projection: PassageProjection) -> tuple[float, float]:
    """Return the projected point (x, y) [m]."""
    a, b = topo_map.places[projection.passage.a], topo_map.places[projection.passage.b]
    share = projection.share
    return a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)
