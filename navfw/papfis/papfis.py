"""The planner ``papfis`` (paper sec 2: path planning FIS): waypoints through the map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field

from navfw.interfaces import Planner
from navfw.papfis.blockages import Blockages
from navfw.papfis.edge_costs import CostParams
from navfw.papfis.route_plan import RoutePlan
from navfw.papfis.routes import Router
from navfw.papfis.tour import Tour
from navfw.papfis.waypoints import PassingTolerances
from navfw.signals import Belief, PassageQuery, PassageReport, Waypoint
from navfw.topomap import Passage, TopoMap

Metres = Annotated[float, Field(gt=0.0, le=10.0)]


class Papfis(Planner):
    """A* over fuzzy edge costs; gives one waypoint after the other, and replans off the path.

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
        door_passing: Annotated[Metres, Field(description="tolerance in doors [m]")] = 0.25
        beside_door_passing: Annotated[
            Metres, Field(description="tolerance just before and after roomy doors [m]")
        ] = 0.35
        passing_reach: Annotated[
            Metres, Field(description="a waypoint left behind within this counts as passed [m]")
        ] = 1.0
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
        closing_votes: Annotated[
            float, Field(ge=1.0, le=100.0, description="net votes that close a passage")
        ] = 3.0
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
    _router: Router | None = None
    _tour: Tour | None = None

    def reset(self) -> None:
        """Back to the state before ``start``."""
        self._router = None
        self._tour = None
        self._blockages = None
        self._report = None
        self._at = None

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start a mission; a goal's ``place`` names a place of the map, or is only a label.

        Raises:
            MapError: two goals are not connected, or a goal is far from everything in the map.

        """
        p = self.params
        self._router = Router(topo_map, self.robot, CostParams(p.aversion, p.avoidance))
        passing = PassingTolerances(
            p.passing, p.door_passing, p.beside_door_passing, p.passing_reach, self.robot.reach
        )
        self._tour = Tour(self._router, goals, passing, p.replan_distance, p.max_off_map)
        self._blockages = Blockages(self._router, p.closing_votes, p.vote_interval, p.closed_for)

    def update(self, belief: Belief) -> Waypoint | None:
        """The waypoint to drive to; None when the last goal is reached.

        Raises:
            MapError: at the first call: the map does not connect this position with the goal.

        """
        if self._tour is None or self._blockages is None:
            raise RuntimeError("start() comes before update()")
        self._at = (belief.pose.x, belief.pose.y)
        changed = self._blockages.expire(belief.time)
        if self._report is not None:
            changed |= self._blockages.update(self._report, belief.time)
            self._report = None
        self._tour.replan_if_changed(self._at, changed)
        most = self.params.max_goal_sigma
        return self._tour.next_waypoint(self._at, sure=most is None or belief.sigma <= most)

    def observe(self, report: PassageReport) -> None:
        """Keep the report on the ``queries``; the next ``update`` counts its votes."""
        self._report = report

    @property
    def queries(self) -> Sequence[PassageQuery]:
        """The legs ahead that begin within a few metres of the robot."""
        if self._tour is None or self._at is None:
            return ()
        return self._tour.queries(self._at)

    @property
    def no_route_reason(self) -> str | None:
        """Message naming the closed passages on the only route; None while there is a route."""
        return None if self._tour is None else self._tour.no_route_reason

    @property
    def closed(self) -> Sequence[Passage]:
        """The passages that are closed now."""
        return () if self._blockages is None else self._blockages.closed

    @property
    def path(self) -> Sequence[Waypoint]:
        """All waypoints still ahead, nearest first, through to the last goal."""
        return () if self._tour is None else self._tour.path

    @property
    def replans(self) -> int:
        """Number of replans: the robot left its path, or a passage on it changed."""
        return 0 if self._tour is None else self._tour.replans

    def explain(self) -> dict[str, Any]:
        """The route to the present goal as plain data: each passage with its cost, rule by rule."""
        if self._router is None or self._tour is None or self._tour.route is None:
            return {}
        return RoutePlan(self._tour.route, self._router).explain()
