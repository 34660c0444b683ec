"""The planner ``papfis`` (paper sec 2: path planning FIS): waypoints through the map."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field

from navfw.interfaces import Planner
from navfw.papfis.edge_costs import CostParams
from navfw.papfis.route_plan import RoutePlan
from navfw.papfis.routes import Router
from navfw.papfis.tour import Tour
from navfw.papfis.way_search import Standstill, WaySearch, found_way
from navfw.papfis.waypoints import PassingTolerances
from navfw.signals import Belief, GrownGrid, PassageQuery, PassageReport, PassageStatus, Waypoint
from navfw.topomap import Passage, TopoMap

DOOR_PASSING = 0.25  # chosen
"""Tolerance in doors [m]."""
PASSING_REACH = 1.0  # chosen
"""A waypoint left behind within this counts as passed [m]."""
CLOSING_VOTES = 3.0  # chosen
"""Net votes that close a passage."""

_BARRIER_AHEAD = 0.4  # chosen
"""Assumed distance [m] from the robot to what blocks a passage that is reported closed."""

_BARRIER_RANGE = 2.0  # chosen
"""Distance [m] to a passage's barrier up to which a report on the passage is used."""

_DROP_REACH = 0.3  # chosen
"""A drop endangers a passage up to this distance [m] beyond its edge."""

MAX_WIDTH = 2.0  # chosen
"""Upper bound on a passage's width [m] in deciding whether a drop lies in it."""

_ROUNDING = 1e-6  # chosen
"""Tolerance [s] for report times that are multiples of the interval."""

_STANDING = 25.0  # chosen
"""Time [s] for which a robot stands before it closes the passage that it is on."""

ChangedPassages = set[frozenset[str]]


class Blockages:
    """Closes, reopens and marks passages by what the robot observes of them (METHOD 4.3).

    Each passage report holds the status of passages ahead, and each status is a vote. Successive
    reports come from the same local map and are not independent, so votes on one passage count
    once per interval. A reopened passage has full uncertainty: two more votes close it again.

    CLOSING_VOTES net votes close a passage for ``closed_for`` [s], for twice as long if it was not
    seen to be open since it was closed last; votes on a passage within ``vote_interval`` [s] of the
    last one are not counted.
    """

    def __init__(self, router: Router, vote_interval: float, closed_for: float) -> None:
        self._router = router
        self._interval = vote_interval
        self._closed_for = closed_for
        self._votes: dict[frozenset[str], float] = {}
        self._voted: dict[frozenset[str], float] = {}
        self._until: dict[frozenset[str], float] = {}
        self._closings: Counter[frozenset[str]] = Counter()
        self._dangers: set[frozenset[str]] = set()

    @property
    def closed(self) -> tuple[Passage, ...]:
        """Passages that are closed now, in the order of closing."""
        return tuple(self._router.topo_map.passage(*sorted(ends)) for ends in self._until)

    def expire(self, time: float) -> ChangedPassages:
        """Reopen, as uncertain, passages that were closed long enough by ``time``; return which."""
        over = [ends for ends, until in self._until.items() if time >= until]
        for ends in over:
            self._open(ends, votes=max(CLOSING_VOTES - 2.0, 0.0))
            self._router.revise(self._passage(ends), uncertainty=1.0)
        return set(over)

    def update(self, report: PassageReport, time: float) -> ChangedPassages:
        """Count the votes of a report at ``time`` [s]; return the passages that changed."""
        changed: ChangedPassages = set()
        for query, status in report.passages:
            if self._vote(query, status, time):
                changed.add(frozenset(query.passage))
        for drop in report.drops:
            changed |= self._endanger(drop)
        return changed

    def _vote(self, query: PassageQuery, status: PassageStatus, time: float) -> bool:
        """Count one vote; return whether it closed or opened the passage."""
        ends = frozenset(query.passage)
        since = time - self._voted.get(ends, -math.inf)
        if status == "unknown" or since < self._interval - _ROUNDING:
            return False
        if ends in self._until and not self._covers_barrier(query):
            return False  # for example the leg back from the barrier
        self._voted[ends] = time
        step = 1.0 if status == "closed" else -1.0
        votes = min(max(self._votes.get(ends, 0.0) + step, -CLOSING_VOTES), CLOSING_VOTES)
        self._votes[ends] = votes
        if ends in self._until:
            if votes > 0.0:
                return False
            self._open(ends, votes)
            del self._closings[ends]
            return True
        if votes < CLOSING_VOTES:
            return False
        self._close(ends, self._barrier(self._passage(ends), query), time)
        return True

    def close(self, ends: tuple[str, str], at: tuple[float, float], time: float) -> ChangedPassages:
        """Close a passage in which the robot, ``at`` (x, y) [m], gets no further."""
        passage = self._passage(frozenset(ends))
        if passage.ends in self._until:
            return set()
        self._votes[passage.ends] = CLOSING_VOTES
        self._close(passage.ends, self._along(passage, at), time)
        return {passage.ends}

    def _close(self, ends: frozenset[str], barrier: float, time: float) -> None:
        self._closings[ends] += 1
        self._until[ends] = time + self._closed_for * 2.0 ** (self._closings[ends] - 1)
        self._router.close(self._passage(ends), barrier)

    def _open(self, ends: frozenset[str], votes: float) -> None:
        del self._until[ends]
        self._votes[ends] = votes
        self._router.reopen(self._passage(ends))

    def _barrier(self, passage: Passage, query: PassageQuery) -> float:
        """Guess where the passage is blocked [m from ``a``]: a little ahead of the robot."""
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        barrier = start + _BARRIER_AHEAD if end >= start else start - _BARRIER_AHEAD
        return min(max(barrier, 0.0), passage.length)

    def _covers_barrier(self, query: PassageQuery) -> bool:
        """Return whether the leg leads past the passage's barrier, and that is near."""
        passage = self._passage(frozenset(query.passage))
        barrier = self._router.costs.barrier(passage)
        if barrier is None:
            return True
        start, end = (self._along(passage, point) for point in (query.start, query.end))
        return (
            min(start, end) <= barrier <= max(start, end) and abs(barrier - start) <= _BARRIER_RANGE
        )

    def _along(self, passage: Passage, point: tuple[float, float]) -> float:
        """Project the point onto the passage [m from ``a``, scaled to the passage's length]."""
        a, b = (self._router.topo_map.places[name] for name in (passage.a, passage.b))
        dx, dy = b.x - a.x, b.y - a.y
        square = dx * dx + dy * dy
        if square == 0.0:
            return 0.5 * passage.length
        share = ((point[0] - a.x) * dx + (point[1] - a.y) * dy) / square
        return min(max(share, 0.0), 1.0) * passage.length

    def _endanger(self, drop: tuple[float, float]) -> ChangedPassages:
        """Set the danger of the nearest passage to 1 if the drop (x, y) [m] lies in it."""
        projection = self._router.topo_map.nearest_passage(*drop)
        if projection is None:
            return set()
        passage = projection.passage
        reach = 0.5 * min(passage.width, MAX_WIDTH) + _DROP_REACH
        if projection.aside > reach or passage.ends in self._dangers:
            return set()
        self._dangers.add(passage.ends)
        self._router.revise(passage, danger=1.0)
        return {passage.ends}

    def _passage(self, ends: frozenset[str]) -> Passage:
        return self._router.topo_map.passage(*sorted(ends))


Metres = Annotated[float, Field(gt=0.0, le=10.0)]


class Papfis(Planner):
    """Plans by A* over fuzzy edge costs, sets one waypoint after the other, replans off the path.

    The route enters the map where that is cheapest from the estimated position, at the ends of the
    passages beside the robot, so places already passed do not appear in it. Passages reported
    closed are closed for a while and those with a drop in the floor avoided; the route changes
    accordingly.
    """

    name: ClassVar[str] = "papfis"

    class Params(Planner.Params):
        """Weights of the costs, tolerances of waypoints, and votes on passages."""

        aversion: Annotated[
            float,
            Field(ge=0.0, le=100.0, description="worst passage: 1 + this times its length"),
        ] = 4.0
        avoidance: Annotated[
            float,
            Field(ge=0.0, le=1e6, description="cost of high danger, in lengths of the passage"),
        ] = 1000.0
        passing: Annotated[Metres, Field(description="tolerance at places in the open [m]")] = 0.6
        beside_door_passing: Annotated[
            Metres, Field(description="tolerance just before and after roomy doors [m]")
        ] = 0.35
        replan_distance: Annotated[
            Metres, Field(description="distance to the planned leg from which it replans [m]")
        ] = 1.5
        max_off_map: Annotated[
            float,
            Field(
                ge=0.1,
                le=1000.0,
                description="largest distance of start or goal to the map [m]",
            ),
        ] = 8.0

        max_goal_sigma: Annotated[
            float | None,
            Field(
                gt=0.0,
                le=100.0,
                description="standard deviation of the position up to which a goal counts as "
                "reached [m]; none: any",
            ),
        ] = None
        vote_interval: Annotated[
            float,
            Field(ge=0.0, le=60.0, description="least time between two votes on a passage [s]"),
        ] = 1.0
        closed_for: Annotated[
            float,
            Field(gt=0.0, le=86400.0, description="time until a closed passage is open again [s]"),
        ] = 60.0

    params: Params

    _blockages: Blockages | None = None
    _report: PassageReport | None = None
    _at: tuple[float, float] | None = None
    _tour: Tour | None = None
    _search: WaySearch | None = None
    _grid: GrownGrid | None = None

    def reset(self) -> None:
        """Return to the state before ``start``."""
        self._tour = self._search = self._grid = None
        self._blockages = None
        self._report = None
        self._at = None

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start a mission to ``goals`` in order; a goal's ``place`` is of the map, or a label only.

        Raises:
            MapError: two goals are not connected, or a goal is far from everything in the map.

        """
        p = self.params
        router = Router(topo_map, self.robot, CostParams(p.aversion, p.avoidance))
        passing = PassingTolerances(
            p.passing, DOOR_PASSING, p.beside_door_passing, PASSING_REACH, self.robot.reach
        )
        self._tour = Tour(router, goals, passing, p.replan_distance, p.max_off_map)
        self._blockages = Blockages(router, p.vote_interval, p.closed_for)
        self._search = WaySearch(self.robot, topo_map.floor_plan)
        self._standstill = Standstill(_STANDING)
        self._found: list[str] = []

    def update(self, belief: Belief) -> Waypoint | None:
        """Return the waypoint to drive to from the believed pose; None past the last goal.

        Raises:
            MapError: at the first call, if the map does not connect this position with the goal.

        """
        if self._tour is None or self._blockages is None or self._search is None:
            raise RuntimeError("start() comes before update()")
        self._at = (belief.pose.x, belief.pose.y)
        changed = self._blockages.expire(belief.time)
        if self._report is not None:
            changed |= self._blockages.update(self._report, belief.time)
            self._tour.pass_over(self._report.covered, self._at)
            self._tour.pull(self._report, self._at)
            self._report = None
        ahead = self._tour.passage_ahead
        if self._standstill.update(self._at, belief.time) and ahead and not self._search.waypoint:
            changed |= self._blockages.close(ahead, self._at, belief.time)
        self._tour.replan_if_changed(self._at, changed)
        most = self.params.max_goal_sigma
        sure = most is None or belief.sigma <= most
        before = self._tour.goal
        waypoint = self._tour.next_waypoint(self._at, sure=sure)
        goal = self._tour.goal
        if goal is not before and self._search.waypoint is not None:
            self._end_search(self._search, self._tour.router, self._at)
        if self._grid is None or waypoint is None or goal is None:
            return waypoint
        return self._search_way(self._search, self._tour, goal, belief.time, sure) or waypoint

    def _search_way(
        self, search: WaySearch, tour: Tour, goal: Waypoint, time: float, sure: bool
    ) -> Waypoint | None:
        """Return where to head for on another way to ``goal``; None where the route is better."""
        at, grid = self._at, self._grid
        if at is None or grid is None:
            return None
        cost = math.inf if tour.route is None or tour.no_route_reason else tour.route.cost
        arrived = math.dist(at, (goal.x, goal.y)) <= goal.tolerance and sure
        if cost < math.inf and (arrived or search.cost >= cost or search.waypoint is None):
            self._end_search(search, tour.router, at)
            return None
        search.update(grid, at, goal, time)
        if arrived:
            self._end_search(search, tour.router, at)
            tour.arrive(at)
            return tour.next_waypoint(at, sure=sure)
        return search.waypoint

    def _end_search(self, search: WaySearch, router: Router, at: tuple[float, float]) -> None:
        """End the search; the way driven becomes a passage, if the map has no other one."""
        track = [*search.track, at]
        search.end()
        self._grid = None
        if (new := found_way(router, track, self.robot.radius)) is not None:
            places, passages = new
            router.extend(places, passages)
            ways = (passages[0].a, passages[-1].b)
            self._found.append(f"found a way from {ways[0]} to {ways[1]} that the map has not")

    def observe(self, report: PassageReport) -> None:
        """Keep the report on the ``queries``; the next ``update`` counts its votes."""
        self._report = report

    def observe_grid(self, grid: GrownGrid) -> None:
        """Keep what was observed so far: another way is searched on it."""
        self._grid = grid

    @property
    def wants_grid(self) -> bool:
        """Whether there is no route, or another way is being tried."""
        return self._tour is not None and bool(self._tour.no_route_reason or self._on_search)

    @property
    def _on_search(self) -> Waypoint | None:
        return None if self._search is None else self._search.waypoint

    @property
    def queries(self) -> Sequence[PassageQuery]:
        """Legs ahead, to be checked by the local map: those that begin within 6 m of path."""
        if self._tour is None or self._at is None or self._on_search:
            return ()
        return self._tour.queries(self._at)

    @property
    def no_route_reason(self) -> str | None:
        """A message that names the closed passages on the only route; None if there is a route."""
        return None if self._tour is None or self._on_search else self._tour.no_route_reason

    @property
    def notes(self) -> str:
        """What was found to differ from the map: doors that have moved, and new ways."""
        if self._tour is None:
            return ""
        return "; ".join([*self._tour.doors.notes.values(), *self._found])

    @property
    def closed(self) -> Sequence[Passage]:
        """Passages that are closed now, in the order of closing."""
        return () if self._blockages is None else self._blockages.closed

    @property
    def path(self) -> Sequence[Waypoint]:
        """All waypoints still ahead, next first, up to the last goal."""
        if self._search is not None and self._search.waypoint is not None:
            return self._search.path
        return () if self._tour is None else self._tour.path

    @property
    def replans(self) -> int:
        """Number of replans so far: the robot left its path, or a passage on it changed."""
        return 0 if self._tour is None else self._tour.replans

    def explain(self) -> dict[str, Any]:
        """Explain the route to the present goal as plain data: costs of passages, rule by rule."""
        if self._tour is None or self._tour.route is None:
            return {}
        return RoutePlan(self._tour.route, self._tour.router).explain()
