"""Corrects the heading by the directions of walls, most of which are parallel or at right angles.

The points seen over the last metres are projected onto two axes at right angles. The projection is
sharpest where the axes lie along the walls. The first clear directions are remembered; later ones
near a remembered one show how far the heading has drifted since.
"""

from __future__ import annotations

import math

import numpy as np

from navfw.numerics import Array

_QUARTER = 0.5 * math.pi  # defined
"""Angle [rad] after which the two axes repeat."""

_ANGLES = 90  # chosen
"""Number of directions tried within that angle; the best one is refined."""

_BIN = 0.05  # chosen
"""Width [m] of the bins in which projections are counted."""

_MIN_POINTS, _MIN_CONTRAST = 60, 1.6  # chosen
"""Smallest number of points; smallest sharpness, best over median direction."""

_BESIDE, _MAX_BESIDE = 4, 0.75  # measured
"""Number of directions beside the best one, and the largest sharpness there relative to the best.
Higher values are less exact, or a curved wall: one of radius 12 m has 0.93."""

WALL_SIGMA = 0.012  # measured
"""Standard deviation [rad] of a direction. Over 377 key poses in a hospital half of the directions
were within 0.004 and 90 % within 0.010; neighbouring ones share most of their points."""

_NEAR, _FAR = 3.0, 0.15  # chosen
"""Standard deviations up to which a direction is a remembered one, and the distance [rad] from all
of them above which it is new."""

_NEEDED = 4  # chosen
"""Number of successive directions that must agree to be remembered as one."""


class WallDirections:
    """Remembers the directions of walls in ``map``, and corrects the heading by them."""

    def __init__(self) -> None:
        self._known: list[float] = []
        self._candidates: list[float] = []

    def heading(self, points: Array, yaw: float, sigma: float) -> float | None:
        """Return the yaw [rad, map] by the walls remembered so far; None if it is unclear.

        ``points`` (n, 2) [m] are in the robot's frame, ``yaw`` is its heading by odometry, with
        standard deviation ``sigma`` [rad].
        """
        seen = wall_direction(points)
        if seen is None:
            return None
        direction = yaw + seen
        off = min((_quarter(known - direction) for known in self._known), key=abs, default=math.inf)
        if abs(off) <= _NEAR * math.hypot(sigma, WALL_SIGMA):
            self._candidates = []
            return yaw + off
        if abs(off) > _FAR:
            self._learn(direction)
        return None

    def _learn(self, direction: float) -> None:
        """Remember a direction once it was seen several times in a row."""
        agrees = [c for c in self._candidates if abs(_quarter(c - direction)) <= _NEAR * WALL_SIGMA]
        self._candidates = [*agrees, direction] if len(agrees) == len(self._candidates) else []
        if len(self._candidates) == _NEEDED:
            offsets = [_quarter(c - direction) for c in self._candidates]
            self._known.append(direction + sum(offsets) / _NEEDED)
            self._candidates = []


def wall_direction(points: Array) -> float | None:
    """Return the angle [rad] in [0, pi / 2) of the walls in ``points`` (n, 2); None if unclear."""
    if len(points) < _MIN_POINTS:
        return None
    step = _QUARTER / _ANGLES
    sharpness = [_sharpness(points, index * step) for index in range(_ANGLES)]
    best = int(np.argmax(sharpness))
    beside = max(sharpness[(best + _BESIDE) % _ANGLES], sharpness[best - _BESIDE])
    clear = sharpness[best] >= _MIN_CONTRAST * float(np.median(sharpness))
    if not clear or beside > _MAX_BESIDE * sharpness[best]:
        return None
    before, at, after = (sharpness[(best + k) % _ANGLES] for k in (-1, 0, 1))
    bend = before - 2.0 * at + after
    return (best + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)) * step % _QUARTER


def _sharpness(points: Array, angle: float) -> float:
    """Return the sum of squares of the histograms of ``points`` along two axes."""
    c, s = math.cos(angle), math.sin(angle)
    x, y = points[:, 0], points[:, 1]
    total = 0.0
    for along in (c * x + s * y, c * y - s * x):
        bins = along / _BIN
        lower = np.floor(bins)
        share = bins - lower
        index = (lower - lower.min()).astype(np.intp)
        counts = np.bincount(index, 1.0 - share, minlength=int(index.max()) + 2)
        counts[1:] += np.bincount(index, share, minlength=int(index.max()) + 1)
        total += float(np.square(counts).sum())
    return total


def _quarter(angle: float) -> float:
    """Wrap ``angle`` [rad] to [-pi / 4, pi / 4)."""
    return (angle + 0.5 * _QUARTER) % _QUARTER - 0.5 * _QUARTER
