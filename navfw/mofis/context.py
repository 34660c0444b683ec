"""What a behaviour may know when it makes its proposal."""

from __future__ import annotations

import math
from dataclasses import dataclass

from navfw.localmap.free_distance import Arcs, Ranges
from navfw.localmap.local_planner import LocalGoal
from navfw.mofis.command_grid import CommandGrid
from navfw.mofis.quadrant_distances import QuadrantDistances, quadrant_distances
from navfw.movers.conflict_prediction import Conflicts
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, FlowField, Percept, Pose, Twist, Waypoint

__all__ = ["Context"]


@dataclass(frozen=True, slots=True)
class Context:
    """The present moment, seen from the robot (base_link: x ahead, y left), read only.

    ``percept`` is OFFIS' newest (None before the robot has moved); it may be older than ``time``,
    as a robot that only turns sees no depth. ``flow`` is the derotated flow field it was made
    from. ``arcs`` and ``ranges`` come from the ego map, the memory of the last seconds;
    ``encounters`` say where commands would meet movers (None without any). ``aim`` is the next
    point on the cheapest remembered way to ``waypoint`` (None when there is nowhere to go).
    ``pose`` is in odom, ``belief`` in the map. ``stalled`` [s] is how long the wheels have not
    followed commands, ``idle`` [s] how long no progress toward the waypoint has been made.
    """

    time: float
    robot: RobotModel
    commands: CommandGrid
    twist: Twist
    pose: Pose
    belief: Belief
    percept: Percept | None
    arcs: Arcs
    ranges: Ranges
    waypoint: Waypoint | None
    aim: LocalGoal | None
    previous: Command | None
    stalled: float
    idle: float
    flow: FlowField | None = None
    encounters: Conflicts | None = None

    @property
    def sight(self) -> QuadrantDistances | None:
        """The percept's fuzzy distances left, right and ahead; None before the first percept."""
        return None if self.percept is None else quadrant_distances(self.percept, self.time)

    @property
    def waypoint_local(self) -> tuple[float, float]:
        """The waypoint in base_link [m]; (0, 0) when there is none."""
        if self.waypoint is None:
            return 0.0, 0.0
        return self.belief.pose.to_local(self.waypoint.x, self.waypoint.y)

    @property
    def waypoint_distance(self) -> float:
        """Distance [m] to the waypoint; infinite when there is none."""
        return math.inf if self.waypoint is None else math.hypot(*self.waypoint_local)

    @property
    def waypoint_bearing(self) -> float:
        """Bearing [rad, left positive] of the waypoint; 0 when there is none."""
        x, y = self.waypoint_local
        return math.atan2(y, x)

    def turn_to(self, yaw: float) -> float:
        """The turn [rad, left positive] from the present heading to ``yaw`` in odom."""
        return (yaw - self.pose.yaw + math.pi) % (2.0 * math.pi) - math.pi

    @property
    def door_distance(self) -> float:
        """Distance [m] to the door that is the waypoint; infinite when it is none."""
        at_door = self.waypoint is not None and self.waypoint.kind == "door"
        return self.waypoint_distance if at_door else math.inf

    @property
    def barred(self) -> bool:
        """Whether there is somewhere to go, and no remembered way leads there."""
        return self.aim is not None and not self.aim.reachable
