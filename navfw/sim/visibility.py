"""Which parts of a world can be seen from a place: the others need not be drawn.

Walls that reach to the ceiling hide what lies behind them, and nothing is seen outside the field of
view; both are plane geometry. A part counts as hidden only if walls that lie wholly in front of it
cover every direction in which it lies, so what is drawn looks the same with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from navfw.signals import Array, Mask
from navfw.sim.shapes import Rectangle

__all__ = ["PartBounds", "Visibility", "field_of_view"]

_BEHIND = 1e-6
"""What lies less than this [m] behind a wall's face is that face itself."""
_SEAM = 1e-9
"""Walls that meet at a corner leave no gap, whatever the rounding [rad]."""
_WIDER = 1e-3
"""How much more than the field of view is looked at to each side [rad]."""


@dataclass(frozen=True, slots=True)
class PartBounds:
    """Where a part of the world is: within the convex polygon ``corners`` (4, 2) [m] of the plan.

    ``plane`` is given for parts that are seen from one side only: they face towards (x, y, z) with
    x px + y py + z pz > offset for its (px, py, pz, offset).
    """

    corners: Array
    plane: tuple[float, float, float, float] = (0.0, 0.0, 0.0, -1.0)

    @classmethod
    def around(
        cls,
        points: Array,
        direction: float = 0.0,
        plane: tuple[float, float, float, float] | None = None,
    ) -> PartBounds:
        """The rectangle with sides along ``direction`` [rad] that holds points (N, 2 or more)."""
        c, s = math.cos(direction), math.sin(direction)
        turn = np.array([[c, s], [-s, c]])
        (x0, y0), (x1, y1) = (np.array(f(points[:, :2] @ turn.T, axis=0)) for f in (np.min, np.max))
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ turn
        return cls(corners) if plane is None else cls(corners, plane)


class Visibility:
    """Tells which of ``outlines`` are seen over, between and beside ``walls`` of a height [m]."""

    def __init__(
        self, walls: Sequence[Rectangle], height: float, outlines: Sequence[PartBounds]
    ) -> None:
        self._height = height
        edges = [np.hstack([r.corners, np.roll(r.corners, -1, axis=0)]) for r in walls]
        self._edges = np.concatenate(edges) if edges else np.empty((0, 4))
        self._corners = np.array([o.corners for o in outlines]).reshape(-1, 4, 2)
        self._planes = np.array([o.plane for o in outlines]).reshape(-1, 4)

    def seen(self, eye: Array, middle: float, half: float) -> Mask:
        """(N,) which outlines may be seen from ``eye`` (x, y, z) [m].

        The field of view reaches ``half`` [rad] to both sides of the direction ``middle`` [rad].
        """
        edges = self._edges if eye[2] < self._height else self._edges[:0]
        return _seen(edges, self._corners, self._planes, eye, middle, half)


@numba.njit(cache=True)
def field_of_view(axes: Array, right: float, down: float) -> tuple[float, float]:
    """Middle direction and half width [rad] of what a camera sees, in the plan.

    ``axes`` (3, 3) are the camera's (right, down, ahead) in the map, by columns; ``right`` and
    ``down`` how far the image reaches from its middle, in focal lengths. The half width is pi where
    the camera sees straight up or down.
    """
    middle = math.atan2(axes[1, 2], axes[0, 2])
    length = max(math.hypot(axes[0, 2], axes[1, 2]), 1e-12)
    along_x, along_y = axes[0, 2] / length, axes[1, 2] / length
    half = 0.0
    for x in (-right, right):
        for y in (-down, down):
            ray_x = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2]
            ray_y = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2]
            forward = ray_x * along_x + ray_y * along_y
            aside = along_x * ray_y - along_y * ray_x
            if forward <= 1e-6:
                return middle, math.pi
            half = max(half, abs(math.atan2(aside, forward)))
    return middle, half + _WIDER


@numba.njit(cache=True)
def _wrapped(angle: float) -> float:
    """``angle`` [rad] in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@numba.njit(cache=True)
def _facing(edges: Array, eye: Array, lines: Array, begins: Array, ends: Array) -> int:
    """The edges that face the eye: their lines (x, y, offset) and the directions they cover."""
    count = 0
    for i in range(edges.shape[0]):
        x0, y0, x1, y1 = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        length = math.hypot(x1 - x0, y1 - y0)
        normal_x, normal_y = (y1 - y0) / length, (x0 - x1) / length
        offset = normal_x * x0 + normal_y * y0
        if normal_x * eye[0] + normal_y * eye[1] - offset <= _BEHIND:
            continue
        lines[count, 0], lines[count, 1], lines[count, 2] = normal_x, normal_y, offset
        # corners run counter-clockwise around a wall, so clockwise around an eye outside of it
        begins[count] = math.atan2(y1 - eye[1], x1 - eye[0])
        ends[count] = math.atan2(y0 - eye[1], x0 - eye[0])
        count += 1
    return count


@numba.njit(cache=True)
def _extent(corners: Array, eye: Array) -> tuple[float, float, float]:
    """Direction [rad] of an outline, and how far it reaches to both sides of it; all around: pi."""
    x = corners[:, 0].mean() - eye[0]
    y = corners[:, 1].mean() - eye[1]
    low = high = 0.0
    for k in range(corners.shape[0]):
        dx, dy = corners[k, 0] - eye[0], corners[k, 1] - eye[1]
        angle = math.atan2(x * dy - y * dx, x * dx + y * dy)
        low, high = min(low, angle), max(high, angle)
    if high - low > math.pi - 1e-6 or math.hypot(x, y) < 1e-6:
        return 0.0, -math.pi, math.pi
    return math.atan2(y, x), low, high


@numba.njit(cache=True)
def _behind(corners: Array, line: Array) -> bool:
    for k in range(corners.shape[0]):
        if line[0] * corners[k, 0] + line[1] * corners[k, 1] - line[2] > -_BEHIND:
            return False
    return True


@numba.njit(cache=True)
def _covered(low: float, high: float, spans: Array, count: int) -> bool:
    """Whether the first ``count`` of ``spans`` (N, 2) together cover all from low to high."""
    reached = low
    while True:
        best = -np.inf
        for i in range(count):
            if spans[i, 0] <= reached + _SEAM and spans[i, 1] > best:
                best = spans[i, 1]
        if best >= high:
            return True
        if best <= reached:
            return False
        reached = best


@numba.njit(cache=True)
def _within_view(low: float, high: float, off: float, half: float) -> tuple[float, float]:
    """The part of directions low ... high no more than ``half`` from ``off``; inf, -inf if none.

    All of them where they reach the field of view around the back.
    """
    if high >= off - half and low <= off + half:
        return max(low, off - half), min(high, off + half)
    for turned in (off - 2.0 * math.pi, off + 2.0 * math.pi):
        if high >= turned - half and low <= turned + half:
            return low, high
    return np.inf, -np.inf


@numba.njit(cache=True)
def _seen(
    edges: Array, outlines: Array, planes: Array, eye: Array, middle: float, half: float
) -> npt.NDArray[np.bool_]:
    """See ``Visibility.seen``."""
    lines = np.empty((edges.shape[0], 3))
    begins, ends = np.empty(edges.shape[0]), np.empty(edges.shape[0])
    facing = _facing(edges, eye, lines, begins, ends)
    spans = np.empty((2 * facing + 1, 2))
    seen = np.zeros(outlines.shape[0], np.bool_)
    for n in range(outlines.shape[0]):
        plane, corners = planes[n], outlines[n]
        if plane[0] * eye[0] + plane[1] * eye[1] + plane[2] * eye[2] <= plane[3]:
            continue
        direction, low, high = _extent(corners, eye)
        if high - low >= 2.0 * math.pi:
            seen[n] = True  # the eye is within
            continue
        if half < math.pi:
            low, high = _within_view(low, high, _wrapped(middle - direction), half)
            if low > high:
                continue
        count = 0
        for i in range(facing):
            if not _behind(corners, lines[i]):
                continue
            begin, end = _wrapped(begins[i] - direction), _wrapped(ends[i] - direction)
            if end < begin:  # it covers what is just behind the eye
                spans[count, 0], spans[count, 1] = begin - 2.0 * math.pi, end
                count += 1
                end += 2.0 * math.pi
            if begin <= high and end >= low:
                spans[count, 0], spans[count, 1] = begin, end
                count += 1
        seen[n] = not _covered(low, high, spans, count)
    return seen
