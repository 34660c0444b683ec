"""How sensors are mounted: by static transforms of ROS, by an option, or as other sensors turn."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from navfw.assumption import Assumption
from navfw.errors import InputError
from navfw.numerics import Array

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of an optical frame (right, down, ahead), as columns, in one with ahead, left and up."""
AXES: list[Array] = sorted(
    Rotation.create_group("O").as_matrix().round() + 0.0,
    key=lambda axes: [not np.array_equal(axes, usual) for usual in (np.eye(3), OPTICAL)],
)
"""How the axes of a sensor may lie along ahead, left and up (3, 3); the usual ones first."""
_TIE = 0.02
"""Difference of two agreements that decides nothing."""
_AGREES, _BETTER = 0.6, 0.4
"""Least agreement of axes that are taken, and how much more it is than that of the assumed ones."""
_TURNED = 1.0
"""Turns of the wheels [rad] after which the axes of the gyro are compared with them."""
BASES = {"base_link", "base_footprint"}
"""Frames with the axes ahead, left and up of a robot (REP 105)."""
_UNIT = 0.1
"""Allowed error of a quaternion's norm."""


class StaticFrames:
    """The transforms of ``TFMessage``s; the newest of each frame counts."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def add(self, message: Any) -> bool:
        """Take in the transforms of ``message``; whether each had a rotation."""
        good = True
        for link in message.transforms:
            q = link.transform.rotation
            if not abs(math.hypot(q.x, q.y, q.z, q.w) - 1.0) < _UNIT:
                good = False
                continue
            turn = Rotation.from_quat((q.x, q.y, q.z, q.w)).as_matrix()
            parent = link.header.frame_id.lstrip("/")
            self._parents[link.child_frame_id.lstrip("/")] = parent, turn
        return good

    def above(self, frame: str) -> dict[str, Array]:
        """The axes of ``frame``, as columns (3, 3), in each frame from itself up to the root."""
        at, axes = frame.lstrip("/"), np.eye(3)
        above = {at: axes}
        while at in self._parents and self._parents[at][0] not in above:
            at, turn = self._parents[at]
            axes = turn @ axes
            above[at] = axes
        return above


def axes_text(axes: Array) -> str:
    """The axes of a sensor that point ahead, left and up: ``z,-x,-y`` of an optical frame."""
    largest = np.abs(axes).argmax(axis=1).tolist()
    return ",".join(("-" if axes[k, n] < 0.0 else "") + "xyz"[n] for k, n in enumerate(largest))


def assumed_axes(axes: Array, reason: str, sensor: str = "gyro") -> Assumption:
    """That a ``sensor`` has these ``axes``."""
    taken = f"{axes_text(axes)} are ahead, left, up"
    return Assumption(f"axes of the {sensor}", taken, reason, "--imu-axes")


def axes_of(text: str) -> Array:
    """The axes (3, 3) that ``text`` names, as ``axes_text`` writes them.

    Raises:
        InputError: it names no three axes, or they are not right-handed.

    """
    wanted = re.sub(r"[+\s]", "", text.lower())
    for axes in AXES:
        if axes_text(axes) == wanted:
            return axes
    what = "expected which of its axes point ahead, left and up, right-handed, such as z,-x,-y"
    raise InputError(f"{what}; got {text!r:.40}", key="--imu-axes")


def agreeing_axes(seen: Array, measured: Array) -> tuple[Array | None, float]:
    """The axes in which turns ``measured`` (n, 3) [rad] are those ``seen`` (n, 3), and how well.

    Turns are about ahead, left and up; nan where they are not known. 1 is equality, 0 chance. The
    axes are None where those of ``measured`` are about as good as any, or none are good.
    """
    known = np.isfinite(seen)

    def agreement(axes: Array) -> float:
        turned = np.where(known, np.nan_to_num(measured) @ axes.T, 0.0)
        wanted = np.where(known, seen, 0.0)
        return float(2.0 * (turned * wanted).sum() / max((turned**2 + wanted**2).sum(), 1e-12))

    values = [agreement(axes) for axes in AXES]
    best = next(k for k, value in enumerate(values) if value > max(values) - _TIE)
    is_other = values[best] >= _AGREES and values[best] - values[0] >= _BETTER
    return (AXES[best], values[best]) if is_other else (None, values[0])


def axes_by_wheels(gyro: Array, odometry: Array, axes: Array) -> Array | None:
    """The axes in which a ``gyro`` turns as the wheels do; None if these ``axes`` may be right.

    Rows of ``gyro`` are time [s] and rates [rad/s], of ``odometry`` time [s], x, y, yaw [rad].
    """
    times, yaw = odometry[:, 0], odometry[:, 3]
    if len(gyro) < 2 or np.abs(np.diff(yaw)).sum() < _TURNED:
        return None
    rates = np.nan_to_num(gyro[:, 1:])
    parts = 0.5 * (rates[1:] + rates[:-1]) * np.diff(gyro[:, :1], axis=0)
    turns = np.concatenate([np.zeros((1, 3)), np.cumsum(parts, axis=0)]) @ axes.T
    at = [np.interp(times, gyro[:, 0], turn) for turn in turns.T]
    unknown = np.full(len(yaw) - 1, math.nan)
    wheels = np.column_stack([unknown, unknown, np.diff(yaw)])
    better, _ = agreeing_axes(wheels, np.diff(np.column_stack(at), axis=0))
    return None if better is None else better @ axes
