"""What a bag's sensors measured: images, gyro, wheels, commands and the camera's calibration.

Times count from the bag's begin, by the messages' stamps; by their reception where the clock of a
topic differs from the bag's, or messages have no stamp.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from navfw.config.image_file import MAX_PIXELS, decode_image
from navfw.errors import ConfigError, did_you_mean
from navfw.numerics import Array, Image
from navfw.recording.bag_reader import Bag, BagMessage
from navfw.robot import RobotModel

_RAW, _PACKED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_IMU, _JOINTS = "sensor_msgs/msg/Imu", "sensor_msgs/msg/JointState"
_ODOMETRY, _INFO = "nav_msgs/msg/Odometry", "sensor_msgs/msg/CameraInfo"
_TWIST, _STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
_USUAL = {"imu", "odom", "joint_states", "cmd_vel", "camera_info"}
"""Last parts of the usual names of topics."""
_ENCODINGS: Mapping[str, tuple[int, int | None]] = {
    "mono8": (1, cv2.COLOR_GRAY2BGR),
    "8UC1": (1, cv2.COLOR_GRAY2BGR),
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "bayer_rggb8": (1, cv2.COLOR_BayerRGGB2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerBGGR2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGBRG2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGRBG2BGR),
}
"""Channels of each encoding, and OpenCV's conversion to BGR."""
_CLOCKS = 1.0
"""Difference of a topic's clock from the bag's [s] from which its stamps are not used."""
_GRAVITY = (7.0, 12.5)
"""Mean acceleration [m/s^2] that is gravity's."""


def ros_image(kind: str, content: Any, name: str) -> Image:
    """The image (height, width, 3) BGR in an ``Image`` or ``CompressedImage`` called ``name``.

    Raises:
        ConfigError: its encoding is unknown, its size impossible, or its content damaged.

    """
    if kind == _PACKED:
        image = decode_image(bytes(content.data), name, cv2.IMREAD_COLOR)
        return np.asarray(image, dtype=np.uint8)
    if content.encoding not in _ENCODINGS:
        hint = did_you_mean(content.encoding, _ENCODINGS)
        raise ConfigError(f"unknown encoding {content.encoding!r:.40}: {hint}", file=name)
    channels, conversion = _ENCODINGS[content.encoding]
    height, width, step = content.height, content.width, content.step
    row, data = channels * width, np.asarray(content.data, dtype=np.uint8)
    if not (0 < width * height <= MAX_PIXELS and row <= step and step * height <= data.size):
        what = f"has {data.size} bytes in rows of {step} for {width} x {height} pixels"
        raise ConfigError(f"the image {what} of {content.encoding}", file=name)
    rows = data[: step * height].reshape(height, step)[:, :row]
    image = np.ascontiguousarray(rows.reshape((height, width, channels)[: 2 + (channels > 1)]))
    return np.asarray(image if conversion is None else cv2.cvtColor(image, conversion), np.uint8)


def _rates(message: Any) -> Sequence[float]:
    rates, way = message.angular_velocity, message.linear_acceleration
    if message.angular_velocity_covariance[0] == -1.0:
        return [math.nan] * 6
    weight = float(message.linear_acceleration_covariance[0] != -1.0)
    return rates.x, rates.y, rates.z, weight * way.x, weight * way.y, weight * way.z


def _pose(message: Any) -> Sequence[float]:
    place, q = message.pose.pose.position, message.pose.pose.orientation
    across = 1.0 - 2.0 * (q.y * q.y + q.z * q.z)
    return place.x, place.y, math.atan2(2.0 * (q.w * q.z + q.x * q.y), across)


def _turns(message: Any) -> Sequence[float]:
    angles = dict(zip(message.name, message.position, strict=False))
    sides = ([angles[n] for n in angles if side in n.lower()] for side in ("left", "right"))
    left, right = sides
    return (left[0], right[0]) if left and right else (math.nan, math.nan)


def _command(message: Any) -> Sequence[float]:
    twist = message.twist if hasattr(message, "twist") else message
    return twist.linear.x, twist.angular.z


_ROWS: Mapping[tuple[str, ...], tuple[int, Callable[[Any], Sequence[float]]]] = {
    (_IMU,): (6, _rates),
    (_ODOMETRY,): (3, _pose),
    (_JOINTS,): (2, _turns),
    (_TWIST, _STAMPED): (2, _command),
}
"""The numbers of each message, by its types."""


@dataclass(frozen=True, slots=True)
class BagImage:
    """One message of an image topic: its name, ``time`` and reception [s], and its content."""

    name: str
    time: float
    received: float
    kind: str
    content: Any

    def image(self) -> Image:
        """The image (height, width, 3) BGR; raises as ``ros_image``."""
        return ros_image(self.kind, self.content, self.name)


class BagContents:
    """The contents of ``bag``; images are those of ``topic``, or of the topic that has most.

    Arrays have a row for each message, the time [s] first: ``gyro`` (n, 4) rates about base_link's
    x, y, z, nan where they are not measured; ``odometry`` (n, 4) x, y [m] and yaw [rad], without
    jumps by whole turns; ``joints`` (n, 3) the wheels' angles [rad]; ``commands`` (n, 3) v [m/s], w
    [rad/s]. ``info`` is the first ``CameraInfo``, None without one, or if it is empty. ``notes``
    are remarks for people, ``images`` is the topic of images, "" without any.

    Raises:
        ConfigError: the bag is damaged.
        InputError: ``topic`` is no topic of images.

    """

    def __init__(self, bag: Bag, topic: str | None = None) -> None:
        self.bag = bag
        self.notes: list[str] = []
        self.images = bag.only(topic, _RAW, _PACKED) if topic else self._usual(_RAW, _PACKED)
        tables = [self._table(kinds, *row) for kinds, row in _ROWS.items()]
        gyro, self.odometry, self.joints, self.commands = tables
        self.gyro = self._upright(gyro)
        self.odometry[:, 3] = np.unwrap(self.odometry[:, 3])
        self.info = self._camera_info()
        if not self.images:
            self.notes.append("there are no images")

    @cached_property
    def image_times(self) -> Array:
        """(n,) the times [s] of the images, ascending."""
        return np.array([image.time for image in self.each_image()])

    def each_image(self) -> Iterator[BagImage]:
        """The images, in the order of their times; those whose stamps go back are left out."""
        stamps, received = self._stamps
        times = self._on_clock(stamps, received, self.images, quiet=True)
        last = -math.inf
        for number, message in enumerate(self.bag.messages(self.images)):
            if number < len(times) and times[number] > last:
                last, name = float(times[number]), f"{self.images} {number}"
                at = float(received[number])
                yield BagImage(name, last, at, message.kind, message.content)

    @cached_property
    def turning(self) -> Array:
        """(n, 4): ``gyro``, or without one the rates of the turns of ``odometry``."""
        if len(self.gyro) or len(self.odometry) < 2:
            return self.gyro
        rates = np.diff(self.odometry[:, 3]) / np.diff(self.odometry[:, 0])
        rows = np.full((len(rates), 4), math.nan)
        rows[:, 0], rows[:, 3] = self.odometry[1:, 0], rates
        self.notes.append("there is no gyro: turns are those of the wheels")
        return rows

    def wheels(self, robot: RobotModel) -> Array:
        """(n, 3): time [s], and the ways [m] that the left and right wheel have rolled."""
        if len(self.joints):
            return np.column_stack([self.joints[:, 0], robot.wheel_radius * self.joints[:, 1:]])
        turned = 0.5 * robot.track * self.odometry[:, 3]
        way = driven_way(self.odometry)
        return np.column_stack([self.odometry[:, 0], way - turned, way + turned])

    @cached_property
    def _stamps(self) -> tuple[Array, Array]:
        rows = [(self._stamp(m), self._since(m.received)) for m in self.bag.messages(self.images)]
        table = np.array(rows, dtype=np.float64).reshape(-1, 2)
        self._on_clock(table[:, 0], table[:, 1], self.images)
        return table[:, 0], table[:, 1]

    def _since(self, nanoseconds: int) -> float:
        return (nanoseconds - self.bag.begin) / 1e9  # as the decimal number is read

    def _stamp(self, message: BagMessage) -> float:
        """The stamp [s since the bag's begin]; nan without one."""
        header = getattr(message.content, "header", None)
        if header is None:
            return math.nan
        return self._since(10**9 * header.stamp.sec + header.stamp.nanosec)

    def _on_clock(
        self, stamps: Array, received: Array, topic: str, *, quiet: bool = False
    ) -> Array:
        """``stamps`` where they are on the bag's clock, otherwise the times of reception."""
        if not len(stamps) or np.isnan(stamps).any():
            return received
        off = float(np.median(received - stamps))
        if abs(off) <= _CLOCKS:
            return stamps
        if not quiet:
            what = f"the clock of {topic} is {abs(off):.6g} s {'behind' if off > 0.0 else 'ahead'}"
            self.notes.append(f"{what}: its messages count from their reception")
        return received

    def _usual(self, *kinds: str) -> str:
        """The topic of ``kinds`` with a usual name, or else that with most messages; "" if none."""
        counts = self.bag.counts
        known = [name for name, kind in self.bag.kinds.items() if kind in kinds and counts[name]]
        known.sort(key=lambda name: (name.rpartition("/")[2] not in _USUAL, -counts[name], name))
        if len(known) > 1:
            self.notes.append(f"{known[0]} is read, not {', '.join(known[1:4])}")
        return known[0] if known else ""

    def _table(
        self, kinds: tuple[str, ...], width: int, row: Callable[[Any], Sequence[float]]
    ) -> Array:
        """Times and numbers of the messages of a kind that are finite and come later."""
        topic = self._usual(*kinds)
        messages = self.bag.messages(topic) if topic else iter(())
        rows = [(self._stamp(m), self._since(m.received), *row(m.content)) for m in messages]
        table = np.array(rows, dtype=np.float64).reshape(-1, 2 + width)
        table[:, 1] = self._on_clock(table[:, 0], table[:, 1], topic)
        latest = np.maximum.accumulate(np.concatenate([[-np.inf], table[:, 1]]))[:-1]
        kept = table[np.isfinite(table[:, 1:]).all(axis=1) & (table[:, 1] > latest), 1:]
        if lost := len(table) - len(kept):
            self.notes.append(
                f"{lost} of {len(table)} messages of {topic} left out: not finite, or going back"
            )
        return np.asarray(kept)

    def _upright(self, gyro: Array) -> Array:
        """The rates of a gyro whose axes are turned to base_link's by the direction of gravity."""
        up = gyro[:, 4:].mean(axis=0) if len(gyro) else np.zeros(3)
        axis = int(np.abs(up).argmax())
        rates = gyro[:, :4].copy()
        low, high = _GRAVITY
        if low < float(np.linalg.norm(up)) < high and (axis < 2 or up[2] < 0.0):
            rates[:, 1:3], rates[:, 3] = math.nan, math.copysign(1.0, up[axis]) * gyro[:, 1 + axis]
            sign = "-" if up[axis] < 0.0 else ""
            self.notes.append(f"the gyro's axis {sign}{'xyz'[axis]} is up: yaw is about it")
        return rates

    def _camera_info(self) -> Any:
        topic = self._usual(_INFO)
        message = next(self.bag.messages(topic), None) if topic else None
        if message is None:
            return None
        if message.content.width and np.any(camera_matrix(message.content)):
            return message.content
        self.notes.append(f"{topic} is empty: it says nothing of the camera")
        return None


def camera_matrix(info: Any) -> Array:
    """The matrix (9,) of a ``CameraInfo``: ``k`` of ROS 2, ``K`` of ROS 1."""
    return np.asarray(info.k if hasattr(info, "k") else info.K, dtype=np.float64)


def driven_way(odometry: Array) -> Array:
    """(n,) the way [m] driven ahead at each row of ``odometry`` (n, 4), backward negative."""
    steps, yaw = np.diff(odometry[:, 1:3], axis=0), odometry[:, 3]
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return np.concatenate([np.zeros(min(len(yaw), 1)), np.cumsum(ahead)])
