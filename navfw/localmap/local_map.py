"""The local map as one object: updated by the stack, queried by MOFIS, safety and planning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from navfw.localmap.drop_map import DropMap
from navfw.localmap.free_distance import (
    Arcs,
    FreeDistance,
    Ranges,
    arcs_of,
    free_distance,
    free_turn,
    ranges_around,
)
from navfw.localmap.local_planner import LocalGoal, LocalPlanner, LocalPlannerParams
from navfw.localmap.occupancy_grid import OccupancyGrid, OccupancyParams
from navfw.localmap.path_sight import PathSight
from navfw.localmap.traversability import TraversabilityCheck, TraversabilityParams
from navfw.robot import RobotModel
from navfw.signals import (
    Array,
    Belief,
    OccupiedDisc,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    Stixels,
    Twist,
)


class LocalMapParams(BaseModel):
    """Parameters of the local map's parts."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    occupancy: OccupancyParams = OccupancyParams()
    local_planner: LocalPlannerParams = LocalPlannerParams()
    traversability: TraversabilityParams = TraversabilityParams()
    margin: Annotated[
        float, Field(ge=0.0, le=0.3, description="clearance kept from the body's rim on arcs [m]")
    ] = 0.04
    memory: Annotated[
        bool, Field(description="keep evidence from frame to frame; false: the newest percept only")
    ] = True
    planning: Annotated[
        bool,
        Field(description="local goal on the cheapest way through the grid; false: the waypoint"),
    ] = True


class LocalMap:
    """Occupancy, drops, free distance, local planning and traversability around one robot."""

    def __init__(self, robot: RobotModel, params: LocalMapParams | None = None) -> None:
        self.params = params or LocalMapParams()
        self.occupancy = OccupancyGrid(robot, self.params.occupancy)
        self.drops = DropMap(robot)
        self.sight = PathSight(robot)
        self.local_planner = LocalPlanner(self.params.local_planner)
        self.traversability = TraversabilityCheck(self.params.traversability)

    def reset(self) -> None:
        """Back to an empty map without a position."""
        self.occupancy.reset()
        self.drops.reset()
        self.sight.reset()
        self.traversability.reset()

    def update(
        self,
        odometry: Odometry,
        percepts: Sequence[Percept],
        stixels: Stixels | None,
        seen_from: Pose,
    ) -> None:
        """Follow the robot and integrate what the newest frame shows.

        ``seen_from`` is the odom pose at the time of the frame. Percepts without depth are left
        out.
        """
        if not self.params.memory:
            self.occupancy.reset()
        self.occupancy.update(odometry.pose, odometry.time)
        for percept in percepts:
            self.sight.observe(percept)
            if percept.sees_depth:
                self.occupancy.integrate(percept, seen_from, weak=self.sight.weak)
                self.drops.integrate(percept, seen_from)
        if stixels is not None:
            self.occupancy.integrate_stixels(stixels, seen_from)

    def set_obstacles(self, moving_obstacles: tuple[OccupiedDisc, ...]) -> None:
        """Count missing floor, and ``moving_obstacles``, as occupied until the next call."""
        drops = self.drops.discs() if self.params.memory else ()
        self.occupancy.set_obstacles((*moving_obstacles, *drops))

    # --- queries ---------------------------------------------------------------------------------

    def free_distance(self, pose: Pose, twist: Twist) -> FreeDistance:
        """Free distance [m] of ``twist`` from odom ``pose``; 0 while nothing is known."""
        return free_distance(self.occupancy, pose, twist)

    def free_turn(self, pose: Pose, w: float) -> float:
        """Angle [rad] that the robot may turn on the spot in the sense of ``w``."""
        return free_turn(self.occupancy, pose, w)

    def arcs(self, pose: Pose, speeds: Array, turns: Array) -> Arcs:
        """Free distance along the arc of every command (``speeds`` x ``turns``)."""
        return arcs_of(self.occupancy, pose, speeds, turns, self.params.margin)

    def ranges(self, pose: Pose) -> Ranges:
        """Free distance in all directions around odom ``pose``."""
        return ranges_around(self.occupancy, pose)

    def local_goal(
        self,
        pose: Pose,
        target: tuple[float, float],
        moving_obstacles: tuple[OccupiedDisc, ...] = (),
    ) -> LocalGoal:
        """The local goal on the way to ``target``, x, y [m] in base_link, from odom ``pose``.

        ``moving_obstacles`` bar the way, although arcs and ranges may not count them.
        """
        if not self.params.planning:
            return LocalGoal(*target, math.hypot(*target), reachable=True, detour=1.0)
        x, y = pose.to_parent(*target)
        return self.local_planner.plan(self.occupancy, pose, x, y, moving_obstacles)

    def passage_report(
        self, queries: Sequence[PassageQuery], odometry: Odometry, belief: Belief
    ) -> PassageReport | None:
        """Status of the queried legs, and drops in the map frame; None until the next check is due.

        ``queries`` are the legs of the route, in order, the first from the robot on.
        """
        pose, time = odometry.pose, odometry.time
        if not (self.occupancy.located and self.traversability.due(time)):
            return None
        return PassageReport(
            time=time,
            passages=self.traversability.check(self.occupancy, queries, pose, belief, time),
            drops=tuple(
                belief.pose.to_parent(*pose.to_local(*point)) for point in self.drops.points()
            ),
        )
