"""Encode readings, commands and poses as ROS 2 messages in CDR, for recordings and bags.

They are of the types of ROS 2 Jazzy that the library rosbags ships; ``now`` is their stamp [ns].
Frames are those of REP 103 and 105, and ``camera`` (z ahead, x right, y down).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, cast

import numpy as np

from navfw.config.extras import extra_imports
from navfw.numerics import Array, Image
from navfw.recording.channel_list import (
    DECISION_NAME,
    DECISION_SCHEMA,
    SCHEMA,
    SCHEMA_NAME,
    ImageFlags,
)
from navfw.robot import CameraModel, RobotModel
from navfw.robot.camera_models import LensCalibration
from navfw.signals import Belief, Odometry, Pose, SensorReading, Twist

with extra_imports("bags"):
    from rosbags.interfaces import Nodetype
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.store import Typestore

_WHEELS = ("left_wheel_joint", "right_wheel_joint")
"""Names of the wheels' joints if the robot has no URDF."""
_Link = tuple[str, str, Mapping[str, float], Mapping[str, float]]
"""Parent, child, translation [m] and rotation of a transform."""
_ABSENT = np.array([-1.0, *[0.0] * 8])
"""Covariance of the quantities that an ``Imu`` does not measure."""


@cache
def message_types(*, ros1: bool = False) -> Typestore:
    """Return the message types of ROS 2 Jazzy and navfw's own, or those of ROS 1 Noetic."""
    if ros1:
        store = get_typestore(Stores.ROS1_NOETIC)
        for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):  # which rosbags leaves out
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
        return store
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(SCHEMA, SCHEMA_NAME))
    store.register(get_types_from_msg(DECISION_SCHEMA, DECISION_NAME))
    return store


def ros_message(kind: str, fields: Mapping[str, Any], now: int | None = None) -> bytes:
    """Encode a message of ``kind`` in CDR; fields missing in ``fields`` are zero or empty.

    ``fields`` of parts are nested; ``now`` [ns] is the time of its header.
    """
    if now is not None:
        fields = {**fields, "header": {**fields.get("header", {}), "stamp": time_fields(now)}}
    return bytes(message_types().serialize_cdr(_made(kind, fields), kind))


def _made(kind: str, fields: Mapping[str, Any]) -> Any:
    """Make a message of ``kind`` to serialize; missing ``fields`` are shared between messages."""
    values, kinds = _zeros(kind)
    values = dict(values)
    for name, value in fields.items():
        if isinstance(value, dict):
            values[name] = _made(kinds[name], value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            values[name] = [_made(kinds[name], part) for part in value]
        else:
            values[name] = value
    return message_types().types[kind](**values)


@cache
def _zeros(kind: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the fields of ``kind``, zero or empty, and the kinds of those that hold messages."""
    values: dict[str, Any] = {}
    kinds: dict[str, str] = {}
    for name, (node, of) in message_types().fielddefs[kind][1]:
        if node == Nodetype.NAME:
            kinds[name] = str(of)
            values[name] = _made(kinds[name], {})
        elif node == Nodetype.BASE:
            values[name] = {"string": "", "bool": False}.get(str(of[0]), 0)
        else:
            (inner, what), size = cast("tuple[tuple[int, Any], int]", of)
            plain = inner == Nodetype.BASE and what[0] != "string"
            values[name] = np.zeros(int(size), str(what[0])) if plain else []
            kinds[name] = str(what)
    return values, kinds


def reading_message(reading: SensorReading, twist: Twist) -> bytes:
    """Encode a reading, and the stack's command for it, as ``SCHEMA`` defines."""
    inertial, encoders = reading.inertial, reading.encoders
    frame, landmarks = reading.frame, reading.landmark_frame
    pictures = 0 if landmarks is None else ImageFlags.LANDMARKS
    if frame is not None:
        pictures |= ImageFlags.CAMERA | (ImageFlags.SIDES if frame.sides else 0)
    fields = {
        "time": reading.time,
        "roll_rate": inertial.roll_rate,
        "pitch_rate": inertial.pitch_rate,
        "yaw_rate": inertial.yaw_rate,
        "inertial_time": inertial.time,
        "encoders_time": encoders.time,
        "left": encoders.left,
        "right": encoders.right,
        "frame_time": 0.0 if frame is None else frame.time,
        "landmark_frame_time": 0.0 if landmarks is None else landmarks.time,
        "pictures": pictures,
        "v": twist.v,
        "w": twist.w,
    }
    return ros_message(SCHEMA_NAME, fields)


def imu_message(robot: RobotModel, reading: SensorReading, now: int) -> bytes:
    """Encode the gyro's rates as ``Imu`` in ``base_link``, stamped ``now`` [ns].

    Orientation and acceleration are marked as absent.
    """
    gyro, sigma = reading.inertial, robot.odometry.gyro_noise
    rates = {"x": gyro.roll_rate, "y": gyro.pitch_rate, "z": gyro.yaw_rate}
    absent = {"orientation_covariance": _ABSENT, "linear_acceleration_covariance": _ABSENT}
    spread = {"angular_velocity_covariance": sigma * sigma * np.eye(3).ravel()}
    fields = {"header": {"frame_id": "base_link"}, "angular_velocity": rates, **absent, **spread}
    return ros_message("sensor_msgs/msg/Imu", fields, now)


def wheel_joints(robot: RobotModel) -> tuple[Sequence[str], Sequence[str]]:
    """Return the names of the joints of the left wheels, and of the right wheels."""
    if robot.urdf is None:
        return _WHEELS[:1], _WHEELS[1:]
    return robot.urdf.left, robot.urdf.right


def joints_message(robot: RobotModel, reading: SensorReading, now: int, frame: str = "") -> bytes:
    """Encode the wheels' angles [rad] as ``JointState``, stamped ``now`` [ns].

    Of a URDF it has the first wheel on each side.
    """
    names = [side[0] for side in wheel_joints(robot)]
    ticks = np.array([reading.encoders.left, reading.encoders.right], dtype=np.float64)
    angles = 2.0 * math.pi / robot.ticks_per_turn * ticks
    fields = {"header": {"frame_id": frame}, "name": names, "position": angles}
    return ros_message("sensor_msgs/msg/JointState", fields, now)


def image_message(image: Image, now: int, frame: str = "camera") -> bytes:
    """Encode grey pixels (height, width) uint8 as ``Image``, stamped ``now`` [ns]."""
    height, width = image.shape
    about = {"height": height, "width": width, "step": width, "encoding": "mono8"}
    fields = {"header": {"frame_id": frame}, **about, "data": image.ravel()}
    return ros_message("sensor_msgs/msg/Image", fields, now)


def command_message(twist: Twist, now: int) -> bytes:
    """Encode a command as ``TwistStamped`` in ``base_link``, stamped ``now`` [ns]."""
    fields = {"header": {"frame_id": "base_link"}, "twist": twist_fields(twist)}
    return ros_message("geometry_msgs/msg/TwistStamped", fields, now)


def odometry_message(odometry: Odometry, now: int, covariance: Array | None = None) -> bytes:
    """Encode ``base_link`` in ``odom`` as ``Odometry``, stamped ``now`` [ns].

    ``covariance`` (3, 3) is of x, y, yaw.
    """
    pose = odometry.pose
    at = pose_fields(pose.x, pose.y, pose.yaw)
    placed = {"pose": at, **({} if covariance is None else {"covariance": in_space(covariance)})}
    moved = {"pose": placed, "twist": {"twist": twist_fields(odometry.twist)}}
    fields = {"header": {"frame_id": "odom"}, "child_frame_id": "base_link", **moved}
    return ros_message("nav_msgs/msg/Odometry", fields, now)


def camera_message(camera: CameraModel, size: tuple[int, int], now: int) -> bytes:
    """Encode ``CameraInfo`` of images of ``size`` (height, width), stamped ``now`` [ns].

    The images are as the lens shows them.
    """
    height, width = size
    k = np.diag([camera.focal * width / camera.width] * 2 + [1.0])
    k[:2, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
    p, model, d = np.column_stack([k, np.zeros(3)]), "plumb_bob", np.zeros(5)
    if isinstance(lens := camera.calibration, LensCalibration):
        scale = 1.0 if lens.size is None else width / lens.size[0]
        model, d = lens.model, np.array(lens.coefficients)
        k = np.reshape(lens.matrix, (3, 3)) * [[scale], [scale], [1.0]]
        k[:2, 2] += 0.5 * (scale - 1.0)  # the corner of the image is at -0.5
    matrices = {"k": k.ravel(), "r": np.eye(3).ravel(), "p": p.ravel(), "d": d}
    about = {"height": height, "width": width, "distortion_model": model}
    fields = {"header": {"frame_id": "camera"}, **about, **matrices}
    return ros_message("sensor_msgs/msg/CameraInfo", fields, now)


def transforms_message(
    odometry: Pose, now: int, belief: Belief | None = None, camera: CameraModel | None = None
) -> bytes:
    """Encode the transforms between frames as ``TFMessage``, stamped ``now`` [ns].

    With ``belief`` it has ``odom`` in ``map``; with ``camera`` it has ``base_link`` in ``odom``,
    and the camera in ``base_link``. With neither it is empty.
    """
    links: list[_Link] = [] if camera is None else _to_camera(odometry, camera)
    if belief is not None:
        # the pose of odom in map: base_link in map, and from there back to odom
        odom = belief.pose.compose(odometry.relative(Pose(0.0, 0.0, 0.0)))
        links.insert(0, ("map", "odom", {"x": odom.x, "y": odom.y}, _about_z(odom.yaw)))
    made = [
        {
            "header": {"frame_id": parent, "stamp": time_fields(now)},
            "child_frame_id": child,
            "transform": {"translation": place, "rotation": turn},
        }
        for parent, child, place, turn in links
    ]
    return ros_message("tf2_msgs/msg/TFMessage", {"transforms": made})


def _to_camera(odometry: Pose, camera: CameraModel) -> list[_Link]:
    # of a level camera (-1/2, 1/2, -1/2, 1/2), then turned about base_link's y axis
    c, s = 0.5 * math.cos(0.5 * camera.pitch), 0.5 * math.sin(0.5 * camera.pitch)
    optical = {"x": -c - s, "y": c + s, "z": s - c, "w": c - s}
    mount = {"x": camera.mount_forward, "z": camera.mount_height}
    return [
        ("odom", "base_link", {"x": odometry.x, "y": odometry.y}, _about_z(odometry.yaw)),
        ("base_link", "camera", mount, optical),
    ]


def time_fields(now: int) -> Mapping[str, int]:
    """Return the fields of a ``Time`` from ``now`` [ns]."""
    return dict(zip(("sec", "nanosec"), divmod(now, 10**9), strict=True))


def pose_fields(x: float, y: float, yaw: float) -> Mapping[str, Any]:
    """Return the fields of a ``Pose`` in the plane z = 0 from x, y [m] and yaw [rad]."""
    return {"position": {"x": x, "y": y}, "orientation": _about_z(yaw)}


def in_space(covariance: Array) -> Array:
    """Expand a covariance (3, 3) of x, y, yaw to (36,) of x, y, z, roll, pitch, yaw, with zeros."""
    wide = np.zeros((6, 6))
    wide[np.ix_([0, 1, 5], [0, 1, 5])] = covariance
    return wide.ravel()


def twist_fields(twist: Twist) -> Mapping[str, Any]:
    """Return the fields of a ``Twist``."""
    return {"linear": {"x": twist.v}, "angular": {"z": twist.w}}


def _about_z(yaw: float) -> Mapping[str, float]:
    return {"z": math.sin(0.5 * yaw), "w": math.cos(0.5 * yaw)}
