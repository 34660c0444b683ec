"""Messages of ROS 2, as CDR, of what a robot measures and is commanded; for recordings and bags.

They are of the types of ROS 2 Jazzy that the library rosbags ships. Frames are those of REP 103 and
105, and ``camera_optical`` (z ahead, x right, y down).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from navfw.config.extras import extra_imports
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Belief, Odometry, Pose, SensorReading, Twist

with extra_imports("bags"):
    from rosbags.typesys import Stores, get_typestore
    from rosbags.typesys.store import Typestore

WHEEL_JOINTS = ("left_wheel_joint", "right_wheel_joint")
"""Names of the joints of wheels that no URDF names."""
LOG_INFO, LOG_WARN = 20, 30
"""Levels of ``rcl_interfaces/msg/Log``."""
_UNKNOWN = -1.0
"""First entry of the covariance of what an ``Imu`` does not measure."""


@cache
def message_types(*, ros1: bool = False) -> Typestore:
    """The message types of ROS 2 Jazzy, or of ROS 1 Noetic."""
    return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)


@cache
def schema_text(kind: str) -> str:
    """The definition of a message of ``kind``, with those of its parts."""
    return message_types().generate_msgdef(kind, ros_version=2)[0]


class RosMessages:
    """Makes messages; each method gives the CDR of one, ``now`` is its time [ns]."""

    def __init__(self) -> None:
        self._new: dict[str, Any] = {
            name.rpartition("/")[2]: kind for name, kind in message_types().types.items()
        }
        self._none, self._zero = np.zeros(36), self._new["Vector3"](0.0, 0.0, 0.0)

    def image(self, data: bytes, kind: str, frame: str, now: int) -> bytes:
        """``CompressedImage`` with the file content ``data`` of ``kind`` (png, jpeg)."""
        content = np.frombuffer(data, dtype=np.uint8)
        return self._packed("sensor_msgs", "CompressedImage", self._at(now, frame), kind, content)

    def imu(self, robot: RobotModel, reading: SensorReading, now: int) -> bytes:
        """``Imu`` of the gyro; it measures neither orientation nor acceleration."""
        inertial, sigma = reading.inertial, robot.odometry.gyro_noise
        rates = inertial.roll_rate, inertial.pitch_rate, inertial.yaw_rate
        absent = np.array([_UNKNOWN, *[0.0] * 8])
        level, turned = self._new["Quaternion"](0.0, 0.0, 0.0, 1.0), self._new["Vector3"](*rates)
        spread = sigma * sigma * np.eye(3).ravel()
        parts = (level, absent, turned, spread, self._zero, absent)
        return self._packed("sensor_msgs", "Imu", self._at(now, "base_link"), *parts)

    def joints(self, robot: RobotModel, reading: SensorReading, now: int) -> bytes:
        """``JointState`` of the wheels [rad]; of a URDF's first wheel on each side."""
        urdf, turn = robot.urdf, 2.0 * math.pi / robot.ticks_per_turn
        names = WHEEL_JOINTS if urdf is None else (urdf.left[0], urdf.right[0])
        angles = turn * np.array([reading.encoders.left, reading.encoders.right], dtype=np.float64)
        parts = (list(names), angles, np.zeros(0), np.zeros(0))
        return self._packed("sensor_msgs", "JointState", self._at(now, "base_link"), *parts)

    def command(self, twist: Twist, now: int) -> bytes:
        """``TwistStamped`` of a command."""
        return self._packed("geometry_msgs", "TwistStamped", self._at(now), self._twist(twist))

    def odometry(self, odometry: Odometry, now: int) -> bytes:
        """``Odometry`` of wheels and gyro, of ``base_link`` in ``odom``."""
        pose = self._new["PoseWithCovariance"](self._pose(odometry.pose), self._none)
        twist = self._new["TwistWithCovariance"](self._twist(odometry.twist), self._none)
        parts = (self._at(now, "odom"), "base_link", pose, twist)
        return self._packed("nav_msgs", "Odometry", *parts)

    def camera_info(self, camera: CameraModel, size: tuple[int, int], now: int) -> bytes:
        """``CameraInfo`` of images of ``size`` (height, width) without distortion."""
        focal = camera.focal * size[1] / camera.width
        x, y = 0.5 * (size[1] - 1), 0.5 * (size[0] - 1)
        k = np.array([focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0])
        p = np.array([focal, 0.0, x, 0.0, 0.0, focal, y, 0.0, 0.0, 0.0, 1.0, 0.0])
        region = self._new["RegionOfInterest"](0, 0, 0, 0, False)
        parts = (*size, "plumb_bob", np.zeros(5), k, np.eye(3).ravel(), p, 0, 0, region)
        return self._packed("sensor_msgs", "CameraInfo", self._at(now, "camera"), *parts)

    def transforms(self, belief: Belief, odometry: Pose, camera: CameraModel, now: int) -> bytes:
        """``TFMessage``: ``map`` to ``odom`` by the belief, to ``base_link``, to the camera."""
        # the pose of odom in map: base_link in map, and from there back to odom
        odom = belief.pose.compose(odometry.relative(Pose(0.0, 0.0, 0.0)))
        # of a level camera (-1/2, 1/2, -1/2, 1/2), then turned about base_link's y axis
        c, s = math.cos(0.5 * camera.pitch), math.sin(0.5 * camera.pitch)
        optical = (0.5 * (-c - s), 0.5 * (c + s), 0.5 * (-c + s), 0.5 * (c - s))
        mount = (camera.mount_forward, 0.0, camera.mount_height)
        links = (
            ("map", "odom", (odom.x, odom.y, 0.0), _about_z(odom.yaw)),
            ("odom", "base_link", (odometry.x, odometry.y, 0.0), _about_z(odometry.yaw)),
            ("base_link", "camera", mount, optical),
        )
        vector, quaternion = self._new["Vector3"], self._new["Quaternion"]
        moved = [self._new["Transform"](vector(*at), quaternion(*turn)) for *_, at, turn in links]
        made = [
            self._new["TransformStamped"](self._at(now, parent), child, transform)
            for (parent, child, *_), transform in zip(links, moved, strict=True)
        ]
        return self._packed("tf2_msgs", "TFMessage", made)

    def log(self, text: str, level: int, now: int) -> bytes:
        """``Log``: what the stack has to say."""
        time = self._new["Time"](*divmod(now, 10**9))
        return self._packed("rcl_interfaces", "Log", time, level, "navfw", text, "", "", 0)

    def _at(self, now: int, frame: str = "base_link") -> Any:
        return self._new["Header"](self._new["Time"](*divmod(now, 10**9)), frame)

    def _twist(self, twist: Twist) -> Any:
        vector = self._new["Vector3"]
        return self._new["Twist"](vector(twist.v, 0.0, 0.0), vector(0.0, 0.0, twist.w))

    def _pose(self, pose: Pose) -> Any:
        turn = self._new["Quaternion"](*_about_z(pose.yaw))
        return self._new["Pose"](self._new["Point"](pose.x, pose.y, 0.0), turn)

    def _packed(self, package: str, kind: str, *parts: Any) -> bytes:
        message = self._new[kind](*parts)
        return bytes(message_types().serialize_cdr(message, f"{package}/msg/{kind}"))


def _about_z(yaw: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)
