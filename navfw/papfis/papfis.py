"""PAPFIS, the path planning FIS (paper sec 2): waypoints through the topological map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field

from navfw.interfaces import Planner
from navfw.papfis.blockages import Blockages
from navfw.papfis.edge_costs import CostParams
from navfw.papfis.route_plan import Plan
from navfw.papfis.routes import Router
from navfw.papfis.tour import Tour
from navfw.papfis.waypoints import Passing
from navfw.signals import Belief, PassageQuery, PassageReport, Waypoint
from navfw.topomap import Passage, TopoMap

__all__ = ["Papfis"]

Metres = Annotated[float, Field(gt=0.0, le=10.0)]


class Papfis(Planner):
    """Plans by fuzzy edge costs, hands out one waypoint after the other, plans anew when astray.

    From the belief's position the route enters the map where that is cheapest, at the ends of the
    passages beside the robot, so places already passed do not appear in it. Passages that are seen
    to be barred are closed for a while, those with a drop in the floor avoided; the way changes
    accordingly.
    """

    name: ClassVar[str] = "papfis"

    class Params(Planner.Params):
        """What the costs weigh, and when waypoints are passed."""

        aversion: Annotated[
            float,
            Field(ge=0.0, le=100.0, description="the worst passage counts 1 + this times longer"),
        ] = 4.0
        avoidance: Annotated[
            float,
            Field(ge=0.0, le=1e6, description="high danger counts so many times the length more"),
        ] = 1000.0
        passing: Annotated[Metres, Field(description="tolerance at places in the open [m]")] = 0.6
        door_passing: Annotated[Metres, Field(description="tolerance in doors [m]")] = 0.25
        beside_door_passing: Annotated[
            Metres, Field(description="tolerance just before and after doors [m]")
        ] = 0.35
        passing_reach: Annotated[
            Metres, Field(description="a waypoint left behind counts as passed so near [m]")
        ] = 1.0
        stray: Annotated[
            Metres, Field(description="plans anew when farther than this off its leg [m]")
        ] = 1.5
        max_off_map: Annotated[
            float,
            Field(gt=0.0, le=1000.0, description="start and goals may be so far off the map [m]"),
        ] = 8.0

        closing: Annotated[
            float, Field(ge=1.0, le=100.0, description="looks, net, that close a barred passage")
        ] = 3.0
        look_interval: Annotated[
            float, Field(ge=0.0, le=60.0, description="looks nearer in time count as one [s]")
        ] = 1.0
        closed_for: Annotated[
            float, Field(gt=0.0, le=86400.0, description="a closed passage is tried after this [s]")
        ] = 60.0

    params: Params

    _blockages: Blockages | None = None
    _outlook: PassageReport | None = None
    _at: tuple[float, float] | None = None
    _router: Router | None = None
    _tour: Tour | None = None

    def reset(self) -> None:
        """Forget map, goals and plan."""
        self._router = None
        self._tour = None
        self._blockages = None
        self._outlook = None
        self._at = None

    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Begin a mission; a goal's ``place`` names a place of the map, or is only a label.

        Raises:
            MapError: two goals are not connected, or a goal is far from everything in the map.

        """
        p = self.params
        self._router = Router(topo_map, self.robot, CostParams(p.aversion, p.avoidance))
        passing = Passing(p.passing, p.door_passing, p.beside_door_passing, p.passing_reach)
        self._tour = Tour(self._router, goals, passing, p.stray, p.max_off_map)
        self._blockages = Blockages(self._router, p.closing, p.look_interval, p.closed_for)

    def update(self, belief: Belief) -> Waypoint | None:
        """The waypoint to head for; None when the last goal is reached.

        Raises:
            MapError: at the first call: the map does not connect this position with the goal.

        """
        if self._tour is None or self._blockages is None:
            raise RuntimeError("start() comes before update()")
        self._at = (belief.pose.x, belief.pose.y)
        changed = self._blockages.expire(belief.time)
        if self._outlook is not None:
            changed |= self._blockages.hear(self._outlook, belief.time)
            self._outlook = None
        self._tour.reconsider(self._at, changed)
        return self._tour.head(self._at)

    def observe(self, outlook: PassageReport) -> None:
        """Note what has been seen of the way ahead; the next ``update`` draws the conclusions."""
        self._outlook = outlook

    @property
    def queries(self) -> Sequence[PassageQuery]:
        """The legs ahead that begin within a few metres of the robot."""
        if self._tour is None or self._at is None:
            return ()
        return self._tour.queries(self._at)

    @property
    def shut(self) -> str | None:
        """Which closed passages bar the only way to the goal; None while there is a way."""
        return None if self._tour is None else self._tour.shut

    @property
    def closed(self) -> Sequence[Passage]:
        """The passages that are closed for now."""
        return () if self._blockages is None else self._blockages.closed

    @property
    def path(self) -> Sequence[Waypoint]:
        """All waypoints still ahead, nearest first, through to the last goal."""
        return () if self._tour is None else self._tour.path

    @property
    def replans(self) -> int:
        """How often a new plan was made: the robot had strayed, or the way had changed."""
        return 0 if self._tour is None else self._tour.replans

    def explain(self) -> dict[str, Any]:
        """The plan to the present goal as plain data: each passage with its cost, rule by rule."""
        if self._router is None or self._tour is None or self._tour.route is None:
            return {}
        return Plan(self._tour.route, self._router).explain()
