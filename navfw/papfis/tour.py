"""The tour through a mission's goals: waypoints of the routes, passing them, and replanning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from itertools import pairwise

from navfw.errors import MapError
from navfw.papfis.access import AT_PLACE
from navfw.papfis.found_doors import FoundDoors
from navfw.papfis.routes import Endpoint, Route, Router, first_names
from navfw.papfis.string_pulling import StringPuller
from navfw.signals import PassageQuery, PassageReport, Waypoint
from navfw.topomap import Passage, TopoMap

Point = tuple[float, float]

_MAX_TURN = math.radians(120.0)  # chosen
"""Largest turn at a waypoint for which its bisector decides whether it is passed [rad]."""

_FULL_TOLERANCE_CLEARANCE = 0.27  # chosen
"""Free width [m] between the body and each post of a door above which the tolerance beside it is
the whole one: a wide robot that comes from aside does not fit through."""

MIN_SHARE = 0.3  # chosen
"""Least share of the tolerance beside a door."""


@dataclass(frozen=True, slots=True)
class PassingTolerances:
    """Distances [m] within which a waypoint counts as passed: in the open, in and beside a door.

    A waypoint left behind counts as passed within ``reach`` [m] too, except a door passed outside
    its gap. Beside a door in whose width a robot of the radius ``body`` [m] about its turning
    centre can turn, the tolerance is smaller for wide robots; another robot could not comply.
    """

    open: float = 0.6
    door: float = 0.25
    beside_door: float = 0.35
    reach: float = 1.0
    body: float = 0.0

    def tolerances(self, kinds: Sequence[str], widths: Sequence[float]) -> list[float]:
        """Return the tolerances [m] at a route's places of these ``kinds`` and ``widths`` [m]."""
        return [
            self._tolerance(kind, [widths[k] for k in (i - 1, i + 1) if _is_door(kinds, k)])
            for i, kind in enumerate(kinds)
        ]

    def _tolerance(self, kind: str, doors: Sequence[float]) -> float:
        """Return the tolerance [m] at a place of that kind, beside doors of these widths [m]."""
        if kind == "door":
            return self.door
        if not doors:
            return self.open
        free = 0.5 * min(doors) - self.body
        if free <= 0.0:
            return self.beside_door
        return self.beside_door * min(max(free / _FULL_TOLERANCE_CLEARANCE, MIN_SHARE), 1.0)


def _is_door(kinds: Sequence[str], index: int) -> bool:
    return 0 <= index < len(kinds) and kinds[index] == "door"


def waypoints_of(
    route: Route, goal: Waypoint, topo_map: TopoMap, passing: PassingTolerances
) -> list[Waypoint]:
    """Convert ``route`` to waypoints, the goal last.

    A door's width is that of the narrower passage at it. A first place where the route starts is
    left out, and so is a last place within the goal's tolerance, unless it is a door.
    """
    places = [topo_map.places[name] for name in route.places]
    kinds = [place.kind for place in places]
    widths = list(route.widths[: len(places)])
    for i, place in enumerate(places):
        if place.kind == "door":
            widths[i] = min(widths[i], *(p.width for p in topo_map.passages_at(place.name)))
    waypoints = [
        Waypoint(
            place.x,
            place.y,
            tolerance,
            place.name,
            place.kind,
            final=False,
            width=width,
            passage=_ends(leg),
        )
        for place, tolerance, width, leg in zip(
            places, passing.tolerances(kinds, widths), widths, route.legs, strict=False
        )
    ]
    last = route.legs[-1]
    if places and kinds[-1] != "door" and places[-1].distance(goal.x, goal.y) <= goal.tolerance:
        del waypoints[-1]
        last = route.legs[-2]
    if waypoints and places[0].distance(*route.start.point) <= AT_PLACE:
        del waypoints[0]
    width, passage = route.widths[-1], _ends(last)
    final = replace(goal, kind="goal", final=True, width=width, passage=passage)
    return [*waypoints, final]


def _ends(passage: Passage | None) -> tuple[str, str] | None:
    return None if passage is None else (passage.a, passage.b)


def has_passed(
    at: Point,
    came_from: Point,
    waypoint: Waypoint,
    after: Waypoint | None,
    passing: PassingTolerances,
) -> bool:
    """Return whether a robot ``at`` (x, y) [m], on its leg from ``came_from``, passed ``waypoint``.

    It has if it is within the tolerance, or has crossed the line through the waypoint that bisects
    the turn from this leg to the next (towards ``after``), at most ``passing.reach`` from it (a
    door: within the gap). A final waypoint must be reached.
    """
    dx, dy = at[0] - waypoint.x, at[1] - waypoint.y
    if math.hypot(dx, dy) <= waypoint.tolerance:
        return True
    if waypoint.final or after is None or math.hypot(dx, dy) > passing.reach:
        return False
    forward = _bisector(came_from, (waypoint.x, waypoint.y), (after.x, after.y))
    if forward is None or dx * forward[0] + dy * forward[1] < 0.0:
        return False
    aside = abs(dx * forward[1] - dy * forward[0])
    return waypoint.kind != "door" or aside <= 0.5 * waypoint.width


def distance_to_leg(at: Point, start: Point, end: Point) -> float:
    """Return the distance [m] from ``at`` to the straight leg from ``start`` to ``end``."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    squared = dx * dx + dy * dy
    share = 0.0
    if squared > 0.0:
        share = ((at[0] - start[0]) * dx + (at[1] - start[1]) * dy) / squared
        share = min(max(share, 0.0), 1.0)
    return math.hypot(at[0] - start[0] - share * dx, at[1] - start[1] - share * dy)


def _bisector(before: Point, corner: Point, after: Point) -> Point | None:
    """Return the unit direction halfway between the legs to and from ``corner``.

    None for turns beyond ``_MAX_TURN``.
    """
    leg_in = _unit(corner[0] - before[0], corner[1] - before[1])
    leg_out = _unit(after[0] - corner[0], after[1] - corner[1])
    if leg_in is None or leg_out is None:
        return leg_in or leg_out
    x, y = leg_in[0] + leg_out[0], leg_in[1] + leg_out[1]
    if math.hypot(x, y) < 2.0 * math.cos(0.5 * _MAX_TURN):
        return None
    return _unit(x, y)


def _unit(x: float, y: float) -> Point | None:
    length = math.hypot(x, y)
    return None if length < 1e-9 else (x / length, y / length)


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
        narrow = free <= _FULL_TOLERANCE_CLEARANCE or waypoint.place in self.doors
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
