"""The outline of a mesh as upright boxes, for scene geometry, checks and maps.

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

from navfw.meshes.section_grid import windings
from navfw.meshes.triangle_mesh import TriangleMesh
from navfw.numerics import Array, Mask

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
    steps = np.array([cell, cell, band])
    columns, rows, bands = np.maximum(np.ceil((high - low) / steps - 1e-6).astype(int), 1).tolist()
    masks = _surface(mesh, steps, (bands, rows, columns))
    for k in range(bands):
        lines = mesh.section(float(low[2] + band * (k + 0.5))) - low[:2]
        masks[k] |= windings(lines / cell, (rows, columns)) > 0
    first = 0
    for k in range(1, bands + 1):
        if k < bands and np.array_equal(masks[k], masks[first]):
            continue
        bottom, top = low[2] + first * band, min(low[2] + k * band, high[2])
        for row, end_row, column, end_column in _rectangles(masks[first]):
            x = (low[0] + column * cell, min(low[0] + end_column * cell, high[0]))
            y = (low[1] + row * cell, min(low[1] + end_row * cell, high[1]))
            yield OutlineBox(x, y, float(bottom), float(top))
        first = k


def _surface(mesh: TriangleMesh, steps: Array, shape: tuple[int, int, int]) -> Mask:
    """(bands, rows, columns) of ``shape``: whether the surface touches a cell of ``steps`` [m]."""
    masks = np.zeros(shape, np.uint8)
    normals = mesh.normals
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    corners = (mesh.corners - mesh.bounds[0] - _INWARD * normals[:, None, :]) / steps
    lowest = np.floor(corners[..., 2].min(axis=1) + 1e-9).astype(int).clip(0, shape[0] - 1)
    highest = np.floor(corners[..., 2].max(axis=1) - 1e-9).astype(int).clip(lowest, shape[0] - 1)
    for triangle, first, last in zip(corners, lowest, highest, strict=True):
        for k in range(first, last + 1):
            polygon = triangle if first == last else _clipped(triangle, float(k), k + 1.0)
            if len(polygon):
                pixels = np.rint((polygon[:, :2] - 0.5) * 2**_SUBPIXEL).astype(np.int32)
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
