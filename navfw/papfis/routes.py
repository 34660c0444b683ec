"""Global planning: the cheapest route between two points of the map by A*, its costs explained."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from navfw.errors import MapError
from navfw.numerics import Array
from navfw.numerics.products import sum_in_order
from navfw.papfis.access import OFF_PASSAGE_COST, Access, Doorways, find_access
from navfw.papfis.edge_costs import CostParams, EdgeCosts
from navfw.robot import RobotModel
from navfw.topomap import Passage, PassageProjection, Place, TopoMap


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The places on the cheapest path, in order, and its cost [m], entry and exit included."""

    places: tuple[str, ...]
    cost: float


class CostGraph:
    """The map's graph with one cost [m] per passage, to search for cheapest paths in.

    ``costs`` (passages,) is in the order of ``topo_map.passages``; infinite means impassable. Each
    cost must be at least the straight distance between its places: that keeps the straight-line
    heuristic admissible and consistent, so the first arrival at a place is the cheapest.
    """

    def __init__(self, topo_map: TopoMap, costs: Array) -> None:
        self._points = {place.name: (place.x, place.y) for place in topo_map.places.values()}
        self._neighbors: dict[str, dict[str, float]] = {name: {} for name in self._points}
        for passage, cost in zip(topo_map.passages, costs.tolist(), strict=True):
            self.set_cost(passage, cost)

    def set_cost(self, passage: Passage, cost: float) -> None:
        """Set the cost of one passage, at least its straight distance; infinite closes it."""
        for start, end in ((passage.a, passage.b), (passage.b, passage.a)):
            if math.isfinite(cost):
                self._neighbors[start][end] = cost
            else:
                self._neighbors[start].pop(end, None)

    def cheapest_path(
        self, entries: Mapping[str, float], exits: Mapping[str, float], goal: tuple[float, float]
    ) -> SearchResult | None:
        """Find the cheapest path from one of ``entries`` to one of ``exits``; None without one.

        Both map places to costs: from the start to the place, and from the place to the goal. The
        ``goal`` is at (x, y) [m]; no exit costs less than the straight distance to it.
        """
        points, neighbors, hypot = self._points, self._neighbors, math.hypot
        goal_x, goal_y = goal
        order = itertools.count()  # breaks ties: of equal costs the first pushed is popped first
        came_from: dict[str, str | None] = {}
        queue: list[tuple[float, int, float, str | None, str | None]] = []
        best: dict[str, float] = {}
        for entry, cost in entries.items():
            x, y = points[entry]
            best[entry] = cost
            queue.append((cost + hypot(x - goal_x, y - goal_y), next(order), cost, entry, None))
        heapq.heapify(queue)
        while queue:
            _, _, cost, name, previous = heapq.heappop(queue)
            if name is None:  # the goal itself
                return SearchResult(_trace(came_from, previous), cost)
            if name in came_from:
                continue
            came_from[name] = previous
            if name in exits:
                total = cost + exits[name]
                heapq.heappush(queue, (total, next(order), total, None, name))
            for neighbor, step in neighbors[name].items():
                reached = cost + step
                if neighbor not in came_from and reached < best.get(neighbor, math.inf):
                    best[neighbor] = reached
                    x, y = points[neighbor]
                    estimate = reached + hypot(x - goal_x, y - goal_y)
                    heapq.heappush(queue, (estimate, next(order), reached, neighbor, name))
        return None


def _trace(came_from: Mapping[str, str | None], last: str | None) -> tuple[str, ...]:
    places = []
    while last is not None:
        places.append(last)
        last = came_from[last]
    return tuple(reversed(places))


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Start or goal of a route: x, y [m] in ``map``; ``place`` if it is known to be at one."""

    x: float
    y: float
    place: str | None = None

    @property
    def point(self) -> tuple[float, float]:
        """(x, y) [m]."""
        return self.x, self.y

    def __str__(self) -> str:
        point = f"({self.x:.2f}, {self.y:.2f})"
        return point if self.place is None else f"{self.place!r} {point}"


@dataclass(frozen=True, slots=True)
class Route:
    """A route from ``start`` to ``goal``: the places to pass, and the ``passages`` between them.

    Without places it leads straight to the goal. ``legs`` has the passage to each place and, last,
    to the goal; None for a leg off all passages. ``cost`` [m] is the total, legs onto and off the
    map included, ``length`` [m] the route's length. ``entry_cost`` is the cost of the leg from the
    start to the first place, ``exit_cost`` of that from the last place to the goal.
    """

    start: Endpoint
    goal: Endpoint
    places: tuple[str, ...]
    passages: tuple[Passage, ...]
    legs: tuple[Passage | None, ...]
    cost: float
    length: float
    entry_cost: float
    exit_cost: float

    @property
    def widths(self) -> tuple[float, ...]:
        """Width [m] of each of ``legs`` by the map; inf off the passages."""
        return tuple(math.inf if leg is None else leg.width for leg in self.legs)


class Router:
    """Plans cheapest routes in one map for one robot.

    All edge costs are inferred once, by the constructor; ``close``, ``reopen`` and ``revise``
    change single ones.

    Raises:
        RuleBaseError: the rule base of the costs is invalid.

    """

    def __init__(
        self, topo_map: TopoMap, robot: RobotModel, params: CostParams | None = None
    ) -> None:
        self.topo_map, self._robot = topo_map, robot
        self.costs = EdgeCosts(topo_map, robot, params)
        self._graph = CostGraph(topo_map, self.costs.values)
        self._doorways = Doorways(topo_map)

    def access(self, end: Endpoint, component: frozenset[str] | None = None) -> Access:
        """Connect ``end`` to the map, or to one connected ``component`` of it (place names).

        Raises:
            UnknownNameError: the map has no place ``end.place``.

        """
        return find_access(
            self.topo_map, self.costs, self._doorways, end.point, end.place, component
        )

    def check_near(self, end: Endpoint, what: str, farthest: float) -> None:
        """Check that the distance of ``end`` to the map is at most ``farthest`` [m].

        Raises:
            MapError: it is larger; the message calls the point ``what`` ("start", "goal").

        """
        distance = self.access(end).distance
        if distance > farthest:
            raise MapError(
                f"the {what} {end} is {distance:.1f} m away from everything in the map "
                f"{self.topo_map.name!r} (allowed: {farthest:g} m); add a place near it",
                file=self.topo_map.file,
            )

    def part_at(self, end: Endpoint) -> frozenset[str]:
        """Return the connected part of the map that ``end`` belongs to, as place names."""
        by_cost = ((cost, name) for name, cost in self.access(end).costs.items())
        return self.topo_map.part_of(min(by_cost)[1])

    def route(self, start: Endpoint, goal: Endpoint) -> Route:
        """Plan the cheapest route; passages of high danger only where there is no other.

        Raises:
            MapError: there is none; the message names the parts of the map that are not connected,
                or the passages that are closed or too narrow.

        """
        return self._route(start, goal, self.access(start), self.access(goal))

    def route_within(self, start: Endpoint, goal: Endpoint) -> Route:
        """Plan like ``route``, but connect the start only to the part of the map with the goal.

        For a position estimate that lies in another part of the map, which the robot cannot be in.
        """
        access = self.access(start, self.part_at(goal))
        return self._route(start, goal, access, self.access(goal))

    @property
    def closed(self) -> list[Passage]:
        """Passages that are closed now, in the order of the map."""
        return [passage for passage in self.topo_map.passages if self.costs.is_closed(passage)]

    def close(self, passage: Passage, barrier: float | None = None) -> None:
        """Make a passage impassable, at ``barrier`` [m from its place ``a``] if that is known."""
        self.costs.close(passage, barrier)
        self._graph.set_cost(passage, math.inf)

    def reopen(self, passage: Passage) -> None:
        """Set the cost of a closed passage to that of the rules again."""
        self.costs.reopen(passage)
        self._graph.set_cost(passage, self.costs.of(passage))

    def revise(self, passage: Passage, **inputs: float) -> None:
        """Infer a passage's cost again, with these ``inputs`` (``danger``, ``uncertainty``)."""
        self.costs.revise(passage, **inputs)
        self._graph.set_cost(passage, self.costs.of(passage))

    def extend(self, places: Sequence[Place], passages: Sequence[Passage]) -> None:
        """Add places and passages that were found; closed passages stay closed."""
        before, closed = self.costs, self.closed
        known = [before.as_revised(passage) for passage in self.topo_map.passages]
        self.topo_map = self.topo_map.replaced(passages=known).extended(places, passages)
        self.costs = EdgeCosts(self.topo_map, self._robot, before.params)
        self._graph = CostGraph(self.topo_map, self.costs.values)
        self._doorways = Doorways(self.topo_map)
        for passage in closed:
            self.close(self.topo_map.passage(passage.a, passage.b), before.barrier(passage))

    def explain(self, route: Route) -> list[dict[str, Any]]:
        """Explain the cost of each passage of the route, rule by rule, as plain data.

        Passages are in the order of travel, and ``from`` and ``to`` are in its direction.
        """
        travelled = zip(route.passages, pairwise(route.places), strict=True)
        return [
            {**self.costs.explain(passage), "from": start, "to": end}
            for passage, (start, end) in travelled
        ]

    def _route(self, start: Endpoint, goal: Endpoint, entry: Access, leave: Access) -> Route:
        path = self._graph.cheapest_path(entry.costs, leave.costs, goal.point)
        direct = self._direct_cost(entry, leave)
        # at equal cost the route through places: it is more informative
        if direct is not None and (path is None or direct[0] < path.cost - 1e-9):
            cost, passage = direct
            straight = math.hypot(goal.x - start.x, goal.y - start.y)
            return Route(start, goal, (), (), (passage,), cost, straight, cost, 0.0)
        if path is None:
            raise self._no_route(start, goal)
        return self._route_by_places(start, goal, entry, leave, path)

    def _route_by_places(
        self, start: Endpoint, goal: Endpoint, entry: Access, leave: Access, path: SearchResult
    ) -> Route:
        first, last = (self.topo_map.places[path.places[i]] for i in (0, -1))
        passages = tuple(self.topo_map.passage(a, b) for a, b in pairwise(path.places))
        legs = (entry.passage_to(first.name), *passages, leave.passage_to(last.name))
        length = first.distance(*start.point) + last.distance(*goal.point)
        length += sum_in_order(passage.length for passage in passages)
        end_costs = entry.costs[first.name], leave.costs[last.name]
        return Route(start, goal, path.places, passages, legs, path.cost, length, *end_costs)

    def _direct_cost(self, entry: Access, leave: Access) -> tuple[float, Passage] | None:
        """Return cost and passage of a route along one passage beside both start and goal."""
        options = [
            (self._cost_between(a, b), a.passage)
            for a in entry.projections
            for b in leave.projections
            if a.passage is b.passage
        ]
        finite = (option for option in options if math.isfinite(option[0]))
        return min(finite, key=lambda option: (option[0], option[1].width), default=None)

    def _cost_between(self, a: PassageProjection, b: PassageProjection) -> float:
        factor = self.costs.factor(a.passage)
        along = abs(a.to_end(a.passage.a) - b.to_end(a.passage.a))
        # within a closed passage the obstacle may lie between the two points: infinite cost
        return OFF_PASSAGE_COST * (a.aside + b.aside) + (factor * along if along > 0.0 else 0.0)

    def _no_route(self, start: Endpoint, goal: Endpoint) -> MapError:
        begin, end = self.part_at(start), self.part_at(goal)
        closed = self.closed
        if begin == end and closed:
            message = (
                f"there is no route from {start} to {goal} without closed passages: "
                f"{first_names(closed, 5)}"
            )
        elif begin != end:
            message = (
                f"the map does not connect the start {start}, in {_part_text(begin)}, with the "
                f"goal {goal}, in {_part_text(end)}; add an edge between the two parts"
            )
        else:
            narrow = [p for p in self.topo_map.passages if p.width <= self.costs.robot_width]
            widths = ", ".join(f"{p} ({p.width:g} m)" for p in narrow[:5])
            message = (
                f"no route from {start} to {goal} is wide enough for the robot "
                f"({self.costs.robot_width:g} m); too narrow: {widths}"
            )
        return MapError(message, file=self.topo_map.file)


def _part_text(component: frozenset[str]) -> str:
    count = f"{len(component)} place{'s' if len(component) != 1 else ''}"
    return f"the part with {first_names(sorted(component), 5)} ({count})"


def first_names(items: Sequence[object], count: int) -> str:
    """List the first ``count`` of ``items`` for messages; an ellipsis stands for the rest."""
    return ", ".join(map(str, items[:count])) + (", ..." if len(items) > count else "")
