"""Global planning: the cheapest way from a point of the map to a goal, with its costs explained."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from navfw.errors import MapError
from navfw.papfis.access import OFF_PASSAGE, Access, Doorways, find_access
from navfw.papfis.edge_costs import CostParams, EdgeCosts
from navfw.papfis.graph_search import Found, RoadNetwork
from navfw.robot import RobotModel
from navfw.topomap import Footing, Passage, TopoMap

__all__ = ["Route", "Router", "Spot"]


@dataclass(frozen=True, slots=True)
class Spot:
    """Where a route begins or ends: x, y [m] in ``map``; ``place`` if it is known to be at one."""

    x: float
    y: float
    place: str | None = None

    @property
    def point(self) -> tuple[float, float]:
        """(x, y)."""
        return self.x, self.y

    def __str__(self) -> str:
        where = f"({self.x:.2f}, {self.y:.2f})"
        return where if self.place is None else f"{self.place!r} {where}"


@dataclass(frozen=True, slots=True)
class Route:
    """The places to pass, in order, and the passages between them.

    No places means: straight to the goal. ``legs`` are the passages by which the way leads to each
    place and, last, to the goal; None where it leads beside all of them. ``cost`` is the whole,
    with the ways onto and off the map, and ``length`` [m] the way's length by the map.
    ``entry_cost`` is that of the way from the start to the first place, ``exit_cost`` that from the
    last place to the goal.
    """

    start: Spot
    goal: Spot
    places: tuple[str, ...]
    passages: tuple[Passage, ...]
    legs: tuple[Passage | None, ...]
    cost: float
    length: float
    entry_cost: float
    exit_cost: float

    @property
    def widths(self) -> tuple[float, ...]:
        """Width [m] of each leg, as the map has it; inf beside all passages."""
        return tuple(math.inf if leg is None else leg.width for leg in self.legs)


class Router:
    """Plans routes in one map for one robot.

    All edge costs are worked out once, here; ``close``, ``reopen`` and ``revise`` change single
    ones.

    Raises:
        RuleBaseError: the rule base of the costs is not usable.

    """

    def __init__(
        self, topo_map: TopoMap, robot: RobotModel, params: CostParams | None = None
    ) -> None:
        self.topo_map = topo_map
        self.costs = EdgeCosts(topo_map, robot, params)
        self._roads = RoadNetwork(topo_map, self.costs.values)
        self._doorways = Doorways(topo_map)

    def access(self, spot: Spot, part: frozenset[str] | None = None) -> Access:
        """How ``spot`` is joined to the map, or to one ``part`` of it.

        Raises:
            UnknownNameError: the map has no place of the spot's name.

        """
        return find_access(self.topo_map, self.costs, self._doorways, spot.point, spot.place, part)

    def check_near(self, spot: Spot, what: str, farthest: float) -> None:
        """Make sure that ``spot`` is not farther than ``farthest`` [m] from everything in the map.

        Raises:
            MapError: it is; ``what`` says what it should have been.

        """
        distance = self.access(spot).distance
        if distance > farthest:
            raise MapError(
                f"the {what} {spot} is {distance:.1f} m away from everything in the map "
                f"{self.topo_map.name!r} (allowed: {farthest:g} m); add a place near it",
                file=self.topo_map.file,
            )

    def part_at(self, spot: Spot) -> frozenset[str]:
        """The connected part of the map that ``spot`` belongs to."""
        return self.topo_map.part_of(min(self.access(spot).costs.items(), key=_by_cost)[0])

    def route(self, start: Spot, goal: Spot) -> Route:
        """The cheapest way; passages of high danger only where there is no other.

        Raises:
            MapError: none leads there; the message says which parts of the map are apart, or which
                passages are too narrow.

        """
        return self._route(start, goal, self.access(start), self.access(goal))

    def route_within(self, start: Spot, goal: Spot) -> Route:
        """Like ``route``, for a start known to be connected to the goal: the belief has strayed."""
        access = self.access(start, self.part_at(goal))
        return self._route(start, goal, access, self.access(goal))

    def close(self, passage: Passage, barrier: float | None = None) -> None:
        """Let no route pass there; ``barrier`` [m from its place ``a``] is where it is barred."""
        self.costs.close(passage, barrier)
        self._roads.set_cost(passage, math.inf)

    def reopen(self, passage: Passage) -> None:
        """Let routes pass there again, at the cost that its rules give."""
        self.costs.reopen(passage)
        self._roads.set_cost(passage, self.costs.of(passage))

    def revise(self, passage: Passage, **inputs: float) -> None:
        """Give some inputs of the cost's rules (``danger``, ``uncertainty``) other values."""
        self.costs.revise(passage, **inputs)
        self._roads.set_cost(passage, self.costs.of(passage))

    def explain(self, route: Route) -> list[dict[str, Any]]:
        """For each passage of the route its cost, rule by rule, as plain data."""
        return [self.costs.explain(passage) for passage in route.passages]

    def _route(self, start: Spot, goal: Spot, entry: Access, leave: Access) -> Route:
        found = self._roads.cheapest(entry.costs, leave.costs, goal.point)
        direct = self._direct_cost(entry, leave)
        # at equal cost the way by the places: it tells more
        if direct is not None and (found is None or direct[0] < found.cost - 1e-9):
            cost, passage = direct
            straight = math.hypot(goal.x - start.x, goal.y - start.y)
            return Route(start, goal, (), (), (passage,), cost, straight, cost, 0.0)
        if found is None:
            raise self._no_way(start, goal)
        return self._found(start, goal, entry, leave, found)

    def _found(self, start: Spot, goal: Spot, entry: Access, leave: Access, found: Found) -> Route:
        first, last = (self.topo_map.places[found.places[i]] for i in (0, -1))
        passages = tuple(self.topo_map.passage(a, b) for a, b in pairwise(found.places))
        legs = (entry.passage_to(first.name), *passages, leave.passage_to(last.name))
        length = first.distance(*start.point) + last.distance(*goal.point)
        length += sum(passage.length for passage in passages)
        ways = entry.costs[first.name], leave.costs[last.name]
        return Route(start, goal, found.places, passages, legs, found.cost, length, *ways)

    def _direct_cost(self, entry: Access, leave: Access) -> tuple[float, Passage] | None:
        """Cost and passage of the way along it, where start and goal are both beside it."""
        options = [
            (self._cost_between(a, b), a.passage)
            for a in entry.footings
            for b in leave.footings
            if a.passage is b.passage
        ]
        ways = (way for way in options if math.isfinite(way[0]))
        return min(ways, key=lambda way: (way[0], way[1].width), default=None)

    def _cost_between(self, a: Footing, b: Footing) -> float:
        factor = self.costs.factor(a.passage)
        along = abs(a.to_end(a.passage.a) - b.to_end(a.passage.a))
        # within a shut passage nobody knows on which side of the obstacle either of them is
        return OFF_PASSAGE * (a.aside + b.aside) + (factor * along if along > 0.0 else 0.0)

    def _no_way(self, start: Spot, goal: Spot) -> MapError:
        begin, end = self.part_at(start), self.part_at(goal)
        closed = [passage for passage in self.topo_map.passages if self.costs.closed(passage)]
        if begin == end and closed:
            listed = ", ".join(map(str, closed[:5])) + (", ..." if len(closed) > 5 else "")
            message = f"no way leads from {start} to {goal} without what is closed: {listed}"
        elif begin != end:
            message = (
                f"the map does not connect the start {start}, in {_part_text(begin)}, with the "
                f"goal {goal}, in {_part_text(end)}; add an edge between the two parts"
            )
        else:
            narrow = [p for p in self.topo_map.passages if p.width <= self.costs.robot_width]
            listed = ", ".join(f"{p} ({p.width:g} m)" for p in narrow[:5])
            message = (
                f"no way from {start} to {goal} is wide enough for the robot "
                f"({self.costs.robot_width:g} m); too narrow: {listed}"
            )
        return MapError(message, file=self.topo_map.file)


def _part_text(part: frozenset[str]) -> str:
    names: Sequence[str] = sorted(part)
    listed = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
    return f"the part with {listed} ({len(names)} place{'s' if len(names) != 1 else ''})"


def _by_cost(item: tuple[str, float]) -> tuple[float, str]:
    return item[1], item[0]
