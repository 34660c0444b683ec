"""Sensor readings on disk: the only input of a replay besides map and stack.

One ``.npz`` of plain arrays, without pickles. The size is bounded: a recorder stops at its limit
and marks the recording as incomplete, and the size of a file is read from its headers before it is
unpacked. Nothing of an array is unpacked before type, shape and size in its header are checked.
"""

from __future__ import annotations

import math
import zipfile
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from numpy.lib import format as npy

from navfw.config.input_file import open_input
from navfw.errors import ConfigError
from navfw.signals import Array, Encoders, Frame, Image, Inertial, SensorReading

__all__ = ["MAX_BYTES", "SensorRecorder", "SensorRecording", "load_recording"]

MAX_BYTES = 1 << 30
"""Largest unpacked size of a recording [byte]; 1 h of 160x120 images at 10 Hz is 0.7 GB."""

_NONE = -1
"""Index of a tick without a frame."""

_SIDES = 2
"""Number of side views of a frame; they have equal widths."""

_SENSOR_COLUMNS = 6
"""Time, roll, pitch and yaw rate, time of the inertial reading, time of the encoders."""


@dataclass(frozen=True, slots=True)
class _Frames:
    """A stream of images: ``time`` (m,), ``image`` (m, height, width); ``at`` (n,) index or -1."""

    at: npt.NDArray[np.int64]
    time: Array
    image: Image

    def get(self, tick: int) -> Frame | None:
        index = int(self.at[tick])
        return None if index == _NONE else Frame(float(self.time[index]), self.image[index])


@dataclass(frozen=True, slots=True)
class SensorRecording:
    """Sensor readings and commands of a run (n control ticks).

    ``sensors`` (n, 6): time [s], roll, pitch and yaw rate [rad/s], time of the inertial reading
    and of the encoders [s]. ``ticks`` (n, 2): encoder counts left, right. ``commands`` (n, 2):
    v [m/s] and w [rad/s]. ``complete`` is false if the recorder reached its limit before the end
    of the run.
    """

    sensors: Array
    ticks: npt.NDArray[np.int64]
    commands: Array
    frames: _Frames
    landmark_frames: _Frames
    side_frames: _Frames
    complete: bool

    def __len__(self) -> int:
        return len(self.sensors)

    def readings(self) -> Iterator[SensorReading]:
        """The sensor readings of the stack, one per control tick."""
        for tick, row in enumerate(self.sensors.tolist()):
            time, roll, pitch, yaw, inertial_time, encoder_time = row
            left, right = self.ticks[tick].tolist()
            yield SensorReading(
                time=time,
                inertial=Inertial(inertial_time, roll, pitch, yaw),
                encoders=Encoders(encoder_time, left, right),
                frame=self._frame(tick),
                landmark_frame=self.landmark_frames.get(tick),
            )

    def _frame(self, tick: int) -> Frame | None:
        """The frame of a tick with its side views."""
        frame, sides = self.frames.get(tick), self.side_frames.get(tick)
        if frame is None or sides is None:
            return frame
        parts = np.hsplit(sides.image, _SIDES)
        return replace(frame, sides=tuple(np.ascontiguousarray(part) for part in parts))


@dataclass(slots=True)
class _FrameList:
    """Collects a stream of images of equal size."""

    at: list[int] = field(default_factory=list)
    time: list[float] = field(default_factory=list)
    image: list[Image] = field(default_factory=list)

    def add(self, frame: Frame | None) -> None:
        """Add one tick, with or without a frame."""
        self.at.append(_NONE if frame is None else len(self.image))
        if frame is not None:
            self.time.append(frame.time)
            self.image.append(frame.image.copy())

    def arrays(self, name: str) -> dict[str, npt.NDArray[Any]]:
        stack = np.stack(self.image) if self.image else np.zeros((0, 1, 1), dtype=np.uint8)
        return {
            f"{name}_at": np.array(self.at, dtype=np.int64),
            f"{name}_time": np.array(self.time, dtype=np.float64),
            f"{name}_image": stack,
        }


@dataclass(slots=True)
class SensorRecorder:
    """Collects readings and commands in memory, at most ``max_bytes``, until ``save``."""

    max_bytes: int = MAX_BYTES
    complete: bool = field(init=False, default=True)
    _bytes: int = field(init=False, default=0)
    _sensors: array[float] = field(init=False, default_factory=lambda: array("d"))
    _ticks: array[int] = field(init=False, default_factory=lambda: array("q"))
    _commands: array[float] = field(init=False, default_factory=lambda: array("d"))
    _frames: _FrameList = field(init=False, default_factory=_FrameList)
    _landmark_frames: _FrameList = field(init=False, default_factory=_FrameList)
    _side_frames: _FrameList = field(init=False, default_factory=_FrameList)

    def add(self, reading: SensorReading, v: float, w: float) -> None:
        """Add one control tick: the reading, and the stack's twist v [m/s], w [rad/s]."""
        frames = reading.frame, reading.landmark_frame, _sides_of(reading.frame)
        cost = 96 + sum(frame.image.nbytes for frame in frames if frame)
        if not self.complete or self._bytes + cost > self.max_bytes:
            self.complete = False
            return
        self._bytes += cost
        inertial, encoders = reading.inertial, reading.encoders
        self._sensors.extend(
            (
                reading.time,
                inertial.roll_rate,
                inertial.pitch_rate,
                inertial.yaw_rate,
                inertial.time,
                encoders.time,
            )
        )
        self._ticks.extend((encoders.left, encoders.right))
        self._commands.extend((v, w))
        streams = self._frames, self._landmark_frames, self._side_frames
        for stream, frame in zip(streams, frames, strict=True):
            stream.add(frame)

    def save(self, path: Path) -> None:
        """Write the recording to ``path`` (.npz)."""
        arrays: dict[str, Any] = {
            "sensors": np.array(self._sensors, dtype=np.float64).reshape(-1, _SENSOR_COLUMNS),
            "ticks": np.array(self._ticks, dtype=np.int64).reshape(-1, 2),
            "commands": np.array(self._commands, dtype=np.float64).reshape(-1, 2),
            "complete": np.array(self.complete),
            **self._frames.arrays("frames"),
            **self._landmark_frames.arrays("landmarks"),
            **self._side_frames.arrays("sides"),
        }
        np.savez_compressed(path, **arrays)


_TOLERANCE = 1.0
"""Largest difference of clocks in a recording [s]."""
_FASTEST = 1000.0
"""Largest rate of a turn [rad/s]; gyros measure up to 70."""

# name of each array -> (dtype, number of dimensions)
_LAYOUT: dict[str, tuple[str, int]] = {
    "sensors": ("<f8", 2),
    "ticks": ("<i8", 2),
    "commands": ("<f8", 2),
    "complete": ("|b1", 0),
} | {
    f"{stream}_{part}": kind
    for stream in ("frames", "landmarks", "sides")
    for part, kind in {"at": ("<i8", 1), "time": ("<f8", 1), "image": ("|u1", 3)}.items()
}
_NPY_VERSION = (1, 0)
_SIDE_FILES = {f"{name}.npy" for name in _LAYOUT if name.startswith("sides")}


def load_recording(path: str | Path, max_bytes: int = MAX_BYTES) -> SensorRecording:
    """Load a recording written by ``SensorRecorder.save``.

    Raises:
        ConfigError: the file does not exist, is too large, or is not such a recording.

    """
    path = Path(path)
    with open_input(path, max_bytes) as stream:
        try:
            arrays = _read_arrays(stream, max_bytes)
        except Exception as error:
            # zipfile, zlib and numpy raise errors of many kinds for damaged archives: BadZipFile,
            # zlib.error, NotImplementedError, RuntimeError, TokenError, AttributeError and more
            reason = str(error) or type(error).__name__
            raise _no_recording(path, reason) from None
    recording = SensorRecording(
        sensors=arrays["sensors"],
        ticks=arrays["ticks"],
        commands=arrays["commands"],
        frames=_frames(arrays, "frames"),
        landmark_frames=_frames(arrays, "landmarks"),
        side_frames=_frames(arrays, "sides"),
        complete=bool(arrays["complete"]),
    )
    _check(recording, path)
    return recording


def _read_arrays(stream: BinaryIO, max_bytes: int) -> dict[str, npt.NDArray[Any]]:
    with zipfile.ZipFile(stream) as archive:
        sizes = {info.filename: info.file_size for info in archive.infolist()}
        expected = {f"{name}.npy" for name in _LAYOUT}
        # a recording without side views may lack their arrays
        if not set(sizes) & _SIDE_FILES:
            expected -= _SIDE_FILES
        if set(sizes) != expected:
            odd = ", ".join(sorted(set(sizes) ^ expected)[:3])
            raise ValueError(f"unexpected or missing arrays ({odd})")
        if sum(sizes.values()) > max_bytes:
            raise ValueError(f"unpacked size of {sum(sizes.values())} bytes exceeds {max_bytes}")
        found = {name: _read_array(archive, name) for name in _LAYOUT if f"{name}.npy" in expected}
    return _FrameList([_NONE] * len(found["sensors"])).arrays("sides") | found


def _read_array(archive: zipfile.ZipFile, name: str) -> npt.NDArray[Any]:
    """An array of the archive, whose header must agree with ``_LAYOUT`` and with its size."""
    dtype, dimensions = _LAYOUT[name]
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as member:
        if npy.read_magic(member) != _NPY_VERSION:
            raise ValueError(f"array {name!r} is of another version of numpy's format")
        shape, _, found = npy.read_array_header_1_0(member)
        if found.str != dtype or len(shape) != dimensions:
            raise ValueError(f"expected array {name!r} to be {dtype} with {dimensions} dimensions")
        if member.tell() + found.itemsize * math.prod(shape) != info.file_size:
            raise ValueError(f"the size of array {name!r} is not that of its shape {shape}")
    with archive.open(info) as member:
        return npy.read_array(member, allow_pickle=False)


def _sides_of(frame: Frame | None) -> Frame | None:
    """The side views of a frame, joined into one image; None without side views."""
    if frame is None or not frame.sides:
        return None
    return Frame(frame.time, np.hstack(frame.sides))


def _frames(arrays: dict[str, npt.NDArray[Any]], name: str) -> _Frames:
    return _Frames(arrays[f"{name}_at"], arrays[f"{name}_time"], arrays[f"{name}_image"])


def _check(recording: SensorRecording, path: Path) -> None:
    ticks = len(recording)
    wide = recording.sensors.shape == (ticks, _SENSOR_COLUMNS)
    pairs = recording.ticks.shape == recording.commands.shape == (ticks, 2)
    if not (wide and pairs):
        raise _no_recording(path, "lengths differ")
    times = recording.sensors[:, 0]
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise _no_recording(path, "times do not increase")
    if not _near(recording.sensors[:, 4:], times[:, None], times):
        raise _no_recording(path, "the times of gyro or encoders are not those of their readings")
    if (np.abs(recording.sensors[:, 1:4]) > _FASTEST).any():
        raise _no_recording(path, f"a rate is above {_FASTEST:g} rad/s")
    for frames in (recording.frames, recording.landmark_frames, recording.side_frames):
        images = len(frames.image)
        counted = len(frames.at) == ticks and len(frames.time) == images
        if not counted or np.any((frames.at < _NONE) | (frames.at >= images)):
            raise _no_recording(path, "images are missing")
        given = frames.at != _NONE
        if not _near(frames.time[frames.at[given]], times[given], times):
            raise _no_recording(path, "the time of an image is not that of its reading")


def _near(measured: Array, read: Array, times: Array) -> bool:
    """Whether measurements [s] were made in the run, and before they were read.

    They may be as old as the run: a camera or encoders that fail repeat their last measurement.
    """
    earliest = times[0] - _TOLERANCE if len(times) else 0.0
    return bool(((measured >= earliest) & (measured <= read + _TOLERANCE)).all())


def _no_recording(path: Path, reason: str) -> ConfigError:
    return ConfigError(f"not a recording of sensor readings: {reason}", file=path)
