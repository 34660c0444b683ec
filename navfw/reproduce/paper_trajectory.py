"""The paper's simulated trajectory (Fig. 16): go-to-XY through a room, with marked waypoints.

The figure's coordinates are not in the text, so the path is navfw's own: from a corner of the room
between its round and square objects to the door and through it. At waypoint 3 the next goal is far
to the left, and the robot turns at its highest rate, as in the paper. The other waypoints are where
it goes straight: one on each stretch before the turn, two or three on each after it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from navfw.signals import Pose, Twist, wrap_angle

START = Pose(0.9, 2.3, 0.0)
"""Start pose of the robot in the map of ``paper-room``."""

PLACES = ((3.2, 2.3), (4.6, 1.4), (5.2, 3.0), (7.4, 3.2), (8.1, 2.2))
"""Goals (x, y) [m] of go-to-XY, in order."""

FAST_TURN = 0.9
"""Highest turning rate [rad/s], reached at waypoint 3."""

_SPEED, _REACHED, _GAIN, _STEP = 0.4, 0.12, 4.0, 1.0 / 60.0
_MAX_TIME = 60.0


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """Pose at ``time`` [s], and the twist from there on."""

    time: float
    pose: Pose
    twist: Twist


@dataclass(frozen=True, slots=True)
class TrajectoryWaypoint:
    """A marked point: number, time [s] at which the robot passes it, the robot's action."""

    number: int
    time: float
    doing: str


WAYPOINTS = (
    TrajectoryWaypoint(1, 3.0, "goes on between the box and the column"),
    TrajectoryWaypoint(2, 8.0, "heads for the corner"),
    TrajectoryWaypoint(3, 11.3, "turns left, fast"),
    TrajectoryWaypoint(4, 13.2, "goes on along the partition"),
    TrajectoryWaypoint(5, 14.5, "comes up to the door, which is on its right"),
    TrajectoryWaypoint(6, 17.4, "goes through the door"),
    TrajectoryWaypoint(7, 18.7, "leaves the door behind"),
    TrajectoryWaypoint(8, 20.0, "goes to the wall of the next room"),
    TrajectoryWaypoint(9, 23.0, "goes to its corner"),
    TrajectoryWaypoint(10, 23.8, "arrives"),
)
"""The marked points, in order."""


def drive() -> list[TrajectoryPoint]:
    """The trajectory from ``START`` over all of ``PLACES``, in steps of 1/60 s."""
    pose, time, way = START, 0.0, []
    places = list(PLACES)
    while places and time < _MAX_TIME:
        x, y = pose.to_local(*places[0])
        if math.hypot(x, y) < _REACHED:
            places.pop(0)
            continue
        bearing = math.atan2(y, x)
        turn = min(max(_GAIN * bearing, -FAST_TURN), FAST_TURN)
        twist = Twist(_SPEED * max(math.cos(bearing), 0.45), turn)
        way.append(TrajectoryPoint(time, pose, twist))
        pose = pose.compose(_arc(twist, _STEP))
        time += _STEP
    return way


def before(point: TrajectoryPoint, seconds: float) -> Pose:
    """The pose ``seconds`` [s] earlier on the arc of the present twist."""
    return point.pose.compose(_arc(point.twist, -seconds))


def length(way: list[TrajectoryPoint]) -> float:
    """Length [m] of a trajectory."""
    return sum(math.dist((a.pose.x, a.pose.y), (b.pose.x, b.pose.y)) for a, b in pairwise(way))


def _arc(twist: Twist, dt: float) -> Pose:
    turn, way = twist.w * dt, twist.v * dt
    chord = way if abs(turn) < 1e-9 else way * math.sin(0.5 * turn) / (0.5 * turn)
    return Pose(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), wrap_angle(turn))
