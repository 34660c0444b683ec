"""Bags of ROS 1 and 2, written for tests."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from navfw.numerics import Image

BEGIN = 1_700_000_000_000_000_000
"""Time of the first message [ns]."""
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
    ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
KINDS = ("bag", "db3", "mcap")
"""Suffixes of the three formats."""


class Sent(NamedTuple):
    """A message on ``topic`` at ``time`` [s] with ``fields``, of which each is plain or nested."""

    topic: str
    kind: str
    time: float
    fields: dict[str, Any]
    stamp: float | None = None
    """[s], if it differs from ``time``."""


def write_bag(path: Path, sent: Iterable[Sent], packed: str = "") -> Path:
    """Write a bag: a file for ``.bag``, otherwise a folder with the storage of the suffix.

    ``packed``: whether each ``chunk``, each ``message`` or the ``file`` is compressed.
    """
    path.parent.mkdir(exist_ok=True)
    ordered = sorted(sent, key=lambda each: each.time)
    writer: Any
    if path.suffix == ".bag":
        writer, store, serialize = Writer1(path), ROS1, ROS1.serialize_ros1
        if packed:
            writer.set_compression(Writer1.CompressionFormat.BZ2)
    else:
        plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
        path = path.with_name(path.name.replace(".", "-"))
        writer, store = Writer2(path, version=9, storage_plugin=plugin), ROS2
        serialize = ROS2.serialize_cdr
        if packed:
            mode = CompressionMode[{"chunk": "STORAGE"}.get(packed, packed.upper())]
            writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        topics = {
            sample[:2]: writer.add_connection(sample.topic, sample.kind, typestore=store)
            for sample in first(ordered)
        }
        for sample in ordered:
            data = serialize(message(store, sample), sample.kind)
            writer.write(topics[sample[:2]], nanoseconds(sample.time), data)
    return path


def first(sent: Sequence[Sent]) -> list[Sent]:
    """The first message of each topic and type."""
    return list({each[:2]: each for each in reversed(sent)}.values())


def nanoseconds(time: float) -> int:
    return BEGIN + round(1e9 * time)


def message(types: Any, sent: Sent) -> Any:
    """The message with default values in all other fields."""
    made = blank(types, sent.kind)
    if hasattr(made, "header"):
        at = nanoseconds(sent.time if sent.stamp is None else sent.stamp)
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(at, 10**9)
    fill(made, sent.fields)
    return made


def fill(made: Any, fields: dict[str, Any]) -> None:
    for key, value in fields.items():
        name = key if hasattr(made, key) else key.upper()
        if isinstance(value, dict):
            fill(getattr(made, name), value)
        else:
            setattr(made, name, value)


def blank(types: Any, kind: str) -> Any:
    """A message of ``kind`` with zeros and empty lists."""
    made: dict[str, Any] = {}
    for name, (node, of) in types.fielddefs[kind][1]:
        if node == 1:  # a plain value
            made[name] = "" if of[0] == "string" else False if of[0] == "bool" else 0
        elif node == 2:  # another message
            made[name] = blank(types, of)
        else:
            (inner, what), size = of
            count = size if node == 3 else 0
            numeric = inner == 1 and what[0] != "string"
            made[name] = np.zeros(count, what[0]) if numeric else []
    return types.types[kind](**made)


def image(topic: str, time: float, pixels: Image, encoding: str, pad: int = 0) -> Sent:
    """An ``Image`` with ``pad`` bytes after each row."""
    height, width = pixels.shape[:2]
    rows = np.pad(pixels.reshape(height, -1), ((0, 0), (0, pad)))
    fields = {"height": height, "width": width, "encoding": encoding, "step": rows.shape[1]}
    return Sent(topic, "sensor_msgs/msg/Image", time, fields | {"data": rows.ravel()})


def packed_image(topic: str, time: float, content: bytes, kind: str = "jpeg") -> Sent:
    """A ``CompressedImage``."""
    data = np.frombuffer(content, np.uint8)
    return Sent(topic, "sensor_msgs/msg/CompressedImage", time, {"format": kind, "data": data})


def imu(time: float, rates: Sequence[float], way: Sequence[float] = (0.0, 0.0, 9.8)) -> Sent:
    fields = {
        "angular_velocity": dict(zip("xyz", rates, strict=True)),
        "linear_acceleration": dict(zip("xyz", way, strict=True)),
    }
    return Sent("/imu", "sensor_msgs/msg/Imu", time, fields)


def joints(time: float, left: float, right: float) -> Sent:
    fields: dict[str, Any] = {"name": ["caster", "wheel_left", "wheel_right"]}
    fields["position"] = np.array([0.0, left, right])
    return Sent("/joint_states", "sensor_msgs/msg/JointState", time, fields)


def odometry(time: float, x: float, y: float, yaw: float) -> Sent:
    turn = {"z": float(np.sin(0.5 * yaw)), "w": float(np.cos(0.5 * yaw))}
    fields = {"pose": {"pose": {"position": {"x": x, "y": y}, "orientation": turn}}}
    return Sent("/odom", "nav_msgs/msg/Odometry", time, fields)


def twist(time: float, v: float, w: float, *, stamped: bool = False) -> Sent:
    fields = {"linear": {"x": v}, "angular": {"z": w}}
    if stamped:
        return Sent("/cmd_vel", "geometry_msgs/msg/TwistStamped", time, {"twist": fields})
    return Sent("/cmd_vel", "geometry_msgs/msg/Twist", time, fields)
