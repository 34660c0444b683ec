"""Read bags of ROS 1 and 2: the measurements of their sensors, and their images.

The library rosbags reads files ``.bag``, ``.mcap`` and ``.db3``, and folders of ROS 2. The
definitions of messages in a bag are not used, as rosbags would execute code made of them.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple
from weakref import finalize

import numpy as np

from navfw.assumption import Assumption
from navfw.config.extras import extra_imports
from navfw.config.input_file import is_folder, shown_path
from navfw.errors import ConfigError, NavfwError, UnknownNameError
from navfw.numerics import Array
from navfw.process.atomic import scratch_folder
from navfw.recording.bag_topics import CLOCKS, ROLES, SensorClock, info_topics, topics_of, unwrapped
from navfw.recording.cut_bag import is_cut, mended
from navfw.recording.image_messages import is_film, no_picture
from navfw.recording.ros_messages import message_types
from navfw.recording.run_folder import bag_files
from navfw.recording.static_frames import (
    BASES,
    OPTICAL,
    StaticFrames,
    assumed_axes,
    axes_by_wheels,
    axes_of,
)

with extra_imports("bags"):
    from rosbags import rosbag1, rosbag2
    from rosbags.serde import SerdeError


_MAX_RATE = 10.0
"""Largest rate [rad/s] of a camera that sees more than blur; larger ones have another unit."""
_REMEDIES = {".bag": "rosbag reindex", ".active": "rosbag reindex", ".mcap": "mcap recover"}
"""The command that repairs a bag, by its suffix; ``ros2 bag reindex`` repairs a folder."""


class BagImage(NamedTuple):
    """An image message, its ``name``, its stamp ``time`` and when it was ``received`` [s]."""

    name: str
    time: float
    received: float
    message: Any


class Bag:
    """Reads the bag at ``path``; times are seconds since its begin, by stamps, else by reception.

    Arrays have a row for each message, its time first: ``gyro`` (n, 4) rates about base_link's x,
    y, z [rad/s], ``odometry`` (n, 4) x, y [m] and yaw [rad] without jumps, ``joints`` (n, 3) the
    angles of the left and the right wheel [rad], ``commands`` (n, 3) v [m/s], w [rad/s]. ``images``
    (n, 2) has times and reception of the images of ``topic``, by default the topic with most
    images; ``info`` is the first ``CameraInfo`` beside it, None if there is none. The columns of
    ``axes`` (3, 3) are the gyro's axes in base_link: those that ``imu_axes`` names, else those of
    ``/tf_static``, else by the name of its frame; ``optical`` are the camera's, None if unknown.
    ``notes`` are remarks for people, ``assumed`` the choices that were made for them.

    Raises:
        ConfigError: it cannot be read, is too large, or damaged; ``topic`` shows no pictures.
        UnknownNameError: ``topic`` has no images.

    """

    info: Any = None

    def __init__(self, path: Path, topic: str | None = None, imu_axes: str | None = None) -> None:
        self.path, self.file = path, shown_path(path)
        self.notes: list[str] = []
        self.assumed: list[Assumption] = []
        self._scratch = ExitStack()
        finalize(self, self._scratch.close)
        self._files = [path]
        self._make_readable()
        with self._opened() as readers:
            self._begin = min(int(reader.start_time) for reader in readers)
            end = max(int(reader.start_time + reader.duration) for reader in readers)
            self.duration = max(1e-9 * (end - self._begin), 0.0)
            links = [link for reader in readers for link in reader.connections]
        counts: Counter[tuple[str, str]] = Counter()
        for link in links:
            counts[link.topic, link.msgtype] += link.msgcount
        self._counts = [(*key, count) for key, count in counts.items()]
        self._topics = {"images": self._image_topic(topic)}
        self._topics |= {role: self._topic_of(role) for role in ROLES if role != "images"}
        self._topics["info"] = self._info_topic()
        rows, frames, mounts = self._read()
        self._choose_gyro(rows)
        clock_of = self.image_topic or max(rows, key=lambda name: len(rows[name]), default="")
        self._clock = SensorClock(np.array([row[:2] for row in rows.get(clock_of, [])]))
        if behind := self._clock.behind:
            what = f"the clock of {clock_of} is {abs(behind):.6g} s {_where(behind)} the bag's"
            self.notes.append(f"{what}: times are its own")
        self._all_images, *others = (
            self._table(role, rows.get(self._topics[role], []))
            for role in ("images", "gyro", "odometry", "joints", "commands")
        )
        self.images = self._all_images[np.isfinite(self._all_images[:, 0])]
        self.gyro, self.odometry, self.joints, self.commands = (
            np.delete(table[np.isfinite(table[:, 0])], 1, axis=1) for table in others
        )
        self._finish_wheels()
        if self._clock.behind:
            tables = (self.images, self.gyro, self.odometry, self.joints, self.commands)
            self.duration = max([0.0, *(float(table[-1, 0]) for table in tables if len(table))])
        gyro, camera = (
            mounts.above(frames.get(self._topics[role], "")) for role in ("gyro", "images")
        )
        self.optical = self._turn_to_base(gyro, camera, imu_axes)
        if self.info is not None and not (self.info.width and self.matrix.any()):
            self.notes.append(f"{self._topics['info']} is empty: it says nothing of the camera")
            self.info = None
        self.notes += [] if len(self.images) else ["there are no images"]

    def _read(self) -> tuple[dict[str, list[tuple[float, ...]]], dict[str, str], StaticFrames]:
        """Stamp, reception and numbers of messages by topic, the frames of topics, transforms."""
        imus = dict.fromkeys(topics_of("gyro", self._counts, self.image_topic), "gyro")
        rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in imus}
        frames, mounts = dict[str, str](), StaticFrames()
        roles = {name: role for role, name in self._topics.items() if name} | imus
        for name, received, message in self._messages(*roles):
            role = roles[name]
            if role == "mounts":
                mounts.add(message)
            elif role == "info":
                self.info = self.info or message
            else:
                stamp = received
                if header := getattr(message, "header", None):  # divided, as a decimal is read
                    stamp = (10**9 * header.stamp.sec + header.stamp.nanosec - self._begin) / 1e9
                    frames.setdefault(name, header.frame_id.lstrip("/"))
                row = stamp, received, *ROLES[role].numbers(message)
                rows.setdefault(name, []).append(row)
        return rows, frames, mounts

    def _finish_wheels(self) -> None:
        """Let angles be continuous, and leave out poses that nobody fills in."""
        self.odometry[:, 3] = np.unwrap(self.odometry[:, 3])
        self.joints[:, 1:] = unwrapped(self.joints[:, 1:])
        if len(self.odometry) > 1 and not np.ptp(self.odometry[:, 1:], axis=0).any():
            what = f"poses on {self._topics['odometry']} never change"
            self.notes.append(f"{what}: they are not used")
            self.odometry = self.odometry[:0]

    def _make_readable(self) -> None:
        """Read each file of a folder by itself, and copies of those that are cut off, if need be.

        A folder of ROS 2 whose recorder was killed has no metadata.yaml; the newest messages of a
        .db3 may be in a log.
        """
        files = bag_files(self.path)
        cut = [file for file in files if not is_folder(file) and is_cut(file)]
        with suppress(ConfigError):
            if not cut:
                with self._opened():
                    return
        if len({re.sub(r"_\d+$", "", file.stem) for file in files}) > 1:
            names = ", ".join(file.name for file in files[:5])
            raise ConfigError(f"holds several recordings: give one of {names}", file=self.file)
        self._files = list(files)
        for file in cut:
            with suppress(Exception):  # of many kinds, as it may be no bag
                copy = mended(file, self._scratch.enter_context(scratch_folder("bag")))
                self._files[files.index(file)] = copy
                self.notes.append(f"{file.name} was cut off: what is intact is read")
        with self._opened():
            if files != [self.path]:
                what = "is missing or wrong, so each file is read by itself"
                self.notes.append(f"metadata.yaml {what}; ros2 bag reindex writes it")

    @property
    def image_topic(self) -> str:
        """The topic whose images are read; "" if the bag has no images."""
        return self._topics["images"]

    @property
    def info_topic(self) -> str:
        """The topic of ``info``; "" if there is none beside the images."""
        return self._topics["info"]

    @property
    def matrix(self) -> Array:
        """The camera matrix (9,) of ``info``, row by row: ``k`` of ROS 2, ``K`` of ROS 1."""
        return np.asarray(self.info.k if hasattr(self.info, "k") else self.info.K)

    def each_image(self) -> Generator[BagImage]:
        """Yield the images in the order of their times, without those whose time goes back."""
        topic = self._topics["images"]
        messages = self._messages(topic) if topic else iter(())
        for number, (row, sent) in enumerate(zip(self._all_images.tolist(), messages, strict=True)):
            if math.isfinite(row[0]):
                yield BagImage(f"{topic} {number}", row[0], row[1], sent[2])

    def _topic_of(self, role: str) -> str:
        """Return the topic that is read; "" if there is none."""
        names = topics_of(role, self._counts, self.image_topic)
        return self._chosen(role, names[: 1 if role in {"gyro", "info", "mounts"} else None])

    def _chosen(self, role: str, names: list[str], option: str = "") -> str:
        """Return the first of ``names`` or "", and note the choice if there are several."""
        if len(names) < 2:
            return names[0] if names else ""
        others = f"{', '.join(names[1:4])} {'has' if len(names) == 2 else 'have'} such messages too"
        self.assumed.append(Assumption(f"topic of {role}", names[0], others, option))
        return names[0]

    def _image_topic(self, wanted: str | None) -> str:
        """Return ``wanted``, or the topic with most images; set ``no_pictures``, reasons by topic.

        Raises:
            ConfigError: it shows no pictures.
            UnknownNameError: it has no images.

        """
        names = topics_of("images", self._counts)
        self.no_pictures = {
            name: f"video ({film}): make pictures of it by ros2 run image_transport republish"
            for name, kind, n in self._counts
            if (film := is_film(kind)) and n
        }
        if wanted is not None and wanted not in [*names, *self.no_pictures]:
            raise UnknownNameError("topic of images", wanted, names, file=self.file, key="--topic")
        for name in names:
            with closing(self._messages(name)) as messages:
                first = next(messages, None)
            if first and (reason := no_picture(first[2], "" if name == wanted else name)):
                self.no_pictures[name] = reason
        if wanted in self.no_pictures:
            what = f"{wanted} shows {self.no_pictures[wanted]}, not pictures"
            others = ", ".join(name for name in names if name not in self.no_pictures)
            hint = f"; others: {others}" if others else ""
            raise ConfigError(f"{what}{hint}", file=self.file, key="--topic")
        pictures = [name for name in names if name not in self.no_pictures]
        return wanted or self._chosen("images", pictures, "--topic")

    def _info_topic(self) -> str:
        """Return the topic of the ``camera_info`` in the namespace of the images; "" if none."""
        images, infos = self._topics["images"], topics_of("info", self._counts)
        own = info_topics(images)
        beside = [info for info in own if info in infos]
        if not beside and infos and images:
            what = f"{', '.join(infos[:3])} may be of another camera, and is not used"
            self.notes.append(f"there is no {own[0]} of {images}: {what}")
        return beside[0] if beside else ""

    def _choose_gyro(self, rows: Mapping[str, list[tuple[float, ...]]]) -> None:
        """Take the first ``Imu`` that has rates: an accelerometer's are absent, or all 0."""
        turning = []
        for name in topics_of("gyro", self._counts, self.image_topic):
            rates = np.abs(np.nan_to_num(np.array(rows[name]).reshape(-1, 5)[:, 2:])).max(axis=1)
            fast = float(np.percentile(rates, 99.0)) if len(rates) else 0.0
            if rates.any() and fast <= _MAX_RATE:
                turning.append(name)
                continue
            what = f"rates of {fast:.0f} rad/s, as if in degrees"
            what = what if fast else "no rates of rotation"
            self.notes.append(f"{name} has {what}: it is not taken as a gyro")
        self._topics["gyro"] = self._chosen("gyro", turning)

    def _turn_to_base(
        self, gyro: Mapping[str, Array], camera: Mapping[str, Array], given: str | None
    ) -> Array | None:
        """Turn the gyro's rates into base_link; return the camera's axes there, None if unknown.

        ``gyro`` and ``camera`` are each sensor's axes by the frames above it, its own frame first.
        """
        frame, axes = next(iter(gyro)), None if given is None else axes_of(given)
        roots = [name for name in camera if name in gyro and len(gyro) + len(camera) > 2]
        base = next((name for name in (*gyro, *camera) if name in BASES), "")
        base = base or next((name for name in roots if "optical" not in name), "")
        reason = ""
        if axes is None and base and base in gyro:
            axes = gyro[base]
        elif axes is None and "optical" in frame:
            axes, reason = OPTICAL, f"its frame is {frame}"
        elif axes is None:
            axes, reason = np.eye(3), f"no transform leads from its frame {frame!r} to base_link"
        if given is None and (better := axes_by_wheels(self.gyro, self.odometry, axes)) is not None:
            axes, reason = better, "it then turns as the wheels do"
        if reason and len(self.gyro):
            self.assumed.append(assumed_axes(axes, reason))
        self.axes = axes
        rates = self.gyro[:, 1:]
        lost = np.isnan(rates) @ (np.abs(axes.T) > 1e-6)
        self.gyro[:, 1:] = np.where(lost, math.nan, np.nan_to_num(rates) @ axes.T)
        seen = camera.get(base)
        if seen is None:
            return None
        is_optical = abs(seen[2, 1]) > abs(seen[2, 2])  # its y axis is about vertical, not its z
        return np.asarray(seen if is_optical else seen @ OPTICAL)

    def _table(self, role: str, rows: list[tuple[float, ...]]) -> Array:
        """Return times, reception and numbers; the time of messages that are unusable is nan."""
        table = np.array(rows, dtype=np.float64).reshape(-1, 2 + ROLES[role].width)
        topic = self._topics[role]
        off = float(np.median(table[:, 1] - table[:, 0])) if rows else 0.0
        if rows and self._clock.behind:
            table[:, 0] = self._clock.times(table)
        elif abs(off) > CLOCKS:
            table[:, 0] = table[:, 1]
            what = f"the clock of {topic} is {abs(off):.6g} s {_where(off)}"
            self.notes.append(f"{what}: its messages count from their reception")
        latest = np.maximum.accumulate([-math.inf, *table[:, 0]])[:-1]
        lost = (table[:, 0] <= latest) | ~np.isfinite(table[:, :2]).all(axis=1)
        numbers = np.isfinite(table[:, 2:])  # a gyro may have one axis
        lost |= ~(numbers.any(axis=1) if role == "gyro" else numbers.all(axis=1))
        table[lost, 0] = math.nan
        if lost.any():
            what = "not finite, or going back"
            self.notes.append(f"{lost.sum()} of {len(lost)} messages of {topic} left out: {what}")
        return table

    def _messages(self, *topics: str) -> Generator[tuple[str, float, Any]]:
        """Yield topic, time of reception [s] and content of messages, by that time."""
        types = message_types(ros1=self._is_ros1)
        with self._opened() as readers:
            for reader in readers:
                wanted = [link for link in reader.connections if link.topic in topics]
                for link, received, data in reader.messages(wanted) if wanted else ():
                    time = (received - self._begin) / 1e9
                    if not self._is_ros1:
                        yield link.topic, time, deserialize_cdr(data, link.msgtype)
                        continue
                    if link.digest not in {types.generate_msgdef(link.msgtype)[1], "*"}:
                        raise ValueError(f"{link.msgtype} is not defined as in ROS 1 Noetic")
                    yield link.topic, time, types.deserialize_ros1(data, link.msgtype)

    @property
    def _is_ros1(self) -> bool:
        return self.path.suffix in {".bag", ".active"}

    @contextmanager
    def _opened(self) -> Iterator[list[Any]]:
        """Open the readers of rosbags, one for each file, in the order of their times."""
        rosbag = rosbag1 if self._is_ros1 else rosbag2
        try:
            with ExitStack() as stack:
                readers = [stack.enter_context(rosbag.Reader(file)) for file in self._files]
                yield sorted(readers, key=lambda reader: int(reader.start_time))
        except NavfwError:
            raise
        except Exception as error:  # rosbags raises errors of many kinds for damaged content
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            hint = "of a run's recording make one by navfw export, of ROS 1 by rosbags-convert"
            if "ros2" not in reason:
                hint = f"{_REMEDIES.get(self.path.suffix, 'ros2 bag reindex')} may repair it"
            raise ConfigError(f"not a readable bag: {reason}; {hint}", file=self.file) from None


def _where(behind: float) -> str:
    return "behind" if behind > 0.0 else "ahead"


def deserialize_cdr(data: bytes, kind: str) -> Any:
    """Decode the message of type ``kind`` in ``data``, ignoring up to 8 bytes at its end."""
    types = message_types()
    for excess in (0, 4):
        with suppress(SerdeError):
            return types.deserialize_cdr(data[: len(data) - excess], kind)
    return types.deserialize_cdr(data[:-8], kind)


def driven_way(odometry: Array) -> Array:
    """Return the distance (n,) [m] driven up to each row of ``odometry`` (n, 4), back negative."""
    steps, yaw = np.diff(odometry[:, 1:3], axis=0), odometry[:, 3]
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return np.concatenate([np.zeros(min(len(yaw), 1)), np.cumsum(ahead)])
