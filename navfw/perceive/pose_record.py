"""Recorded poses of the camera in the format of the TUM RGB-D benchmark."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import InputError
from navfw.perceive.gyro_columns import RATES
from navfw.robot import CameraModel
from navfw.signals import Array

_COLUMNS = "timestamp tx ty tz qx qy qz qw"
_MAX_BYTES = 50_000_000
"""Largest size of a record [byte]: an hour of poses at 100 Hz."""
_NORM = (0.98, 1.02)
"""Norms of a quaternion that was rounded when it was written."""
_MAX_COORDINATE = 1e6
"""Largest coordinate [m]."""
_MAX_INTERVAL = 2.0
"""Longest usual interval of poses [s]: longer ones are probably not in seconds."""
_MAX_SPEED = 60.0
"""Largest usual speed [m/s], that of a car; faster poses are probably not in metres."""
_GAP_STEPS = 2.5
"""Longest gap, in usual intervals."""
_SLACK = 0.2  # part of the longest gap: half the usual interval
_OPTION = "--poses"


@dataclass(frozen=True, slots=True)
class PoseRecord:
    """Poses in ascending order of ``times`` (n,) [s].

    ``places`` (n, 3) [m] are the camera's positions in the world, ``quaternions`` (n, 4), as x, y,
    z, w, rotate from camera_optical (x right, y down, z forward) to the world, ``base_from_camera``
    (3, 3) from there to base_link. ``longest_gap`` [s] is the largest interval of neighbouring
    poses between which is interpolated. ``file`` and ``option`` name the record in messages,
    ``notes`` are remarks for the user.
    """

    times: Array
    places: Array
    quaternions: Array
    longest_gap: float
    base_from_camera: Array
    notes: tuple[str, ...] = ()
    file: str = ""
    option: str = _OPTION
    measured: frozenset[str] = frozenset(RATES)
    source: str = "poses"

    def rotation_between(self, begin: float, end: float) -> Array | None:
        """Rotation vector (3,) [rad] about base_link's x, y, z from ``begin`` to ``end`` [s].

        None if the record does not cover that time or has a gap in it.
        """
        poses = self.poses_at(begin, end)
        if poses is None:
            return None
        turn = poses[1][0].inv() * poses[1][1]
        return np.asarray(self.base_from_camera @ turn.as_rotvec())

    def translation_between(self, begin: float, end: float) -> Array | None:
        """Translation (3,) [m] from ``begin`` to ``end`` [s], along base_link's axes at ``begin``.

        None if the record does not cover that time or has a gap in it.
        """
        poses = self.poses_at(begin, end)
        if poses is None:
            return None
        places, turns = poses
        return np.asarray(self.base_from_camera @ turns[0].inv().apply(places[1] - places[0]))

    def shifted(self, seconds: float) -> Self:
        """The same record with times later by ``seconds``."""
        return replace(self, times=self.times + seconds)

    def poses_at(self, *wanted: float) -> tuple[Array, Rotation] | None:
        """Places (n, 3) [m] and rotations from camera_optical to the world at n times [s].

        They are interpolated. None if the record does not cover all of the time from the first to
        the last of them.
        """
        moments = np.array(wanted)
        first, last = float(self.times[0]), float(self.times[-1])
        # the nearest pose will do for an image just before the first pose, or just after the last
        slack = _SLACK * self.longest_gap
        covered = (moments >= first - slack) & (moments <= last + slack)
        moments = np.clip(moments, first, last)
        low = int(np.searchsorted(self.times, moments.min(), side="right")) - 1
        low = min(low, len(self.times) - 2)
        high = max(int(np.searchsorted(self.times, moments.max(), side="left")), low + 1)
        part = slice(low, high + 1)
        if not covered.all() or np.diff(self.times[part]).max() > self.longest_gap:
            return None
        places = np.stack(
            [np.interp(moments, self.times[part], self.places[part, k]) for k in range(3)], axis=1
        )
        turns = Slerp(self.times[part], Rotation.from_quat(self.quaternions[part]))(moments)
        return places, turns


def load_pose_record(path: Path, pitch: float = 0.0) -> PoseRecord:
    """Read lines of ``timestamp tx ty tz qx qy qz qw`` ([s], [m], quaternion), blank separated.

    The camera's axis points ``pitch`` [rad] below base_link's x axis.

    Raises:
        InputError: the file is not readable, a line has other than eight numbers or no rotation,
            times do not increase, times or positions can only be in another unit, or there are
            fewer than two poses; with file and, where it is one line, line.

    """
    poses: list[list[float]] = []
    for line, cells in _lines(path):
        if not poses and cells[1:] == _COLUMNS.split()[1:]:
            continue  # the names of the columns
        pose = _pose(path, line, cells)
        if poses and pose[0] <= poses[-1][0]:
            raise InputError(
                f"time {pose[0]:.6f} s does not come after {poses[-1][0]:.6f} s; sort the lines by "
                "time",
                file=shown_path(path),
                line=line,
            )
        poses.append(pose)
    if len(poses) < 2:
        raise InputError(
            f"has {len(poses) or 'no'} pose; at least two lines of {_COLUMNS} are needed",
            file=shown_path(path),
        )
    table = np.array(poses)
    interval = float(np.median(np.diff(table[:, 0])))
    if interval > _MAX_INTERVAL:
        raise InputError(
            f"poses are {interval:g} s apart; expected times in seconds", file=shown_path(path)
        )
    steps = np.linalg.norm(np.diff(table[:, 1:4], axis=0), axis=1)
    speed = float(np.median(steps / np.diff(table[:, 0])))
    if speed > _MAX_SPEED:
        raise InputError(
            f"the camera moves at {speed:.0f} m/s; expected positions in metres, not millimetres",
            file=shown_path(path),
        )
    return PoseRecord(
        times=table[:, 0],
        places=table[:, 1:4],
        quaternions=table[:, 4:],
        longest_gap=_GAP_STEPS * interval,
        base_from_camera=CameraModel(pitch=pitch).base_from_camera,
        file=shown_path(path),
    )


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is neither empty nor a comment."""
    text = read_input_text(path, _MAX_BYTES)
    for number, line in enumerate(text.splitlines(), start=1):
        cells = line.replace(",", " ").split()
        if cells and not cells[0].startswith("#"):
            yield number, cells


def _pose(path: Path, line: int, cells: list[str]) -> list[float]:
    """Time, position and quaternion of a line."""
    file = shown_path(path)
    if len(cells) != len(_COLUMNS.split()):
        raise InputError(f"has {len(cells)} values; expected {_COLUMNS}", file=file, line=line)
    pose = []
    for name, cell in zip(_COLUMNS.split(), cells, strict=True):
        try:
            pose.append(float(cell))
        except ValueError:
            raise InputError(
                f"{cell!r:.40} is not a number", file=file, line=line, key=name
            ) from None
    if not all(map(math.isfinite, pose)) or max(map(abs, pose[1:4])) > _MAX_COORDINATE:
        raise InputError("expected finite numbers, positions in metres", file=file, line=line)
    norm = math.hypot(*pose[4:])
    if not _NORM[0] <= norm <= _NORM[1]:
        raise InputError(
            f"qx qy qz qw have the norm {norm:.3g}, not 1; expected the order x, y, z, w",
            file=file,
            line=line,
        )
    return pose
