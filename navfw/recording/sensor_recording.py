"""The sensor readings of a recording: the only input of a replay besides map and stack."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.errors import ConfigError
from navfw.recording.channel_list import (
    CAMERA_IMAGE,
    LANDMARK_IMAGE,
    LEFT_IMAGE,
    READING,
    RIGHT_IMAGE,
)
from navfw.recording.reading_message import ImageFlags, ReadingRow
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of
from navfw.recording.run_folder import MAX_BYTES
from navfw.signals import Array, Encoders, Frame, Image, Inertial, SensorReading

_IMAGES = (CAMERA_IMAGE, LANDMARK_IMAGE, LEFT_IMAGE, RIGHT_IMAGE)

_TOLERANCE = 1.0
"""Largest difference of clocks in a recording [s]."""
_MAX_RATE = 1000.0
"""Largest rate of a turn [rad/s]; gyros measure up to 70."""


@dataclass(frozen=True, slots=True)
class SensorRecording:
    """Sensor readings and commands of a run (n control ticks).

    ``rows`` are the readings without images, ``frames`` and ``landmark_frames`` the images of each
    tick or None. ``complete`` is false if the recording ends before its run.
    """

    rows: tuple[ReadingRow, ...]
    frames: tuple[Frame | None, ...]
    landmark_frames: tuple[Frame | None, ...]
    complete: bool

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def times(self) -> Array:
        """(n,) the times of the ticks [s]."""
        return np.array([row.time for row in self.rows])

    @property
    def commands(self) -> Array:
        """(n, 2) the stack's commands: v [m/s] and w [rad/s]."""
        return np.array([(row.v, row.w) for row in self.rows], dtype=np.float64).reshape(-1, 2)

    def readings(self) -> Iterator[SensorReading]:
        """The sensor readings of the stack, one per control tick."""
        ticks = zip(self.rows, self.frames, self.landmark_frames, strict=True)
        for row, frame, landmark_frame in ticks:
            yield SensorReading(
                time=row.time,
                inertial=Inertial(row.inertial_time, row.roll_rate, row.pitch_rate, row.yaw_rate),
                encoders=Encoders(row.encoders_time, row.left, row.right),
                frame=frame,
                landmark_frame=landmark_frame,
            )


def load_recording(path: str | Path, max_bytes: int = MAX_BYTES) -> SensorRecording:
    """Load the sensor readings of a recording, images included.

    Of a file that is cut off, the intact part.

    Raises:
        ConfigError: the file does not exist, is too large, or is not a recording (``RecordedRun``);
            its readings are none that sensors give.

    """
    path = Path(path)
    run = RecordedRun(path, max_bytes)
    images = _Images(path, max_bytes)
    rows: list[ReadingRow] = []
    frames: list[Frame | None] = []
    landmark_frames: list[Frame | None] = []
    for message in run.messages(READING, *_IMAGES):
        if message.topic != READING:
            images.add(message)
            continue
        row: ReadingRow = message.content
        rows.append(row)
        frames.append(images.frame(row))
        landmark_frames.append(images.landmark_frame(row))
        images.forget()
    if not rows and not run.complete:
        raise _no_recording(path, "the file is cut off before its first reading")
    recording = SensorRecording(tuple(rows), tuple(frames), tuple(landmark_frames), run.complete)
    _check(recording, path)
    return recording


class _Images:
    """The images since the last reading, by their channel; they stand before their reading."""

    def __init__(self, path: Path, max_bytes: int) -> None:
        self._path = path
        self._left = max_bytes
        self._waiting: dict[str, deque[Image]] = {topic: deque() for topic in _IMAGES}

    def add(self, message: RecordedMessage) -> None:
        image = image_of(message, self._path)
        self._left -= image.nbytes
        if self._left < 0:
            raise _no_recording(self._path, "its images are too large")
        self._waiting[message.topic].append(image)

    def frame(self, row: ReadingRow) -> Frame | None:
        """The frame of a reading, with its side views."""
        if not row.pictures & ImageFlags.CAMERA:
            return None
        sided = row.pictures & ImageFlags.SIDES
        sides = (self._take(LEFT_IMAGE), self._take(RIGHT_IMAGE)) if sided else ()
        return Frame(row.frame_time, self._take(CAMERA_IMAGE), sides)

    def landmark_frame(self, row: ReadingRow) -> Frame | None:
        """The larger frame of a reading."""
        if not row.pictures & ImageFlags.LANDMARKS:
            return None
        return Frame(row.landmark_frame_time, self._take(LANDMARK_IMAGE))

    def forget(self) -> None:
        """End a reading: all its images have been taken."""
        if any(self._waiting.values()):
            raise _no_recording(self._path, "an image belongs to no reading")

    def _take(self, topic: str) -> Image:
        if not self._waiting[topic]:
            raise _no_recording(self._path, f"images of {topic} are missing")
        return self._waiting[topic].popleft()


def _check(recording: SensorRecording, path: Path) -> None:
    rows = np.array([row[:6] for row in recording.rows], dtype=np.float64).reshape(-1, 6)
    times = rows[:, 0]
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise _no_recording(path, "times do not increase")
    if not _near(rows[:, 4:], times[:, None], times):
        raise _no_recording(path, "the times of gyro or encoders are not those of their readings")
    if (np.abs(rows[:, 1:4]) > _MAX_RATE).any():
        raise _no_recording(path, f"a rate is above {_MAX_RATE:g} rad/s")
    for frames in (recording.frames, recording.landmark_frames):
        given = np.array([frame is not None for frame in frames], dtype=bool)
        taken = np.array([frame.time for frame in frames if frame is not None], dtype=np.float64)
        if not _near(taken, times[given], times):
            raise _no_recording(path, "the time of an image is not that of its reading")


def _near(measured: Array, read: Array, times: Array) -> bool:
    """Whether measurements [s] were made in the run, and before they were read.

    They may be as old as the run: a camera or encoders that fail repeat their last measurement.
    """
    earliest = times[0] - _TOLERANCE if len(times) else 0.0
    return bool(((measured >= earliest) & (measured <= read + _TOLERANCE)).all())


def _no_recording(path: Path, reason: str) -> ConfigError:
    return ConfigError(f"not a recording: {reason}", file=path)
