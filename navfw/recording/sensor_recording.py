"""The sensor readings of a recording: the only input of a replay besides map and stack."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.errors import ConfigError
from navfw.numerics import Array, Image
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of
from navfw.signals import Encoders, Frame, Inertial, SensorReading

_TOLERANCE = 1.0
"""Largest difference of clocks in a recording [s]."""
_MAX_RATE = 1000.0
"""Largest rate of a turn [rad/s]; gyros measure up to 70."""


@dataclass(frozen=True, slots=True)
class SensorRecording:
    """Sensor ``readings`` and commands of a run (n control ticks).

    ``commands`` (n, 2) are the stack's: v [m/s] and w [rad/s]. ``complete`` is false if the
    recording ends before its run.
    """

    readings: tuple[SensorReading, ...]
    commands: Array
    complete: bool

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def times(self) -> Array:
        """(n,) the times of the ticks [s]."""
        return np.array([reading.time for reading in self.readings])


def load_recording(path: str | Path, max_bytes: int = topics.MAX_BYTES) -> SensorRecording:
    """Load the sensor readings of a recording, images included.

    Of a file that is cut off, the intact part.

    Raises:
        ConfigError: the file does not exist, is too large, or is not a recording (``RecordedRun``);
            its readings are none that sensors give.

    """
    path = Path(path)
    run = RecordedRun(path, max_bytes)
    images = _Images(path, max_bytes)
    readings: list[SensorReading] = []
    commands: list[tuple[float, float]] = []
    for message in run.messages(topics.READING, *topics.IMAGES):
        if message.topic == topics.READING:
            row: topics.ReadingRow = message.content
            readings.append(images.complete(row))
            commands.append((row.v, row.w))
        else:
            images.add(message)
    if not readings and not run.complete:
        raise _no_recording(path, "the file is cut off before its first reading")
    _check(readings, path)
    table = np.array(commands, dtype=np.float64).reshape(-1, 2)
    return SensorRecording(tuple(readings), table, run.complete)


class _Images:
    """The images since the last reading, by their channel; they stand before their reading."""

    def __init__(self, path: Path, max_bytes: int) -> None:
        self._path = path
        self._left = max_bytes
        self._waiting: dict[str, deque[Image]] = {topic: deque() for topic in topics.IMAGES}

    def add(self, message: RecordedMessage) -> None:
        image = image_of(message, self._path)
        self._left -= image.nbytes
        if self._left < 0:
            raise _no_recording(self._path, "its images are too large")
        self._waiting[message.topic].append(image)

    def complete(self, row: topics.ReadingRow) -> SensorReading:
        """The reading of ``row`` with the images that stand before it."""
        frame = landmark_frame = None
        if row.pictures & topics.ImageFlags.CAMERA:
            sided = row.pictures & topics.ImageFlags.SIDES
            sides = tuple(map(self._take, topics.SIDE_IMAGES)) if sided else ()
            frame = Frame(row.frame_time, self._take(topics.CAMERA_IMAGE), sides)
        if row.pictures & topics.ImageFlags.LANDMARKS:
            landmark_frame = Frame(row.landmark_frame_time, self._take(topics.LANDMARK_IMAGE))
        if any(self._waiting.values()):
            raise _no_recording(self._path, "an image belongs to no reading")
        return SensorReading(
            time=row.time,
            inertial=Inertial(row.inertial_time, row.roll_rate, row.pitch_rate, row.yaw_rate),
            encoders=Encoders(row.encoders_time, row.left, row.right),
            frame=frame,
            landmark_frame=landmark_frame,
        )

    def _take(self, topic: str) -> Image:
        if not self._waiting[topic]:
            raise _no_recording(self._path, f"images of {topic} are missing")
        return self._waiting[topic].popleft()


def _check(readings: Sequence[SensorReading], path: Path) -> None:
    times = np.array([reading.time for reading in readings])
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise _no_recording(path, "times do not increase")
    for measured in ("inertial", "encoders"):
        taken = np.array([getattr(reading, measured).time for reading in readings])
        if not _near(taken, times, times):
            what = "the times of gyro or encoders are not those of their readings"
            raise _no_recording(path, what)
    inertial = [reading.inertial for reading in readings]
    rates = np.array([(gyro.roll_rate, gyro.pitch_rate, gyro.yaw_rate) for gyro in inertial])
    if (np.abs(rates) > _MAX_RATE).any():
        raise _no_recording(path, f"a rate is above {_MAX_RATE:g} rad/s")
    for kind in ("frame", "landmark_frame"):
        frames = [(getattr(reading, kind), reading.time) for reading in readings]
        pairs = np.array([(frame.time, time) for frame, time in frames if frame is not None])
        if len(pairs) and not _near(pairs[:, 0], pairs[:, 1], times):
            raise _no_recording(path, "the time of an image is not that of its reading")


def _near(measured: Array, read: Array, times: Array) -> bool:
    """Whether measurements [s] were made in the run, and before they were read.

    They may be as old as the run: a camera or encoders that fail repeat their last measurement.
    """
    earliest = times[0] - _TOLERANCE if len(times) else 0.0
    return bool(((measured >= earliest) & (measured <= read + _TOLERANCE)).all())


def _no_recording(path: Path, reason: str) -> ConfigError:
    return ConfigError(f"not a recording: {reason}", file=path)
