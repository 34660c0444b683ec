"""Choose a bag's topics by their role; the numbers of their messages, and their clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from navfw.numerics import Array

_MAX_LEAN = 0.15
"""Square of the part of a quaternion across the vertical, from which a robot leans by 45 deg."""


def turn_rates(message: Any) -> tuple[float, ...]:
    """Return the rates (3,) [rad/s] of an ``Imu`` in its own frame; nan if it measures none."""
    rates, absent = message.angular_velocity, message.angular_velocity_covariance[0] == -1.0
    return (math.nan,) * 3 if absent else (rates.x, rates.y, rates.z)


def planar_pose(message: Any) -> tuple[float, ...]:
    """Return an ``Odometry``'s x, y [m], yaw [rad] in its plane; nan if it lies on its side."""
    place, q = message.pose.pose.position, message.pose.pose.orientation
    if q.x * q.x + q.y * q.y > _MAX_LEAN:
        return (math.nan,) * 3
    across = 1.0 - 2.0 * (q.y * q.y + q.z * q.z)
    return place.x, place.y, math.atan2(2.0 * (q.w * q.z + q.x * q.y), across)


_TWISTS = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


def _turns(message: Any) -> tuple[float, ...]:
    angles = dict(zip(message.name, message.position, strict=False))
    names = [name for name in angles if "steer" not in name.lower()]
    names.sort(key=lambda name: "wheel" not in name.lower())
    sides = [[angles[n] for n in names if side in n.lower()] for side in ("left", "right")]
    return tuple(side[0] if side else math.nan for side in sides)


def _command(message: Any) -> tuple[float, ...]:
    twist = message.twist if hasattr(message, "twist") else message
    return twist.linear.x, twist.angular.z


class Role(NamedTuple):
    """Types of messages, the usual end of the topic's name, and ``numbers`` (``width``,) of one."""

    kinds: tuple[str, ...]
    usual: str
    numbers: Callable[[Any], tuple[float, ...]] = lambda _: ()
    width: int = 0


ROLES = {
    "images": Role(("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"), ""),
    "gyro": Role(("sensor_msgs/msg/Imu",), "imu", turn_rates, 3),
    "odometry": Role(("nav_msgs/msg/Odometry",), "odom", planar_pose, 3),
    "joints": Role(("sensor_msgs/msg/JointState",), "joint_states", _turns, 2),
    "commands": Role(_TWISTS, "cmd_vel", _command, 2),
    "info": Role(("sensor_msgs/msg/CameraInfo",), "camera_info"),
    "mounts": Role(("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"), "tf_static"),
}
"""The roles of topics that are read of a bag."""

_TRANSPORTS = {"compressed", "compressedDepth", "theora", "ffmpeg", "zstd"}
"""Last parts of names of topics that ``image_transport`` derives from an image's."""


def topics_of(role: str, counts: Iterable[tuple[str, str, int]], images: str = "") -> list[str]:
    """Return the topics of a role, that of the usual name and with most messages first.

    ``counts`` are name, type and number of messages of each topic. Those in the outermost namespace
    of ``images`` come before others: there may be several robots.
    """
    kinds, usual, *_ = ROLES[role]
    robot = images.split("/")[1:2]
    known = [
        (usual not in name.split("/"), name.split("/")[1:2] != robot, -n, name)
        for name, kind, n in counts
        if kind in kinds and n
    ]
    return [name for *_, name in sorted(known)]


def info_topics(images: str) -> tuple[str, str]:
    """Return the usual topic of the ``camera_info`` beside ``images``, and that of AirSim."""
    parts = images.split("/")
    name = "/".join(parts[:-1] if parts[-1] in _TRANSPORTS else parts)
    return f"{name.rpartition('/')[0]}/camera_info", f"{name}/camera_info"


CLOCKS = 1.0
"""Difference of two clocks [s] from which they are not the same."""


class SensorClock:
    """The clock of stamps where it is not the bag's own: that of a simulation may be slower.

    ``rows`` (n, 2) are stamps and reception [s] of a topic. ``behind`` [s] is how far the clock is
    behind the bag's if it is another one and runs, else 0.
    """

    def __init__(self, rows: Array) -> None:
        behind = float(np.median(rows[:, 1] - rows[:, 0])) if len(rows) else 0.0
        runs = len(rows) > 1 and float((np.diff(rows[:, 0]) > 0.0).mean()) > 0.5
        self.behind = behind if abs(behind) > CLOCKS and runs else 0.0
        self._rows = rows

    def times(self, table: Array) -> Array:
        """Times (n,) [s] of messages with stamps and reception ``table`` (n, 2 or more).

        They are by their stamps if these overlap with those of the clock, otherwise by reception.
        """
        stamps, received = self._rows.T
        shift = received[0] - stamps[0]
        overlaps = max(table[0, 0], stamps[0]) < min(table[-1, 0], stamps[-1])
        if overlaps and (table[:, 0] != table[:, 1]).any():
            return np.asarray(table[:, 0] + shift)
        return np.asarray(np.interp(table[:, 1], received, stamps + shift))


def unwrapped(angles: Array) -> Array:
    """Return wheel ``angles`` (n, k) [rad] without the jumps of drivers that wrap them.

    They are kept within one turn, or within two (Isaac Sim).
    """
    spans = np.ptp(angles, axis=0) if len(angles) else np.zeros(angles.shape[1])
    turns = np.maximum(np.ceil(spans / math.tau - 0.01), 1.0).tolist()
    columns = [
        np.unwrap(column, period=count * math.tau) if count <= 2.0 else column
        for column, count in zip(angles.T, turns, strict=True)
    ]
    return np.stack(columns, axis=1)
