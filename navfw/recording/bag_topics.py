"""Choose a bag's topics by their role, and extract the numbers of their messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

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
    "mounts": Role(("tf2_msgs/msg/TFMessage",), "tf_static"),
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
