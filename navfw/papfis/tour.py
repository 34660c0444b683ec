"""The tour through a mission's goals: the next waypoint, waypoints passed, and replanning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from itertools import pairwise

from navfw.errors import MapError
from navfw.papfis.routes import Endpoint, Route, Router
from navfw.papfis.waypoints import (
    PassingTolerances,
    Point,
    distance_to_leg,
    has_passed,
    waypoints_of,
)
from navfw.signals import PassageQuery, Waypoint

_QUERY_RANGE = 2.5
"""Distance along the path up to which passages are queried [m] (METHOD 4.3)."""


class Tour:
    """Goals to visit in order, and the waypoints still ahead.

    A goal's ``place`` names a place of the map, or is only a label. Each goal's route is planned
    from the robot's position when the goal before has been reached; the routes between later goals
    are planned by the constructor, so that an unreachable goal is found before the robot moves.
    ``route`` is the one to the present goal; ``no_route_reason`` names the closed passages while
    there is none.

    Raises:
        MapError: two goals are not connected, or a goal is farther than ``max_off_map`` [m] from
            everything in the map.

    """

    def __init__(
        self,
        router: Router,
        goals: Sequence[Waypoint],
        passing: PassingTolerances,
        replan_distance: float,
        max_off_map: float,
    ) -> None:
        self._router = router
        self._passing = passing
        self._replan_distance = replan_distance
        self._max_off_map = max_off_map
        self._goals = list(goals)
        self._ahead: list[Waypoint] = []
        self._came_from: Point = (0.0, 0.0)
        self.route: Route | None = None
        self.replans = 0
        self.no_route_reason: str | None = None
        for goal in goals:
            router.check_near(self._endpoint(goal), "goal", max_off_map)
        self._later = [
            self._waypoints(router.route(self._endpoint(before), self._endpoint(after)), after)
            for before, after in pairwise(goals)
        ]

    @property
    def path(self) -> list[Waypoint]:
        """All waypoints still ahead, nearest first, through to the last goal."""
        return [*self._ahead, *(waypoint for leg in self._later for waypoint in leg)]

    def queries(self, at: Point) -> list[PassageQuery]:
        """The legs from ``at`` to the present goal that begin within ``_QUERY_RANGE``."""
        queries, start, so_far = [], at, 0.0
        for waypoint in self._ahead:
            if so_far >= _QUERY_RANGE:
                break
            end = (waypoint.x, waypoint.y)
            if waypoint.passage is not None:
                queries.append(PassageQuery(waypoint.passage, start, end, waypoint.width))
            so_far += math.dist(start, end)
            start = end
        return queries

    def replan_if_changed(self, at: Point, changed: AbstractSet[frozenset[str]]) -> None:
        """Replan from ``at`` if the path ahead uses one of the ``changed`` passages.

        While there is no route, any change causes it. Where no route is found, the old one is kept,
        and ``no_route_reason`` names the closed passages.
        """
        ahead = {frozenset(w.passage) for w in self._ahead if w.passage is not None}
        if self.route is not None and changed and (self.no_route_reason or ahead & changed):
            self._replan(at)

    def next_waypoint(self, at: Point, *, sure: bool = True) -> Waypoint | None:
        """The waypoint to drive to from ``at`` (x, y) [m]; None when the last goal is reached.

        While the robot is not ``sure`` of its position, no goal counts as reached.

        Raises:
            MapError: at the first call: the map does not connect ``at`` with the first goal.

        """
        if not self._goals:
            return None
        if self.route is None:
            self._router.check_near(Endpoint(*at), "start", self._max_off_map)
            self._follow(self._router.route(Endpoint(*at), self._endpoint(self._goals[0])), at)
        elif self._is_off_path(at):
            self._replan(at)
        while self._ahead and (passed := self._passed(at, sure)):
            self._advance(passed, at)
        return self._ahead[0] if self._ahead else None

    def _passed(self, at: Point, sure: bool) -> int:
        """Number of waypoints passed: all up to the last one within its tolerance.

        A robot that avoids an obstacle may reach a later waypoint first. Doors are never skipped
        that way.
        """
        count = 0
        for index, waypoint in enumerate(self._ahead):
            if waypoint.final and not sure:
                break
            if math.hypot(at[0] - waypoint.x, at[1] - waypoint.y) <= waypoint.tolerance:
                count = index + 1
            if waypoint.kind == "door" and count <= index:
                break
        if count == 0 and (sure or not self._ahead[0].final):
            after = self._ahead[1] if len(self._ahead) > 1 else None
            count = int(has_passed(at, self._came_from, self._ahead[0], after, self._passing))
        return count

    def _advance(self, count: int, at: Point) -> None:
        last = self._ahead[count - 1]
        del self._ahead[:count]
        self._came_from = (last.x, last.y)
        if last.final:
            self._goals.pop(0)
            if self._goals:
                self._ahead = self._later.pop(0)
                self._plan(at)

    def _replan(self, at: Point) -> None:
        self.replans += 1
        self._plan(at)

    def _plan(self, at: Point) -> None:
        try:
            route = self._router.route_within(Endpoint(*at), self._endpoint(self._goals[0]))
        except MapError:
            # closed passages, or a position estimate without access to the map: keep the old route
            self._came_from = at
            self.no_route_reason = self._closed_on_route()
        else:
            self._follow(route, at)

    def _follow(self, route: Route, at: Point) -> None:
        self.route = route
        self._ahead = self._waypoints(route, self._goals[0])
        self._came_from = at
        self.no_route_reason = None

    def _closed_on_route(self) -> str | None:
        """Message with the closed passages on the planned route; None if none is closed."""
        every, costs = self._router.topo_map.passages, self._router.costs
        closed = [passage for passage in every if costs.is_closed(passage)]
        ahead = {frozenset(w.passage) for w in self._ahead if w.passage is not None}
        named = [passage for passage in closed if passage.ends in ahead] or closed
        if not named:
            return None
        listed = ", ".join(map(str, named[:3])) + (", ..." if len(named) > 3 else "")
        return f"the only route to {self._goals[0].label} is closed: {listed}"

    def _is_off_path(self, at: Point) -> bool:
        end = self._ahead[0]
        return distance_to_leg(at, self._came_from, (end.x, end.y)) > self._replan_distance

    def _waypoints(self, route: Route, goal: Waypoint) -> list[Waypoint]:
        return waypoints_of(route, goal, self._router.topo_map, self._passing)

    def _endpoint(self, goal: Waypoint) -> Endpoint:
        known = goal.place in self._router.topo_map.places
        return Endpoint(goal.x, goal.y, goal.place if known else None)
