"""The context of a decision: everything a behaviour may know."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from navfw.context.command_grid import CommandGrid
from navfw.numerics.products import sum_in_order
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, Conflicts, FlowField, Percept, Pose, Twist, Waypoint

if TYPE_CHECKING:
    from navfw.localmap import Arcs, LocalGoal, Ranges


_LEFT, _RIGHT = ("P2", "P3"), ("P1", "P4")
# the inner parts of each quadrant (see navfw.offis)
_INNER = ("sP12", "sP13", "sP21", "sP24", "sP31", "sP34", "sP42", "sP43")
_UNKNOWN = 0.5


@dataclass(frozen=True, slots=True)
class QuadrantDistances:
    """Fuzzy distances in [0, 1]: 0 is near, 0.5 middle, 1 far (paper sec 4.5).

    ``left`` and ``right`` are of the nearest object in that half of the image; ``ahead`` of the
    nearest object, if it is in the inner part of the image. An unknown distance is 0.5: neither
    near nor free. ``floor`` is the degree of "Floor in front", ``age`` [s] that of the percept.
    """

    left: float
    right: float
    ahead: float
    floor: float
    age: float


def quadrant_distances(percept: Percept, time: float) -> QuadrantDistances:
    """The distances of ``percept`` at ``time`` [s], from the contents of the paper's report."""
    left, right = _side(percept, _LEFT), _side(percept, _RIGHT)
    deeper = [names for layer, names in percept.obstacles.items() if layer != "layer1"]
    # one layer has no inner parts: an object is ahead if it is near on both sides
    ahead = _ahead(percept, deeper) if deeper else max(left, right)
    return QuadrantDistances(left, right, ahead, percept.floor_in_front, time - percept.time)


def _ahead(percept: Percept, layers: Iterable[Mapping[str, str]]) -> float:
    quadrants = {name[1:3] for regions in layers for name in regions if name[:4] in _INNER}
    return min((_distance(percept.quadrants[name]) for name in quadrants), default=1.0)


def _side(percept: Percept, quadrants: tuple[str, ...]) -> float:
    return min(_distance(percept.quadrants[name]) for name in quadrants)


def _distance(degrees: Mapping[str, float]) -> float:
    """The mean of near (0), middle (0.5) and far (1), weighted by their degrees."""
    total = sum_in_order(degrees.values())
    if total <= 0.0:
        return _UNKNOWN
    return (0.5 * degrees["middle"] + degrees["far"]) / total


@dataclass(frozen=True, slots=True)
class Context:
    """The present state as seen from the robot (base_link: x ahead, y left), read only.

    ``percept`` is OFFIS' newest with any depth (None before the robot has moved); it may be older
    than ``time``, as a turn on the spot shows no depth. ``flow`` is the derotated flow field it was
    made from. ``arcs`` and ``ranges`` are free distances by the local map; ``conflicts`` are those
    of all commands with moving obstacles (None without any). ``local_goal`` is the next point on
    the cheapest way through the local map to ``waypoint`` (None without a waypoint). ``pose`` is in
    odom, ``belief`` in the map. ``stalled`` [s] is how long the wheels have not followed commands,
    ``idle`` [s] how long no progress toward the waypoint has been made.
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
    local_goal: LocalGoal | None
    previous: Command | None
    stalled: float
    idle: float
    flow: FlowField | None = None
    conflicts: Conflicts | None = None

    @property
    def quadrant_distances(self) -> QuadrantDistances | None:
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
        """Whether occupied cells of the local map bar every way to the waypoint."""
        return self.local_goal is not None and not self.local_goal.reachable
