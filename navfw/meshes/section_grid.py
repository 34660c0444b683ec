"""A grid in the plane on which horizontal sections of a mesh are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices

_CELL = 0.02
"""Edge of a cell [m]."""
_CELLS = 600
"""Cells along the longer side of a mesh that is too large for cells of that size."""
_STEPS = 1024
"""Steps of a coordinate within a cell: the same for equal points, so that outlines are closed."""


@dataclass(frozen=True)
class SectionGrid:
    """A grid in the plane: ``origin`` (2,) [m] is the corner of its first of ``shape`` cells."""

    origin: Array
    cell: float
    shape: tuple[int, int]

    @classmethod
    def around(cls, points: Array) -> SectionGrid:
        """The grid around points (..., 2) [m]."""
        low, high = (f(points.reshape(-1, 2), axis=0) for f in (np.min, np.max))
        cell = max(_CELL, float((high - low).max()) / _CELLS)
        columns, rows = (np.ceil((high - low) / cell).astype(int) + 1).tolist()
        return cls(low, cell, (rows, columns))

    def cells(self, points: Array) -> tuple[Indices, Indices]:
        """Rows and columns (k,) of the cells of points (k, 2) [m]."""
        columns, rows = np.floor((points - self.origin) / self.cell).astype(np.int64).T
        return rows, columns

    def draw(self, covered: Mask, lines: Array, closed: bool) -> None:
        """Add the cells on line segments (k, 2, 2) [m]; if ``closed``, also those inside."""
        if not len(lines):
            return
        rows, columns = self.cells(lines.reshape(-1, 2))
        top, left = rows.min(), columns.min()
        window = covered[top : rows.max() + 1, left : columns.max() + 1]
        canvas = np.zeros(window.shape, np.uint8)
        ends = np.stack([columns - left, rows - top], axis=1).astype(np.int32)
        cv2.polylines(canvas, list(ends.reshape(-1, 2, 2)), False, 1)
        window |= canvas > 0
        if closed:
            corner = self.origin + self.cell * np.array([left, top])
            window |= windings((lines - corner) / self.cell, window.shape) % 2 == 1

    def filled(self, triangles: Array) -> Mask:
        """Cells (rows, columns) of triangles (k, 3, 2) [m]."""
        rows, columns = self.cells(triangles.reshape(-1, 2))
        canvas = np.zeros(self.shape, np.uint8)
        for corners in np.stack([columns, rows], axis=1).astype(np.int32).reshape(-1, 3, 2):
            cv2.fillConvexPoly(canvas, corners, 1)
        return canvas.astype(np.bool_)


def windings(lines: Array, shape: tuple[int, ...]) -> Indices:
    """How often closed outlines go around each cell's centre, counter-clockwise positive.

    Where outlines have no direction, the number is odd inside. ``lines`` (k, 2, 2) are in cells of
    a grid (rows, columns). Coordinates are whole steps, in which a row's centre is crossed by a
    closed outline an even number of times.
    """
    points = np.round(lines * _STEPS).astype(np.int64)
    half = _STEPS // 2
    lower, upper = points[..., 1].min(axis=1), points[..., 1].max(axis=1)
    begin, end = -((half - lower) // _STEPS), -((half - upper) // _STEPS)
    count = end - begin
    line = np.repeat(np.arange(len(lines)), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + begin[line]
    (x0, y0), (x1, y1) = points[line, 0].T, points[line, 1].T
    x = x0 + (row * _STEPS + half - y0) / (y1 - y0) * (x1 - x0)
    column = np.ceil((x - half) / _STEPS).astype(np.int64)
    turns = np.zeros((shape[0], shape[1] + 1), np.int64)
    np.add.at(turns, (row, column), np.where(y1 > y0, -1, 1))
    return np.cumsum(turns, axis=1)[:, :-1]
