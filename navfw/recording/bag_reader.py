"""Bags of ROS 1 and 2: what their sensors measured, and their images.

The library rosbags reads files ``.bag``, ``.mcap`` and ``.db3``, and folders of ROS 2. A bag's own
definitions of messages are not used, as rosbags would execute code made of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.image_file import MAX_PIXELS, decode_image
from navfw.config.input_file import is_folder, open_input, shown_path
from navfw.errors import ConfigError, NavfwError, UnknownNameError, did_you_mean
from navfw.numerics import Array, Image
from navfw.recording.ros_messages import message_types

with extra_imports("bags"):
    from rosbags import rosbag1, rosbag2
    from rosbags.serde import SerdeError


_CLOCKS = 1.0
"""Difference of a topic's clock from the bag's [s] from which its stamps are not used."""
_ENCODINGS: Mapping[str, tuple[int, int | None]] = {
    **dict.fromkeys(("mono8", "8UC1"), (1, cv2.COLOR_GRAY2BGR)),
    **dict.fromkeys(("bgr8", "8UC3"), (3, None)),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "bayer_rggb8": (1, cv2.COLOR_BayerRGGB2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerBGGR2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGBRG2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGRBG2BGR),
}
"""Channels of each encoding, and OpenCV's conversion to BGR."""


def ros_image(message: Any, name: str) -> Image:
    """The image (height, width, 3) BGR in an ``Image`` or ``CompressedImage`` called ``name``.

    Raises:
        ConfigError: its encoding is unknown, its size impossible, or its content damaged.

    """
    if hasattr(message, "format"):
        return np.asarray(decode_image(bytes(message.data), name), dtype=np.uint8)
    if message.encoding not in _ENCODINGS:
        hint = did_you_mean(message.encoding, _ENCODINGS)
        raise ConfigError(f"unknown encoding {message.encoding!r:.40}: {hint}", file=name)
    channels, conversion = _ENCODINGS[message.encoding]
    height, width, step = message.height, message.width, message.step
    row, data = channels * width, np.asarray(message.data, dtype=np.uint8)
    fits = 0 < width * height <= MAX_PIXELS
    if not (fits and row <= step and step * height <= data.size):
        what = f"has {data.size} bytes in rows of {step} for {width} x {height} pixels"
        raise ConfigError(f"the image {what} of {message.encoding}", file=name)
    rows = data[: step * height].reshape(height, step)[:, :row]
    image = np.ascontiguousarray(rows.reshape((height, width, channels)[: 2 + (channels > 1)]))
    return np.asarray(image if conversion is None else cv2.cvtColor(image, conversion), np.uint8)


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


_ROLES: Mapping[str, tuple[tuple[str, ...], str, int, Callable[[Any], tuple[float, ...]]]] = {
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
}
"""Of what is read: types of message, the usual end of a topic's name, and the numbers of each."""


_SENSORS = {
    "camera": "a camera: there are no images (sensor_msgs Image or CompressedImage)",
    "gyro": "a gyro: there is no topic of sensor_msgs/Imu",
    "wheels": "wheels: there is no topic of sensor_msgs/JointState or nav_msgs/Odometry",
}
"""What a bag without a sensor lacks."""


class BagImage(NamedTuple):
    """An image message, its ``name``, and when it was stamped and ``received`` [s]."""

    name: str
    time: float
    received: float
    message: Any


class Bag:
    """The bag at ``path``; times [s] count from its begin, by stamps, else by reception.

    Arrays have a row for each message, its time first: ``gyro`` (n, 4) rates about x, y, z [rad/s],
    ``odometry`` (n, 4) x, y [m] and yaw [rad] without jumps, ``joints`` (n, 3) the angles of the
    left and the right wheel [rad], ``commands`` (n, 3) v [m/s], w [rad/s]. ``images`` (n, 2) has
    times and reception of the images of ``topic``, or of that with most; ``info`` is the first
    ``CameraInfo``, None without one. ``notes`` are remarks for people.

    Raises:
        ConfigError: it cannot be read, is too large, or damaged.
        UnknownNameError: ``topic`` has no images.

    """

    def __init__(self, path: Path, topic: str | None = None) -> None:
        self.path, self.file = path, shown_path(path)
        self.notes: list[str] = []
        self.info: Any = None
        if not is_folder(path):
            with open_input(path):
                pass
        with self._opened() as reader:
            self._begin = int(reader.start_time)
            self.duration = max(1e-9 * reader.duration, 0.0)
            counts = [(link.topic, link.msgtype, link.msgcount) for link in reader.connections]
        self._topics = {role: self._topic_of(role, counts, topic) for role in _ROLES}
        rows: dict[str, list[tuple[float, ...]]] = {role: [] for role in _ROLES}
        roles = {name: role for role, name in self._topics.items()}
        for name, received, message in self._messages(*filter(None, roles)):
            if roles[name] == "info" and self.info is None:
                self.info = message
            header, width = getattr(message, "header", None), _ROLES[roles[name]][2]
            numbers = (*_ROLES[roles[name]][3](message), *[math.nan] * width)[:width]
            stamp = received
            if header is not None:  # divided, as a decimal number is read
                stamp = (10**9 * header.stamp.sec + header.stamp.nanosec - self._begin) / 1e9
            rows[roles[name]].append((stamp, received, *numbers))
        tables = {role: self._table(role, rows[role]) for role in _ROLES}
        self._all_images = tables["images"]
        self.images = self._all_images[np.isfinite(self._all_images[:, 0])]
        self.gyro, self.odometry, self.joints, self.commands = (
            np.delete(table[np.isfinite(table[:, 0])], 1, axis=1)
            for table in (tables[role] for role in ("gyro", "odometry", "joints", "commands"))
        )
        self.odometry[:, 3] = np.unwrap(self.odometry[:, 3])
        if self.info is not None and not (self.info.width and self.matrix.any()):
            self.notes.append(f"{self._topics['info']} is empty: it says nothing of the camera")
            self.info = None
        self.notes += [] if len(self.images) else ["there are no images"]

    @property
    def lacking(self) -> dict[str, str]:
        """The sensors that a map needs, and of which there are no messages: what is missing."""
        wheels = len(self.joints) or len(self.odometry)
        counts = {"camera": len(self.images), "gyro": len(self.gyro), "wheels": wheels}
        return {role: _SENSORS[role] for role, count in counts.items() if not count}

    @property
    def matrix(self) -> Array:
        """The camera matrix (9,) of ``info``: ``k`` of ROS 2, ``K`` of ROS 1."""
        return np.asarray(self.info.k if hasattr(self.info, "k") else self.info.K)

    def each_image(self) -> Generator[BagImage]:
        """The images in the order of their times, without those that go back."""
        topic = self._topics["images"]
        messages = self._messages(topic) if topic else iter(())
        for number, (row, sent) in enumerate(zip(self._all_images.tolist(), messages, strict=True)):
            if math.isfinite(row[0]):
                yield BagImage(f"{topic} {number}", row[0], row[1], sent[2])

    def _topic_of(self, role: str, counts: list[tuple[str, str, int]], wanted: str | None) -> str:
        """The topic that is read: of the usual name, or with most messages; "" if there is none."""
        kinds, usual, *_ = _ROLES[role]
        known = [
            (usual in name.split("/"), n, name) for name, kind, n in counts if kind in kinds and n
        ]
        names = [name for *_, name in sorted(known, reverse=True)]
        if role == "images" and wanted is not None:
            if wanted not in names:
                raise UnknownNameError(
                    "topic of images", wanted, names, file=self.file, key="--topic"
                )
            return wanted
        if len(names) > 1:
            self.notes.append(f"{names[0]} is read, not {', '.join(names[1:4])}")
        return names[0] if names else ""

    def _table(self, role: str, rows: list[tuple[float, ...]]) -> Array:
        """Times, reception and numbers; nan as time of messages that are unusable."""
        table = np.array(rows, dtype=np.float64).reshape(-1, 2 + _ROLES[role][2])
        topic = self._topics[role]
        off = float(np.median(table[:, 1] - table[:, 0])) if rows else 0.0
        if abs(off) > _CLOCKS:
            table[:, 0] = table[:, 1]
            what = f"the clock of {topic} is {abs(off):.6g} s {'behind' if off > 0.0 else 'ahead'}"
            self.notes.append(f"{what}: its messages count from their reception")
        latest = np.maximum.accumulate([-math.inf, *table[:, 0]])[:-1]
        needed = table[:, [0, 1, -1]] if role == "gyro" else table  # a gyro may have one axis
        lost = (table[:, 0] <= latest) | ~np.isfinite(needed).all(axis=1)
        table[lost, 0] = math.nan
        if lost.any() and role != "info":
            what = "not finite, or going back"
            self.notes.append(f"{lost.sum()} of {len(lost)} messages of {topic} left out: {what}")
        return table

    def _messages(self, *topics: str) -> Iterator[tuple[str, float, Any]]:
        """Topic, time of reception [s] and content of messages, in that order."""
        is_ros1 = self.path.suffix == ".bag"
        types = message_types(ros1=is_ros1)
        with self._opened() as reader:
            wanted = [link for link in reader.connections if link.topic in topics]
            for link, received, data in reader.messages(wanted) if wanted else ():
                time = (received - self._begin) / 1e9
                if not is_ros1:
                    yield link.topic, time, deserialize_cdr(data, link.msgtype)
                    continue
                if link.digest not in {types.generate_msgdef(link.msgtype)[1], "*"}:
                    raise ValueError(f"{link.msgtype} is not defined as in ROS 1 Noetic")
                yield link.topic, time, types.deserialize_ros1(data, link.msgtype)

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        """The open reader of rosbags."""
        try:
            with (rosbag1 if self.path.suffix == ".bag" else rosbag2).Reader(self.path) as reader:
                yield reader
        except NavfwError:
            raise
        except Exception as error:  # rosbags raises errors of many kinds for damaged content
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            hint = "; of a run's recording make one by navfw export" if "ros2" in reason else ""
            raise ConfigError(f"not a readable bag: {reason}{hint}", file=self.file) from None


def deserialize_cdr(data: bytes, kind: str) -> Any:
    """The message of ``kind`` in ``data``, behind which ROS may leave up to eight bytes."""
    types = message_types()
    for excess in (0, 4):
        with suppress(SerdeError):
            return types.deserialize_cdr(data[: len(data) - excess], kind)
    return types.deserialize_cdr(data[:-8], kind)


def driven_way(odometry: Array) -> Array:
    """(n,) the way [m] driven ahead at each row of ``odometry`` (n, 4), backward negative."""
    steps, yaw = np.diff(odometry[:, 1:3], axis=0), odometry[:, 3]
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return np.concatenate([np.zeros(min(len(yaw), 1)), np.cumsum(ahead)])
