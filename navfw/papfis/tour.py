"""The tour through a mission's goals: routes, and the waypoints ahead; replanning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from itertools import pairwise

from navfw.errors import MapError
from navfw.papfis.access import AT_PLACE
from navfw.papfis.found_doors import FoundDoors
from navfw.papfis.routes import Endpoint, Route, Router, first_names
from navfw.papfis.string_pulling import StringPuller
from navfw.papfis.waypoints import (
    FULL_TOLERANCE_CLEARANCE,
    PassingTolerances,
    distance_to_leg,
    has_passed,
    waypoints_of,
)
from navfw.signals import PassageQuery, PassageReport, Waypoint

Point = tuple[float, float]

_MAX_COVERED = 2  # chosen
"""Reports in a row of something on a waypoint, before it is passed over."""
_QUERY_RANGE = 6.0  # chosen
"""Distance along the path up to which legs are queried [m]."""
_VIA_LASTS = 4  # chosen
"""Reports without a straight line after which the robot heads for the next place again."""


class Tour:
    """Follows a mission: goals to visit in order, and the waypoints still ahead.

    A goal's ``place`` names a place of the map, or is only a label. Each goal's route is planned
    from the robot's position when the goal before has been reached; the routes between later goals
    are planned by the constructor, so that an unreachable goal is found before the robot moves.
    ``route`` is the one to the present goal, by ``router``; ``no_route_reason`` names the closed
    passages while there is none.

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
        self.router = router
        self._passing = passing
        self._replan_distance = replan_distance
        self._max_off_map = max_off_map
        self._goals = list(goals)
        self._ahead: list[Waypoint] = []
        self._came_from: Point = (0.0, 0.0)
        self._covered = 0
        self._puller = StringPuller(router, router.costs.robot_width / 2.0)
        self._via: Waypoint | None = None
        self._before_via = self._via_reports = 0
        self.doors = FoundDoors(router.topo_map)
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
        """All waypoints still ahead, next first, up to the last goal."""
        return [*self._ahead, *(waypoint for leg in self._later for waypoint in leg)]

    @property
    def goal(self) -> Waypoint | None:
        """The present goal; None past the last."""
        return self._goals[0] if self._goals else None

    @property
    def passage_ahead(self) -> tuple[str, str] | None:
        """The passage that the robot is on; None off all passages."""
        return self._ahead[0].passage if self._ahead else None

    def arrive(self, at: Point) -> None:
        """Go on to the next goal: the robot, ``at`` (x, y) [m], has reached the present one."""
        self._advance(len(self._ahead), at)

    def queries(self, at: Point) -> list[PassageQuery]:
        """Return the legs from ``at`` to the present goal that begin within 6 m of path."""
        queries, start, so_far = [], at, 0.0
        for waypoint in self._ahead:
            if so_far >= _QUERY_RANGE:
                break
            end = (waypoint.x, waypoint.y)
            if waypoint.passage is not None:
                normal = self.doors.normal(waypoint)
                queries.append(PassageQuery(waypoint.passage, start, end, waypoint.width, normal))
            so_far += math.dist(start, end)
            start = end
        return queries

    def replan_if_changed(self, at: Point, changed: AbstractSet[frozenset[str]]) -> None:
        """Replan from ``at`` if the path ahead uses one of the ``changed`` passages.

        While there is no route, any change causes it. If no route is found, the old one is kept,
        and ``no_route_reason`` names the closed passages.
        """
        ahead = {frozenset(w.passage) for w in self._ahead if w.passage is not None}
        if self.route is not None and changed and (self.no_route_reason or ahead & changed):
            self._replan(at)

    def pass_over(self, covered: Sequence[Point], at: Point) -> None:
        """Skip the next waypoint if it is ``covered`` by an obstacle in two reports in a row.

        Goals and doors are never skipped. The robot, ``at`` (x, y) [m], heads for the one after it.
        """
        ahead = next(iter(self._ahead), None)
        if ahead is None or ahead.final or ahead.kind == "door":
            self._covered = 0
            return
        self._covered = self._covered + 1 if (ahead.x, ahead.y) in covered else 0
        if self._covered == _MAX_COVERED:
            self._advance(1, at)
            self._came_from = at

    def pull(self, report: PassageReport, at: Point) -> None:
        """Head for the farthest point of the route to which a straight line of ``report`` leads.

        No line leads beyond a door in which the body has to be straight, or the place before it.
        """
        if self.doors.slide(self._ahead, dict(report.openings), at):
            self._via, self._before_via = None, 0
        if not self._ahead:
            return
        lines, last = report.lines, 0
        for waypoint, after in pairwise(self._ahead):
            if self._is_tight(waypoint) or self._is_tight(after):
                break
            last += 1
        farthest = None if lines is None else self._puller.farthest(lines, at, self._ahead, last)
        if farthest is None:
            self._via_reports += 1
            if self._via_reports >= _VIA_LASTS:
                self._via, self._before_via = None, 0
            return
        self._before_via, (x, y) = farthest
        end, self._via_reports = self._ahead[self._before_via], 0
        if math.dist((x, y), (end.x, end.y)) > AT_PLACE:
            tolerance = self._passing.open
            end = replace(end, x=x, y=y, tolerance=tolerance, kind="waypoint", final=False)
        self._via, self._via_from = end, at

    def _is_tight(self, waypoint: Waypoint) -> bool:
        free = 0.5 * waypoint.width - self._passing.body
        narrow = free <= FULL_TOLERANCE_CLEARANCE or waypoint.place in self.doors
        return waypoint.kind == "door" and narrow

    def next_waypoint(self, at: Point, *, sure: bool = True) -> Waypoint | None:
        """Return the waypoint to drive to from ``at`` (x, y) [m]; None past the last goal.

        While the robot is not ``sure`` of its position, no goal counts as reached.

        Raises:
            MapError: at the first call: the map does not connect ``at`` with the first goal.

        """
        if not self._goals:
            return None
        if self.route is None:
            self.router.check_near(Endpoint(*at), "start", self._max_off_map)
            self._follow(self.router.route(Endpoint(*at), self._endpoint(self._goals[0])), at)
        elif self._is_off_path(at):
            self._replan(at)
        via = self._via
        if via is not None and not via.final and math.dist(at, (via.x, via.y)) <= via.tolerance:
            self._advance(self._before_via, at)
            self._via, self._before_via = None, 0
        while self._ahead and (passed := self._passed(at, sure)):
            self._advance(passed, at)
        return self._via or (self._ahead[0] if self._ahead else None)

    def _passed(self, at: Point, sure: bool) -> int:
        """Count the waypoints passed: all up to the last one within its tolerance.

        A robot that avoids an obstacle may reach a later waypoint first. Doors are never skipped
        like that.
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
            after = next(iter(self._ahead[1:]), None)
            passing = replace(self._passing, reach=math.inf) if self._before_via else self._passing
            count = int(has_passed(at, self._came_from, self._ahead[0], after, passing))
        return count

    def _advance(self, count: int, at: Point) -> None:
        if count == 0:
            return
        last = self._ahead[count - 1]
        del self._ahead[:count]
        self._before_via -= count
        if self._before_via < 0:
            self._via, self._before_via = None, 0
        self._came_from = (last.x, last.y)
        self._covered = 0
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
            route = self.router.route_within(Endpoint(*at), self._endpoint(self._goals[0]))
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
        self._via, self._before_via = None, 0
        self.no_route_reason = None

    def _closed_on_route(self) -> str | None:
        """Return a message with the closed passages on the route; None if none is closed."""
        closed = self.router.closed
        ahead = {frozenset(w.passage) for w in self._ahead if w.passage is not None}
        named = [passage for passage in closed if passage.ends in ahead] or closed
        if not named:
            return None
        return f"the only route to {self._goals[0].label} is closed: {first_names(named, 3)}"

    def _is_off_path(self, at: Point) -> bool:
        end, start = self._ahead[0], self._came_from
        if self._via is not None:
            end, start = self._via, self._via_from
        return distance_to_leg(at, start, (end.x, end.y)) > self._replan_distance

    def _waypoints(self, route: Route, goal: Waypoint) -> list[Waypoint]:
        mapped = waypoints_of(route, goal, self.router.topo_map, self._passing)
        return [self.doors.as_found(waypoint) for waypoint in mapped]

    def _endpoint(self, goal: Waypoint) -> Endpoint:
        on_map = goal.place in self.router.topo_map.places
        return Endpoint(goal.x, goal.y, goal.place if on_map else None)
