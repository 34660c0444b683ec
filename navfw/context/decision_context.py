"""The context of a decision: the commands to choose from, and all that a behaviour may know.

The command grid is the finite set of (v, w) that behaviours rate and fusion chooses from.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.numerics import Array
from navfw.numerics.products import sum_in_order
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, Conflicts, FlowField, Percept, Pose, Twist, Waypoint
from navfw.signals.immutability import Sealed, read_only

if TYPE_CHECKING:
    from navfw.localmap import Arcs, LocalGoal, Ranges

TURN_RATE = 1.2  # chosen
"""Top turning rate used [rad/s]."""

_SPEED_STEP = 0.0625  # chosen
"""Largest step [m/s] between forward speeds: from standstill the robot begins with one step."""

_MIN_FORWARD, _MAX_FORWARD = 9, 40  # chosen
"""Bounds of the number of forward speeds that follows from the top speed."""


class CommandGridParams(StrictModel):
    """Resolution and limits of the command grid (METHOD 3.6)."""

    forward: int | None = Field(
        None,
        ge=4,
        le=40,
        description="forward speeds, standstill included; none: as many as the top speed needs",
    )
    reverse: int = Field(2, ge=0, le=10, description="backward speeds")
    turns: int = Field(21, ge=5, le=81, description="turning rates; odd, zero in the middle")
    cruise: float = Field(
        0.5, gt=0.0, le=2.0, description="top speed used, below the robot's own limit [m/s]"
    )


class CommandGrid(Sealed):
    """The commands to choose from: all pairs of ``v`` (n_v,) [m/s] and ``w`` (n_w,) [rad/s].

    Both ascend. ``relative_v`` and ``relative_w`` are in units of the top speed and turning rate:
    the units of ``speed`` and ``turn`` in behaviours' rule bases. ``backward_rows`` and
    ``forward_rows`` are the slices of ``v`` with that sign; the one speed between them is zero.
    The top speed is the least of ``params.cruise``, that of the robot, and ``seeing_speed`` [m/s],
    up to which the camera shows depth.
    """

    def __init__(
        self,
        robot: RobotModel,
        params: CommandGridParams | None = None,
        seeing_speed: float = math.inf,
    ) -> None:
        params = params or CommandGridParams()
        self.max_v = min(params.cruise, robot.max_v, seeing_speed)
        self.max_w = min(TURN_RATE, robot.max_w)
        turns = params.turns | 1  # an odd count contains zero
        backward = np.linspace(-robot.max_reverse, 0.0, params.reverse + 1)[:-1]
        forward = np.linspace(0.0, self.max_v, params.forward or _forward_speeds(self.max_v))
        self.v: Array = read_only(np.concatenate([backward, forward]))
        self.w: Array = read_only(np.linspace(-self.max_w, self.max_w, turns))
        self.relative_v: Array = read_only(self.v / self.max_v)
        self.relative_w: Array = read_only(self.w / self.max_w)
        self.shape = (self.v.size, self.w.size)
        self.backward_rows = slice(0, backward.size)
        self.forward_rows = slice(backward.size + 1, self.v.size)
        self._seal()

    def zeros(self) -> Array:
        """Return a layer (n_v, n_w) of zeros: nothing desired, nothing prohibited."""
        return np.zeros(self.shape)

    def product(self, speed: Array, turn: Array) -> Array:
        """Multiply fuzzy sets over speeds (n_v,) and turns (n_w,) to a desirability (n_v, n_w)."""
        return speed[:, None] * turn

    def around(self, speed: float, turn: float) -> Array:
        """Return desirability (n_v, n_w): near 1 at one command, less at its neighbours, else 0.

        ``speed`` and ``turn`` are in units of the top speed and top turning rate.
        """
        return self.product(peak(speed, self.relative_v), peak(turn, self.relative_w))

    def turning(self, turn: float, width: float = 0.3) -> Array:
        """Return a fuzzy set over turns (n_w,): a triangle about ``turn`` of half width ``width``.

        Both are in units of the top turning rate.
        """
        return triangle(turn, self.relative_w, width)

    def on_the_spot(self, turn: float, width: float = 0.3) -> Array:
        """Return the desirability (n_v, n_w) of turns on the spot; parameters as of ``turning``."""
        return self.product(1.0 * (self.v == 0.0), self.turning(turn, width))

    def forward(self) -> Array:
        """Return a layer (n_v, n_w) that is 1 for forward commands, else 0: to prohibit them."""
        layer = self.zeros()
        layer[self.forward_rows] = 1.0
        return layer

    def nearest(self, twist: Twist) -> tuple[int, int]:
        """Return the indices (into ``v``, into ``w``) of the grid command nearest to ``twist``."""
        return (
            int(np.abs(self.v - twist.v).argmin()),
            int(np.abs(self.w - twist.w).argmin()),
        )


def _forward_speeds(max_v: float) -> int:
    """Return the number of forward speeds up to ``max_v`` [m/s], standstill included."""
    return min(max(math.ceil(max_v / _SPEED_STEP) + 1, _MIN_FORWARD), _MAX_FORWARD)


def peak(value: float, values: Array, steps: float = 1.5) -> Array:
    """Evaluate a triangle about ``value`` at ``values`` (n,) ascending; half width ``steps`` steps.

    With ``steps`` above 0.5 at least one result is above 0 for a ``value`` in their range.
    """
    return triangle(value, values, steps * float(np.diff(values).max()))


def triangle(value: float, values: Array, width: float) -> Array:
    """Evaluate a triangle at ``values`` (n,): 1 at ``value``, 0 from ``width`` off it on."""
    return np.maximum(0.0, 1.0 - np.abs(values - value) / width)


_LEFT, _RIGHT = ("P2", "P3"), ("P1", "P4")
# the inner parts of each quadrant (see navfw.offis)
_INNER = ("sP12", "sP13", "sP21", "sP24", "sP31", "sP34", "sP42", "sP43")
_UNKNOWN = 0.5  # chosen


@dataclass(frozen=True, slots=True)
class QuadrantDistances:
    """Fuzzy distances in [0, 1]: 0 is near, 0.5 middle, 1 far (paper sec 4.5).

    ``left`` and ``right`` are of the nearest object in that half of the image; ``ahead`` is of the
    nearest object if in the inner part of the image, else 1. An unknown distance is 0.5: neither
    near nor free. ``floor`` is the degree of "Floor in front", ``age`` [s] that of the percept.
    """

    left: float
    right: float
    ahead: float
    floor: float
    age: float


def quadrant_distances(percept: Percept, time: float) -> QuadrantDistances:
    """Compute the distances of ``percept`` at ``time`` [s] from what the paper's OFFIS reports."""
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
    """Return the mean of near (0), middle (0.5) and far (1), weighted by their degrees."""
    total = sum_in_order(degrees.values())
    if total <= 0.0:
        return _UNKNOWN
    return (0.5 * degrees["middle"] + degrees["far"]) / total


@dataclass(frozen=True, slots=True)
class Context:
    """What behaviours and fusion may know when a command is decided; read only.

    ``percept`` is OFFIS' newest with any depth (None before the robot has moved); it may be older
    than ``time``, as a turn on the spot shows no depth. ``flow`` is the derotated flow field it was
    made from. ``arcs`` and ``ranges`` are free distances by the local map; ``conflicts`` are those
    of all commands with moving obstacles (None without any). ``local_goal`` is the next point on
    the cheapest path through the local map to ``waypoint`` (None without a waypoint). ``pose`` is
    in odom, ``belief`` in the map. ``stalled`` [s] is how long the wheels have not followed
    commands, ``idle`` [s] how long no progress toward the waypoint has been made.
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
        """Fuzzy distances left, right and ahead, by the percept; None before the first percept."""
        return None if self.percept is None else quadrant_distances(self.percept, self.time)

    @property
    def waypoint_local(self) -> tuple[float, float]:
        """Position (x, y) [m] of the waypoint in base_link; (0, 0) if there is none."""
        if self.waypoint is None:
            return 0.0, 0.0
        return self.belief.pose.to_local(self.waypoint.x, self.waypoint.y)

    @property
    def waypoint_distance(self) -> float:
        """Straight distance [m] from base_link to the waypoint; infinite if there is none."""
        return math.inf if self.waypoint is None else math.hypot(*self.waypoint_local)

    @property
    def waypoint_bearing(self) -> float:
        """Bearing [rad, left positive] of the waypoint from ahead; 0 if there is none."""
        x, y = self.waypoint_local
        return math.atan2(y, x)

    def turn_to(self, yaw: float) -> float:
        """Return the turn [rad, left positive] in [-pi, pi) from the heading to odom ``yaw``."""
        return (yaw - self.pose.yaw + math.pi) % (2.0 * math.pi) - math.pi

    @property
    def door_distance(self) -> float:
        """Distance [m] to the waypoint if it is a door, else infinite."""
        at_door = self.waypoint is not None and self.waypoint.kind == "door"
        return self.waypoint_distance if at_door else math.inf

    @property
    def barred(self) -> bool:
        """Whether occupied cells of the local map bar every path to the waypoint."""
        return self.local_goal is not None and not self.local_goal.reachable
