"""The outline of a mesh as upright boxes, for floor plan, checks and maps.

A mesh is cut into horizontal bands. In each band the cells of a grid are occupied that its surface
touches or whose centre it encloses, and they are covered by rectangles. Physics and drawing use the
triangles themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from navfw.signals import Array, Mask
from navfw.sim.mesh_file import TriangleMesh

_CELL = 0.02
"""Edge of a cell [m]; doubled until there are few enough cells and boxes."""
_BAND = 0.1
"""Height of a band [m]; doubled together with the cell."""
_MAX_CELLS = 40_000
"""Largest number of cells of a band."""
_MAX_BOXES = 250
"""Largest number of boxes of a mesh: plans and paths take as much longer as there are solids."""
_INWARD = 1e-6
"""Shift of faces into the mesh [m]: a face between two bands then lies in the one it bounds."""
_SUBPIXEL = 8
"""Fractional bits of OpenCV's coordinates."""


class OutlineBox(NamedTuple):
    """An upright box: x and y from, to, in the mesh's axes, from ``bottom`` to ``top`` [m]."""

    x: tuple[float, float]
    y: tuple[float, float]
    bottom: float
    top: float


def boxes_around(mesh: TriangleMesh) -> tuple[OutlineBox, ...]:
    """Boxes that contain the mesh, at most a cell (usually 2 cm) and a band (0.1 m) larger."""
    low, high = mesh.bounds
    cell, band = _CELL, _BAND
    while math.prod(np.ceil((high - low)[:2] / cell) + 1.0) > _MAX_CELLS:
        cell, band = 2.0 * cell, 2.0 * band
    while True:
        boxes = tuple(_boxes(mesh, cell, band))
        if len(boxes) <= _MAX_BOXES:
            return boxes
        cell, band = 2.0 * cell, 2.0 * band


def _boxes(mesh: TriangleMesh, cell: float, band: float) -> Iterator[OutlineBox]:
    """The rectangles of each group of equal bands, clipped to the mesh's bounds."""
    low, high = mesh.bounds
    masks = _surface(mesh, cell, band) | _inside(mesh, cell, band)
    first = 0
    for k in range(1, len(masks) + 1):
        if k < len(masks) and np.array_equal(masks[k], masks[first]):
            continue
        bottom, top = low[2] + first * band, min(low[2] + k * band, high[2])
        for row, end_row, column, end_column in _rectangles(masks[first]):
            x = (low[0] + column * cell, min(low[0] + end_column * cell, high[0]))
            y = (low[1] + row * cell, min(low[1] + end_row * cell, high[1]))
            yield OutlineBox(x, y, float(bottom), float(top))
        first = k


def _shape(mesh: TriangleMesh, cell: float, band: float) -> tuple[int, int, int]:
    """Numbers of bands, rows and columns."""
    low, high = mesh.bounds
    columns, rows, bands = (
        max(math.ceil(extent / step - 1e-6), 1)
        for extent, step in zip(high - low, (cell, cell, band), strict=True)
    )
    return bands, rows, columns


def _surface(mesh: TriangleMesh, cell: float, band: float) -> Mask:
    """(bands, rows, columns) whether the mesh's surface touches a cell."""
    low, _ = mesh.bounds
    shape = _shape(mesh, cell, band)
    masks = np.zeros(shape, np.uint8)
    corners = mesh.corners - low
    corners -= _INWARD * _normals(corners)[:, None, :]
    corners /= (cell, cell, band)
    lowest = np.floor(corners[..., 2].min(axis=1) + 1e-9).astype(int).clip(0, shape[0] - 1)
    highest = np.floor(corners[..., 2].max(axis=1) - 1e-9).astype(int).clip(lowest, shape[0] - 1)
    for triangle, first, last in zip(corners, lowest, highest, strict=True):
        for k in range(first, last + 1):
            part = triangle if first == last else _clipped(triangle, float(k), k + 1.0)
            if len(part):
                pixels = np.rint((part[:, :2] - 0.5) * 2**_SUBPIXEL).astype(np.int32)
                cv2.fillConvexPoly(masks[k], pixels, 1, cv2.LINE_8, _SUBPIXEL)
    return masks.astype(np.bool_)


def _clipped(polygon: Array, bottom: float, top: float) -> Array:
    """The part (N, 3) of a convex polygon between two heights."""
    for sign, height in ((1.0, bottom), (-1.0, -top)):
        kept = []
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            over_a, over_b = sign * a[2] - height, sign * b[2] - height
            if over_a >= 0.0:
                kept.append(a)
            if over_a * over_b < 0.0:
                kept.append(a + (b - a) * (over_a / (over_a - over_b)))
        polygon = np.array(kept).reshape(-1, 3)
    return polygon


def _inside(mesh: TriangleMesh, cell: float, band: float) -> Mask:
    """(bands, rows, columns) whether the mesh encloses a cell's centre at half a band's height.

    On a line upwards from there, it leaves the mesh once more often than it enters it.
    """
    low, _ = mesh.bounds
    shape = _shape(mesh, cell, band)
    exits = np.zeros(shape, np.int32)
    corners = (mesh.corners - low) / (cell, cell, band)
    middles = np.arange(shape[0])[:, None, None] + 0.5
    # no centre lies exactly above an edge
    x, y = np.arange(shape[2]) + 0.5 + 1.7e-5, np.arange(shape[1]) + 0.5 + 2.9e-5
    for a, b, c in corners:
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if abs(area) < 1e-12:
            continue
        left, right = np.searchsorted(x, (min(a[0], b[0], c[0]), max(a[0], b[0], c[0])))
        lower, upper = np.searchsorted(y, (min(a[1], b[1], c[1]), max(a[1], b[1], c[1])))
        dx, dy = x[None, left:right] - a[0], y[lower:upper, None] - a[1]
        beta = (dx * (c[1] - a[1]) - dy * (c[0] - a[0])) / area
        gamma = (dy * (b[0] - a[0]) - dx * (b[1] - a[1])) / area
        height = a[2] + beta * (b[2] - a[2]) + gamma * (c[2] - a[2])
        within = (beta >= 0.0) & (gamma >= 0.0) & (beta + gamma <= 1.0)
        above = (within & (height > middles)).astype(np.int32)
        exits[:, lower:upper, left:right] += above if area > 0.0 else -above
    return exits > 0


def _rectangles(mask: Mask) -> Iterator[tuple[int, int, int, int]]:
    """Rectangles (first row, end row, first column, end column) that cover a mask exactly."""
    begun: dict[tuple[int, int], int] = {}
    for row in range(len(mask) + 1):
        runs = set() if row == len(mask) else set(_runs(mask[row]))
        for run in [run for run in begun if run not in runs]:
            yield begun.pop(run), row, *run
        for run in runs:
            begun.setdefault(run, row)


def _runs(row: Mask) -> Iterator[tuple[int, int]]:
    """First and end columns of the occupied runs of a row."""
    steps = np.diff(row.astype(np.int8), prepend=0, append=0)
    ends: npt.NDArray[np.int64] = np.flatnonzero(steps < 0)
    for begin, end in zip(np.flatnonzero(steps > 0), ends, strict=True):
        yield int(begin), int(end)


def _normals(corners: Array) -> Array:
    """Unit normals (M, 3) of triangles; zeros for those without area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit: Array = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return unit
