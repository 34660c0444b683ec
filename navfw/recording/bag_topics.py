"""Topics of a bag: which one plays which role, and the numbers in its messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any


def turn_rates(message: Any) -> tuple[float, ...]:
    """The rates (3,) [rad/s] of an ``Imu``; nan alone where it has none."""
    rates, absent = message.angular_velocity, message.angular_velocity_covariance[0] == -1.0
    return (math.nan,) if absent else (rates.x, rates.y, rates.z)


def planar_pose(message: Any) -> tuple[float, ...]:
    """The pose x, y [m], yaw [rad] of an ``Odometry`` in its plane."""
    place, q = message.pose.pose.position, message.pose.pose.orientation
    across = 1.0 - 2.0 * (q.y * q.y + q.z * q.z)
    return place.x, place.y, math.atan2(2.0 * (q.w * q.z + q.x * q.y), across)


def _turns(message: Any) -> tuple[float, ...]:
    angles = dict(zip(message.name, message.position, strict=False))
    sides = [[angles[n] for n in angles if side in n.lower()] for side in ("left", "right")]
    return tuple(side[0] if side else math.nan for side in sides)


def _command(message: Any) -> tuple[float, ...]:
    twist = message.twist if hasattr(message, "twist") else message
    return twist.linear.x, twist.angular.z


ROLES: Mapping[str, tuple[tuple[str, ...], str, int, Callable[[Any], tuple[float, ...]]]] = {
    "images": (("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"), "", 0, lambda _: ()),
    "gyro": (("sensor_msgs/msg/Imu",), "imu", 3, turn_rates),
    "odometry": (("nav_msgs/msg/Odometry",), "odom", 3, planar_pose),
    "joints": (("sensor_msgs/msg/JointState",), "joint_states", 2, _turns),
    "commands": (
        ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"),
        "cmd_vel",
        2,
        _command,
    ),
    "info": (("sensor_msgs/msg/CameraInfo",), "camera_info", 0, lambda _: ()),
    "mounts": (("tf2_msgs/msg/TFMessage",), "tf_static", 0, lambda _: ()),
}
"""Of what is read: types of message, the usual end of a topic's name, and the numbers of each."""

_TRANSPORTS = {"compressed", "compressedDepth", "theora", "ffmpeg", "zstd"}
"""Last parts of the names of topics that ``image_transport`` makes of that of an image."""


def topics_of(role: str, counts: Iterable[tuple[str, str, int]]) -> list[str]:
    """The topics of a role, that of the usual name and with most messages first.

    ``counts`` are name, type and number of messages of each topic.
    """
    kinds, usual, *_ = ROLES[role]
    known = [
        (usual not in name.split("/"), -n, name) for name, kind, n in counts if kind in kinds and n
    ]
    return [name for *_, name in sorted(known)]


def info_topics(images: str) -> tuple[str, str]:
    """The usual topic of the ``camera_info`` of ``images``, and that of AirSim's cameras."""
    parts = images.split("/")
    name = "/".join(parts[:-1] if parts[-1] in _TRANSPORTS else parts)
    return f"{name.rpartition('/')[0]}/camera_info", f"{name}/camera_info"
