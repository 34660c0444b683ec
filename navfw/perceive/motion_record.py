"""Read recorded motion of the camera: gyro rates, or poses in the format of TUM RGB-D."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from navfw.assumption import Assumption
from navfw.errors import InputError, locating
from navfw.numerics import Array
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.timed_table import LENGTH_UNITS, TIME, TIME_NAMES, TableFormat, TimedTable
from navfw.recording.static_frames import OPTICAL, assumed_axes
from navfw.robot import CameraModel

RATES = ("yaw_rate", "pitch_rate", "roll_rate")
"""Rates of rotation, positive for a turn to the left, nose down and right side down."""
_AXES = {"x": "roll_rate", "y": "pitch_rate", "z": "yaw_rate"}
_GYROS = "angular_velocity_ ang_vel_ gyro_ gyroscope_ w w_ omega_ w_rs_s_"
_BY_AXIS = {prefix + axis: rate for axis, rate in _AXES.items() for prefix in _GYROS.split()}
"""Names of rates by the gyro's axes ahead, left and up (REP 103)."""
_GYRO = TableFormat(
    columns=(TIME, *RATES),
    needed=2,
    names=TIME_NAMES
    | {rate: rate for rate in RATES}
    | {rate.removesuffix("_rate"): rate for rate in RATES}
    | _BY_AXIS,
)
_EUROC = {"p_rs_r": "t", "q_rs": "q"}
"""Prefixes in EuRoC's ground truth, which is that of the IMU, and those used here."""
_POSITION, _QUATERNION = ("tx", "ty", "tz"), ("qx", "qy", "qz", "qw")
_POSES = TableFormat(
    columns=(TIME, *_POSITION, *_QUATERNION),
    needed=8,
    names=TIME_NAMES
    | {name: name for name in (*_POSITION, *_QUATERNION)}
    | {f"{kind}_{axis}": f"{name}{axis}" for kind, name in _EUROC.items() for axis in "wxyz"},
    units=LENGTH_UNITS,
)
_MAX_RATE = 10.0
"""Largest rate [rad/s]: images of a camera that turns faster are blurred, so larger values have
another unit."""
_MIN_DURATION = 10.0  # s
_MAX_TILT = 0.5 * math.pi
"""Net pitch and roll [rad], in at least ``_MIN_DURATION``, beyond which a record's mean rate is its
gyro's offset."""
_NORM = (0.98, 1.02)
"""Norms of a quaternion that was rounded when it was written."""
_MAX_COORDINATE = 1e6
"""Largest coordinate [m]."""
_MAX_SPEED = 60.0
"""Largest usual speed [m/s], that of a car; faster poses are probably not in metres."""
_GAP_STEPS = 2.5
"""Longest gap, in usual intervals."""
_SLACK = 0.2  # part of the longest gap: half the usual interval
_MAX_RECORDING = 86_400.0
"""Longest recording [s], if its length is unknown: a day."""


@dataclass(frozen=True, slots=True)
class MotionRecord(ABC):
    """A record of the camera's rotation, in ascending order of ``times`` (n,) [s].

    ``longest_gap`` [s] is the largest interval between neighbouring samples of a continuous record.
    The columns of ``axes`` (3, 3) are its sensor's axes in ahead, left and up. ``measured`` names
    the rates of rotation that it has. ``notes`` are remarks for the user, ``assumed`` the choices
    made for them. ``file`` and ``option`` name the record in messages, ``source`` says what
    measured it.
    """

    option: ClassVar[str]
    source: ClassVar[str]

    times: Array
    longest_gap: float
    _: KW_ONLY
    measured: frozenset[str] = frozenset(RATES)
    axes: Array = field(default_factory=lambda: np.eye(3))
    notes: tuple[str, ...] = ()
    assumed: tuple[Assumption, ...] = ()
    file: str = ""

    def turned(self, axes: Array) -> Self:
        """Return the record if its present ahead, left and up are these ``axes`` (3, 3)."""
        return replace(self, axes=axes @ self.axes)

    def without_offsets(self) -> Self:
        """Return the record without errors of its sensor that are certain."""
        return self

    @abstractmethod
    def rotation_between(self, begin: float, end: float) -> Array | None:
        """Rotation vector (3,) [rad] about base_link's x, y, z from ``begin`` to ``end`` [s].

        None if the record does not cover that time or has a gap in it.
        """

    def translation_between(self, _begin: float, _end: float) -> Array | None:
        """Translation (3,) [m] from ``begin`` to ``end`` [s], along base_link's axes at ``begin``.

        None if it was not measured.
        """
        return None

    def _span(self, begin: float, end: float, slack: float) -> slice | None:
        """Return the samples around the time from ``begin`` to ``end`` [s].

        None if there is a gap, or the record begins or ends more than ``slack`` [s] within it.
        """
        first, last = float(self.times[0]), float(self.times[-1])
        if begin < first - slack or end > last + slack:
            return None
        low = int(np.searchsorted(self.times, min(max(begin, first), last), side="right")) - 1
        low = min(low, self.times.size - 2)
        high = int(np.searchsorted(self.times, min(max(end, first), last), side="left"))
        span = slice(low, max(high, low + 1) + 1)
        return span if float(np.diff(self.times[span]).max()) <= self.longest_gap else None

    def on_clock_of(self, images: ImageSource) -> Self:
        """Return the record with times that count from the first of the ``images``.

        Its times are on the clock of the images' names or list if these overlap, otherwise they
        already count from the first image.

        Raises:
            InputError: the record and the images have no time in common, or the images' frame rate
                is only assumed.

        """
        first, last = float(self.times[0]), float(self.times[-1])
        start, duration = images.start, min(images.duration, _MAX_RECORDING)
        with locating(file=self.file, key=self.option):
            offset = 0.0
            if start is not None and first < start + duration and last > start:
                offset = start
            elif not (first < duration and last > 0.0):
                on = start or 0.0
                theirs = f"{duration:.2f} s ({on:.2f} to {on + duration:.2f} s on their clock)"
                what = f"expected readings within the time of the images, 0 to {theirs}"
                how = "Count times from the first image, or give those of the images by their names"
                raise InputError(f"{what}; got {first:.2f} to {last:.2f} s. {how} or --times")
            if not images.rate_known:
                what = "the times of the images are not known, so readings cannot be assigned"
                raise InputError(f"{what} to them; give --fps or --times")
        return replace(self, times=self.times - offset) if offset else self


@dataclass(frozen=True, slots=True)
class GyroRecord(MotionRecord):
    """``rates`` (n, 3) [rad/s] about roll, pitch, yaw; rates that are not measured are 0."""

    option: ClassVar[str] = "--gyro"
    source: ClassVar[str] = "gyro"

    rates: Array

    def turned(self, axes: Array) -> Self:
        """See ``MotionRecord``; a rate is measured if that of the axis that now points there is."""
        names = list(reversed(RATES))
        sources = np.abs(axes).argmax(axis=1).tolist()
        known = (names[k] for k, n in enumerate(sources) if names[n] in self.measured)
        rates, measured = self.rates @ axes.T, frozenset(known)
        return replace(self, axes=axes @ self.axes, rates=rates, measured=measured)

    def without_offsets(self) -> Self:
        """Return the record without certain offsets of roll and pitch, with notes on them."""
        duration, rates, notes = float(self.times[-1] - self.times[0]), self.rates.copy(), []
        for axis, name in ((0, "roll"), (1, "pitch")):
            offset = float(rates[:, axis].mean())
            if duration >= _MIN_DURATION and abs(offset) * duration > _MAX_TILT:
                rates[:, axis] -= offset
                notes.append(f"the gyro's {name} rate has an offset of {offset:.4f} rad/s: removed")
        return replace(self, rates=rates, notes=(*self.notes, *notes))

    def rotation_between(self, begin: float, end: float) -> Array | None:
        """Integrate the rates from ``begin`` to ``end`` [s]; see ``MotionRecord``."""
        if self._span(begin, end, self.longest_gap) is None:
            return None
        inside = self.times[(self.times > begin) & (self.times < end)]
        knots = np.concatenate([[begin], inside, [end]])
        rates = np.stack([np.interp(knots, self.times, rate) for rate in self.rates.T])
        return np.asarray(np.trapezoid(rates, knots))


@dataclass(frozen=True, slots=True)
class PoseRecord(MotionRecord):
    """Poses of the camera: ``places`` (n, 3) [m] are its positions in the world.

    ``quaternions`` (n, 4), as x, y, z, w, rotate from camera_optical (x right, y down, z forward)
    to the world, ``axes`` from there to base_link.
    """

    option: ClassVar[str] = "--poses"
    source: ClassVar[str] = "poses"

    places: Array
    quaternions: Array

    def rotation_between(self, begin: float, end: float) -> Array | None:
        """Return the rotation between interpolated poses; see ``MotionRecord``."""
        poses = self.poses_at(begin, end)
        if poses is None:
            return None
        turn = poses[1][0].inv() * poses[1][1]
        return np.asarray(self.axes @ turn.as_rotvec())

    def translation_between(self, begin: float, end: float) -> Array | None:
        """Return the displacement between interpolated poses; see ``MotionRecord``."""
        poses = self.poses_at(begin, end)
        if poses is None:
            return None
        places, turns = poses
        return np.asarray(self.axes @ turns[0].inv().apply(places[1] - places[0]))

    def poses_at(self, *wanted: float) -> tuple[Array, Rotation] | None:
        """Interpolate places (n, 3) [m] and rotations, camera_optical to world, at n times [s].

        None if the record does not cover all of the time from the first to the last of them.
        """
        # the nearest pose will do for an image just before the first pose, or just after the last
        span = self._span(min(wanted), max(wanted), _SLACK * self.longest_gap)
        if span is None:
            return None
        moments = np.clip(np.array(wanted), self.times[0], self.times[-1])
        ways = [np.interp(moments, self.times[span], along) for along in self.places[span].T]
        turns = Slerp(self.times[span], Rotation.from_quat(self.quaternions[span]))(moments)
        return np.stack(ways, axis=1), turns


def longest_gap(times: Array) -> float:
    """Return the largest interval [s] of a continuous record with samples at ``times`` (n,) [s]."""
    return _GAP_STEPS * float(np.median(np.diff(times)))


def load_gyro_record(path: Path, axes: Array | None = None) -> GyroRecord:
    """Read a table with the columns time, yaw_rate and, if known, pitch_rate and roll_rate.

    Without a header these are the columns, in s and rad/s. A header may name them in other words
    and units (``navfw.perceive.timed_table``), in any order, among columns of other quantities.
    Rows with a missing or NaN value are left out and make a gap. ``axes`` (3, 3) are those of the
    gyro, as columns, in ahead, left and up; None: those that the names say. Offsets are left in.

    Raises:
        InputError: the file is no such table, a rate can only be in another unit, or there are
            fewer than two samples; with file and line.

    """
    table = TimedTable(path, _GYRO)
    notes = [f"gyro columns not used: {', '.join(table.unused)}"] if table.unused else []
    assumed = list(table.assumed)
    if table.names & _BY_AXIS.keys() and axes is None:
        assumed.append(assumed_axes(np.eye(3), "its file says nothing else"))
    samples = table.array(TIME, *reversed(RATES))
    fastest = np.abs(samples[:, 1:]).max(axis=1)
    is_usable = np.isfinite(samples).all(axis=1)
    for k in np.flatnonzero(is_usable & (fastest > _MAX_RATE)).tolist():
        what = (
            f"a rate of {fastest[k]:g} rad/s is above {_MAX_RATE:g}; are these degrees per second"
        )
        how = "Name the unit in the header: yaw_rate_deg_s, or yaw_rate [mdeg/s]"
        raise table.error(f"{what}? {how}", table.lines[k])
    usable = samples[is_usable]
    times = usable[:, 0]
    interval = table.interval(times, "gyro sample")
    if left_out := len(samples) - len(usable):
        notes.append(f"{left_out} of {len(samples)} gyro samples are not numbers")
    record = GyroRecord(
        times=times,
        longest_gap=_GAP_STEPS * interval,
        measured=frozenset(RATES) & table.numbers.keys(),
        notes=tuple(notes),
        assumed=tuple(assumed),
        file=table.file,
        rates=usable[:, 1:],
    )
    return record if axes is None else record.turned(axes)


def load_pose_record(path: Path, pitch: float = 0.0, axes: Array | None = None) -> PoseRecord:
    """Read a table of ``time tx ty tz qx qy qz qw`` ([s], [m], quaternion), or EuRoC's.

    The camera's axis points ``pitch`` [rad] below base_link's x axis. With ``axes`` (3, 3) poses
    are those of a body with these axes, as columns, in ahead, left and up.

    Raises:
        InputError: the file is no such table, a row has no position or no rotation, positions can
            only be in another unit, or there are fewer than two poses; with file and, where it is
            one line, line.

    """
    table = TimedTable(path, _POSES)
    poses = table.array(*_POSES.columns)
    for line, pose in zip(table.lines, poses.tolist(), strict=True):
        if not all(map(math.isfinite, pose)) or max(map(abs, pose[1:4])) > _MAX_COORDINATE:
            raise table.error("expected finite numbers, positions in metres", line)
        norm = math.hypot(*pose[4:])
        if not _NORM[0] <= norm <= _NORM[1]:
            what = f"qx qy qz qw have the norm {norm:.3g}, not 1"
            raise table.error(f"{what}; expected the order x, y, z, w", line)
    times, places = poses[:, 0], poses[:, 1:4]
    interval = table.interval(times, "pose")
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    speed = float(np.median(steps / np.diff(times)))
    if speed > _MAX_SPEED:
        what = f"the camera moves at {speed:.0f} m/s"
        raise table.error(f"{what}; expected positions in metres, not millimetres")
    assumed = list(table.assumed)
    if axes is None and table.names & {f"{kind}_x" for kind in _EUROC}:
        reason = "its columns are those of EuRoC, whose poses are of the IMU"
        assumed.append(assumed_axes(OPTICAL, reason, "poses"))
    return PoseRecord(
        times=times,
        longest_gap=_GAP_STEPS * interval,
        assumed=tuple(assumed),
        file=table.file,
        places=places,
        quaternions=poses[:, 4:],
        axes=CameraModel(pitch=pitch).base_from_camera if axes is None else axes,
    )
