"""Find how sensors are mounted: by ROS's static transforms, an option, or how others turn."""

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
"""Axes of an optical frame (right, down, ahead), as columns, in a frame of ahead, left and up."""
AXES: list[Array] = sorted(
    Rotation.create_group("O").as_matrix().round() + 0.0,
    key=lambda axes: [not np.array_equal(axes, usual) for usual in (np.eye(3), OPTICAL)],
)
"""All right-angled mountings of a sensor (3, 3) in ahead, left and up; the usual ones first."""
_TIE = 0.02
"""Difference of two agreements below which they count as equal."""
_AGREES, _BETTER = 0.6, 0.4
"""Least agreement of axes that are taken, and how much more it is than that of the assumed ones."""
_TURNED = 1.0
"""Turns of the wheels [rad] after which the axes of the gyro are compared with them."""
BASES = {"base_link", "base_footprint"}
"""Frames with a robot's axes ahead, left and up (REP 105)."""
_UNIT = 0.1
"""Allowed error of a quaternion's norm."""


class StaticFrames:
    """The transforms of ``TFMessage``s; the newest of each frame is used."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def add(self, message: Any) -> bool:
        """Add the transforms of ``message``; return whether each had a valid rotation."""
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
        """Return the axes of ``frame``, as columns (3, 3), in itself and each frame above it."""
        at, axes = frame.lstrip("/"), np.eye(3)
        above = {at: axes}
        while at in self._parents and self._parents[at][0] not in above:
            at, turn = self._parents[at]
            axes = turn @ axes
            above[at] = axes
        return above


def axes_text(axes: Array) -> str:
    """Return which axes of a sensor point ahead, left and up: ``z,-x,-y`` for an optical frame."""
    largest = np.abs(axes).argmax(axis=1).tolist()
    return ",".join(("-" if axes[k, n] < 0.0 else "") + "xyz"[n] for k, n in enumerate(largest))


def assumed_axes(axes: Array, reason: str, sensor: str = "gyro") -> Assumption:
    """Return the assumption that a ``sensor`` has these ``axes``, for ``reason``."""
    taken = f"{axes_text(axes)} are ahead, left, up"
    return Assumption(f"axes of the {sensor}", taken, reason, "--imu-axes")


def axes_of(text: str) -> Array:
    """Parse the axes (3, 3) that ``text`` names, as ``axes_text`` writes them.

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
    """Find axes by which rotations ``measured`` (n, 3) [rad] agree with ``seen`` (n, 3).

    Rotations are about ahead, left and up; nan if unknown. The second value is the agreement: 1 for
    equality, 0 for chance. The axes are None if those of ``measured`` agree about as well as any,
    or none agree.
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
    """Return axes in which ``gyro`` turns as the wheels do; None if these ``axes`` may be right.

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
