"""The tour through a mission's goals: which waypoint is next, what is passed, when to plan anew."""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from itertools import pairwise

from navfw.errors import MapError
from navfw.papfis.routes import Route, Router, Spot
from navfw.papfis.waypoints import Passing, Point, distance_to_leg, has_passed, waypoints_of
from navfw.signals import PassageQuery, Waypoint

__all__ = ["Tour"]

LOOK_AHEAD = 2.5
"""How far ahead passages are asked about [m] (METHOD 4.3)."""


class Tour:
    """Goals to visit in order, and how far the robot has got with them.

    A goal's ``place`` names a place of the map, or is only a label. Each goal's route is planned
    from where the robot is when the goal before has been reached; the routes between later goals
    are planned at once, so that a goal that cannot be reached is found before the robot moves.

    Raises:
        MapError: two goals are not connected, or a goal is farther than ``max_off_map`` [m] from
            everything in the map.

    """

    def __init__(
        self,
        router: Router,
        goals: Sequence[Waypoint],
        passing: Passing,
        stray: float,
        max_off_map: float,
    ) -> None:
        self._router = router
        self._passing = passing
        self._stray = stray
        self._max_off_map = max_off_map
        self._goals = list(goals)
        self._ahead: list[Waypoint] = []
        self._came_from: Point = (0.0, 0.0)
        self.route: Route | None = None
        self.replans = 0
        self.shut: str | None = None
        for goal in goals:
            router.check_near(self._spot(goal), "goal", max_off_map)
        self._later = [
            self._waypoints(router.route(self._spot(before), self._spot(after)), after)
            for before, after in pairwise(goals)
        ]

    @property
    def path(self) -> list[Waypoint]:
        """All waypoints still ahead, nearest first, through to the last goal."""
        return [*self._ahead, *(waypoint for leg in self._later for waypoint in leg)]

    def queries(self, at: Point) -> list[PassageQuery]:
        """The legs from ``at`` to the present goal, as far as they begin within ``LOOK_AHEAD``."""
        queries, start, so_far = [], at, 0.0
        for waypoint in self._ahead:
            if so_far >= LOOK_AHEAD:
                break
            end = (waypoint.x, waypoint.y)
            if waypoint.passage is not None:
                queries.append(PassageQuery(waypoint.passage, start, end, waypoint.width))
            so_far += math.dist(start, end)
            start = end
        return queries

    def reconsider(self, at: Point, changed: AbstractSet[frozenset[str]]) -> None:
        """Plan anew from ``at`` if the way ahead leads through one of the ``changed`` passages.

        A tour that was ``shut`` does so at any change. Where no way is left, the old one holds, and
        ``shut`` says which passage bars it.
        """
        ahead = {frozenset(w.passage) for w in self._ahead if w.passage is not None}
        if self.route is not None and changed and (self.shut or ahead & changed):
            self._plan_anew(at)

    def head(self, at: Point) -> Waypoint | None:
        """The waypoint to head for from ``at`` (x, y) [m]; None when the last goal is reached.

        Raises:
            MapError: at the first call: the map does not connect ``at`` with the first goal.

        """
        if not self._goals:
            return None
        if self.route is None:
            self._router.check_near(Spot(*at), "start", self._max_off_map)
            self._follow(self._router.route(Spot(*at), self._spot(self._goals[0])), at)
        elif self._is_astray(at):
            self._plan_anew(at)
        while self._ahead and (passed := self._passed(at)):
            self._advance(passed, at)
        return self._ahead[0] if self._ahead else None

    def _passed(self, at: Point) -> int:
        """How many waypoints of the present goal are passed: all before the last that is near.

        A robot pushed aside by an obstacle may come upon a later waypoint first. Doors are never
        left out that way.
        """
        count = 0
        for index, waypoint in enumerate(self._ahead):
            if math.hypot(at[0] - waypoint.x, at[1] - waypoint.y) <= waypoint.tolerance:
                count = index + 1
            if waypoint.kind == "door" and count <= index:
                break
        if count == 0:
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
                self._plan_on(at)

    def _plan_anew(self, at: Point) -> None:
        self.replans += 1
        self._plan_on(at)

    def _plan_on(self, at: Point) -> None:
        try:
            route = self._router.route_within(Spot(*at), self._spot(self._goals[0]))
        except MapError:
            # closed passages, or the belief lies where the map has no way out: head on for what was
            # planned before
            self._came_from = at
            self.shut = self._why_shut()
        else:
            self._follow(route, at)

    def _follow(self, route: Route, at: Point) -> None:
        self.route = route
        self._ahead = self._waypoints(route, self._goals[0])
        self._came_from = at
        self.shut = None

    def _why_shut(self) -> str | None:
        """Which closed passages are on the way that was planned; None if nothing is closed."""
        every, costs = self._router.topo_map.passages, self._router.costs
        closed = [passage for passage in every if costs.closed(passage)]
        ahead = {frozenset(w.passage) for w in self._ahead if w.passage is not None}
        named = [passage for passage in closed if passage.ends in ahead] or closed
        if not named:
            return None
        listed = ", ".join(map(str, named[:3])) + (", ..." if len(named) > 3 else "")
        return f"the only way to {self._goals[0].label} is shut: {listed}"

    def _is_astray(self, at: Point) -> bool:
        head = self._ahead[0]
        return distance_to_leg(at, self._came_from, (head.x, head.y)) > self._stray

    def _waypoints(self, route: Route, goal: Waypoint) -> list[Waypoint]:
        return waypoints_of(route, goal, self._router.topo_map, self._passing)

    def _spot(self, goal: Waypoint) -> Spot:
        known = goal.place in self._router.topo_map.places
        return Spot(goal.x, goal.y, goal.place if known else None)
