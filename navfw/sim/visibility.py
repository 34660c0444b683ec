"""Visibility culling: finds the parts of a world that need not be drawn from a viewpoint.

A part is culled outside the field of view, and behind walls that nothing overtops; both are tests
of plane geometry. A part counts as occluded only if walls entirely in front of it cover its whole
range of bearings: the image is the same with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from navfw.numerics import Array, Mask
from navfw.numerics.products import product
from navfw.sim.shapes import Rectangle

_BEHIND = 1e-6
"""Tolerance of the test whether a point is behind a wall's face [m]."""
_SEAM = 1e-9
"""Largest gap between the bearings of two walls that meet at a corner, by rounding [rad]."""
_FOV_MARGIN = 1e-3
"""Margin added to the field of view at each side [rad]."""


@dataclass(frozen=True, slots=True)
class PartBounds:
    """Bounds of a part of the world: the convex polygon ``corners`` (4, 2) [m] in the plane.

    A part with a ``plane`` (px, py, pz, offset) is visible only from points (x, y, z) in front of
    it: px x + py y + pz z > offset.
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
        """Return the rectangle around points (N, 2 or more), sides along ``direction`` [rad]."""
        c, s = math.cos(direction), math.sin(direction)
        turn = np.array([[c, s], [-s, c]])
        turned = product(points[:, :2], turn.T)
        (x0, y0), (x1, y1) = turned.min(axis=0), turned.max(axis=0)
        corners = product(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), turn)
        return cls(corners) if plane is None else cls(corners, plane)


class Visibility:
    """Finds which of ``parts`` are visible among occluding ``walls`` of ``height`` [m]."""

    def __init__(
        self, walls: Sequence[Rectangle], height: float, parts: Sequence[PartBounds]
    ) -> None:
        self._height = height
        edges = [np.hstack([r.corners, np.roll(r.corners, -1, axis=0)]) for r in walls]
        self._edges = np.concatenate(edges) if edges else np.empty((0, 4))
        self._corners = np.array([p.corners for p in parts]).reshape(-1, 4, 2)
        self._planes = np.array([p.plane for p in parts]).reshape(-1, 4)

    def visible(self, eye: Array, middle: float, half: float) -> Mask:
        """(N,) whether each part may be visible from ``eye`` (x, y, z) [m, ``map``].

        The field of view extends ``half`` [rad] to both sides of the bearing ``middle`` [rad].
        """
        edges = self._edges if eye[2] < self._height else self._edges[:0]
        return _visible(edges, self._corners, self._planes, eye, middle, half)


@numba.njit(cache=True)
def field_of_view(axes: Array, right: float, down: float) -> tuple[float, float]:
    """Middle bearing and half width [rad] of a camera's field of view in the plane.

    ``axes`` (3, 3) are the camera's (right, down, ahead) in ``map``, by columns; ``right`` and
    ``down`` half the image's size in focal lengths. The half width is pi if the vertical direction
    is within the field of view.
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
    return middle, half + _FOV_MARGIN


@numba.njit(cache=True)
def _wrapped(angle: float) -> float:
    """Return ``angle`` [rad] in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@numba.njit(cache=True)
def _facing(edges: Array, eye: Array, lines: Array, begins: Array, ends: Array) -> int:
    """Fill lines (x, y, offset) and bearings of edges that face the eye; return their count."""
    count = 0
    for i in range(edges.shape[0]):
        x0, y0, x1, y1 = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        length = math.hypot(x1 - x0, y1 - y0)
        normal_x, normal_y = (y1 - y0) / length, (x0 - x1) / length
        offset = normal_x * x0 + normal_y * y0
        if normal_x * eye[0] + normal_y * eye[1] - offset <= _BEHIND:
            continue
        lines[count, 0], lines[count, 1], lines[count, 2] = normal_x, normal_y, offset
        # counter-clockwise around a wall is clockwise around an eye in front of the edge
        begins[count] = math.atan2(y1 - eye[1], x1 - eye[0])
        ends[count] = math.atan2(y0 - eye[1], x0 - eye[0])
        count += 1
    return count


@numba.njit(cache=True)
def _extent(corners: Array, eye: Array) -> tuple[float, float, float]:
    """Bearing [rad] of a part, and its extent to both sides of it; -pi, pi around the eye."""
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
    """Whether the union of the first ``count`` of ``spans`` (N, 2) covers low to high."""
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
    """Return the part of the bearings low ... high within ``half`` of ``off``; inf, -inf if none.

    All of them where they reach the field of view across the wrap at pi.
    """
    if high >= off - half and low <= off + half:
        return max(low, off - half), min(high, off + half)
    for turned in (off - 2.0 * math.pi, off + 2.0 * math.pi):
        if high >= turned - half and low <= turned + half:
            return low, high
    return np.inf, -np.inf


@numba.njit(cache=True)
def _visible(
    edges: Array, bounds: Array, planes: Array, eye: Array, middle: float, half: float
) -> Mask:
    """See ``Visibility.visible``."""
    lines = np.empty((edges.shape[0], 3))
    begins, ends = np.empty(edges.shape[0]), np.empty(edges.shape[0])
    facing = _facing(edges, eye, lines, begins, ends)
    spans = np.empty((2 * facing + 1, 2))
    visible = np.zeros(bounds.shape[0], np.bool_)
    for n in range(bounds.shape[0]):
        plane, corners = planes[n], bounds[n]
        if plane[0] * eye[0] + plane[1] * eye[1] + plane[2] * eye[2] <= plane[3]:
            continue
        direction, low, high = _extent(corners, eye)
        if high - low >= 2.0 * math.pi:
            visible[n] = True  # the eye is inside the bounds
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
            if end < begin:  # its bearings wrap around at pi
                spans[count, 0], spans[count, 1] = begin - 2.0 * math.pi, end
                count += 1
                end += 2.0 * math.pi
            if begin <= high and end >= low:
                spans[count, 0], spans[count, 1] = begin, end
                count += 1
        visible[n] = not _covered(low, high, spans, count)
    return visible
