"""The planner ``papfis`` (paper sec 2: path planning FIS): waypoints through the map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field

from navfw.interfaces import Planner
from navfw.papfis.blockages import Blockages
from navfw.papfis.edge_costs import CostParams
from navfw.papfis.route_plan import RoutePlan
from navfw.papfis.routes import Router
from navfw.papfis.tour import Tour
from navfw.papfis.way_search import FoundWay, Standstill, WaySearch, found_way
from navfw.papfis.waypoints import PassingTolerances
from navfw.signals import Belief, GrownGrid, PassageQuery, PassageReport, Waypoint
from navfw.topomap import Passage, TopoMap

DOOR_PASSING = 0.25  # chosen
"""Tolerance in doors [m]."""
PASSING_REACH = 1.0  # chosen
"""A waypoint left behind within this counts as passed [m]."""
_STANDING = 25.0  # chosen
"""Time [s] for which a robot stands before it closes the passage that it is on."""

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

        aversion: float = Field(
            4.0, ge=0.0, le=100.0, description="worst passage: 1 + this times its length"
        )
        avoidance: float = Field(
            1000.0, ge=0.0, le=1e6, description="cost of high danger, in lengths of the passage"
        )
        passing: Metres = Field(0.6, description="tolerance at places in the open [m]")
        beside_door_passing: Metres = Field(
            0.35, description="tolerance just before and after roomy doors [m]"
        )
        replan_distance: Metres = Field(
            1.5, description="distance to the planned leg from which it replans [m]"
        )
        max_off_map: float = Field(
            8.0, ge=0.1, le=1000.0, description="largest distance of start or goal to the map [m]"
        )

        max_goal_sigma: float | None = Field(
            None,
            gt=0.0,
            le=100.0,
            description="standard deviation of the position up to which a goal counts as "
            "reached [m]; none: any",
        )
        vote_interval: float = Field(
            1.0, ge=0.0, le=60.0, description="least time between two votes on a passage [s]"
        )
        closed_for: float = Field(
            60.0, gt=0.0, le=86400.0, description="time until a closed passage is open again [s]"
        )

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
        self._found: list[FoundWay] = []

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
        if goal is not before:
            self._search.spent = 0.0
            if self._search.waypoint is not None:
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
        if (way := found_way(router, track, self.robot.radius)) is not None:
            router.extend(way.places, way.passages)
            self._found.append(way)

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
        ways = [f"found a {way} that the map has not" for way in self._found]
        return "; ".join([*self._tour.doors.notes.values(), *ways])

    @property
    def found(self) -> Sequence[tuple[str, Sequence[tuple[float, float]]]]:
        """Names and tracks (x, y) [m] of the ways that were found so far, in their order."""
        return () if self._tour is None else [(str(way), way.track) for way in self._found]

    @property
    def topo_map(self) -> TopoMap | None:
        """The map with the ways that were found; None before ``start``."""
        return None if self._tour is None else self._tour.router.topo_map

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

    def explain_choice(self) -> dict[str, Any]:
        """Explain a search for another way; empty while the route says where the robot heads."""
        ahead = self._on_search
        if self._tour is None or self._search is None or self._tour.goal is None or ahead is None:
            return {}
        places = self._tour.router.topo_map.places
        closed = [
            {"x": places[passage.b].x, "y": places[passage.b].y, "why": f"{passage} is closed"}
            for passage in self.closed
        ]
        what = f"another way to {self._tour.goal.label}, which costs {self._search.cost:.1f} m"
        return {"heads_for": what, "x": ahead.x, "y": ahead.y, "given_up": closed}

    def explain(self) -> dict[str, Any]:
        """Explain the route to the present goal as plain data: costs of passages, rule by rule."""
        if self._tour is None or self._tour.route is None:
            return {}
        return RoutePlan(self._tour.route, self._tour.router).explain()
