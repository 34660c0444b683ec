"""Horizontal sections of a triangle mesh, drawn on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from navfw.numerics.arrays import Indices
from navfw.signals import Array, Mask

_CELL = 0.02
"""Edge of a cell [m]."""
_CELLS = 600
"""Cells along the longer side of a mesh that is too large for cells of that size."""
_SAME = 1e-5
"""Corners nearer than this [m] are one."""
_LEVEL = 0.999
"""Least share of a level triangle's normal that is upright."""
_STEPS = 1024
"""Steps of a coordinate within a cell: the same for equal points, so that outlines are closed."""


@dataclass(frozen=True)
class MeshSurface:
    """A connected part of a mesh: ``corners`` (m, 3) [m] and ``faces`` (n, 3), their indices.

    ``closed`` when each edge belongs to two triangles, or four: it then encloses a volume.
    """

    corners: Array
    faces: Indices
    closed: bool

    @property
    def heights(self) -> Array:
        """(m,) heights of the corners [m]."""
        heights: Array = self.corners[:, 2]
        return heights

    def section(self, height: float) -> Array:
        """Line segments (k, 2, 2) [m] where the surface crosses the plane at ``height`` [m]."""
        above = self.heights[self.faces] > height
        count = above.sum(axis=1)
        crossing = (count == 1) | (count == 2)
        faces, above, count = self.faces[crossing], above[crossing], count[crossing]
        alone = np.where(count == 1, above.argmax(axis=1), above.argmin(axis=1))
        first = faces[np.arange(len(faces)), alone]
        others = [faces[np.arange(len(faces)), (alone + turn) % 3] for turn in (1, 2)]
        return np.stack([self._cut(first, other, height) for other in others], axis=1)

    def _cut(self, one: Indices, other: Indices, height: float) -> Array:
        """Points (k, 2) of edges at ``height``: the same for both triangles of an edge."""
        low, high = np.minimum(one, other), np.maximum(one, other)
        start, end = self.corners[low], self.corners[high]
        share = (height - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
        points: Array = start[:, :2] + share * (end - start)[:, :2]
        return points

    def level_triangles(self) -> Array:
        """(k, 3, 3) corners [m] of the level triangles."""
        triangles: Array = self.corners[self.faces]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        level = np.abs(normals[:, 2]) >= _LEVEL * np.linalg.norm(normals, axis=1)
        chosen: Array = triangles[level]
        return chosen


def surfaces_of(triangles: Array) -> list[MeshSurface]:
    """The connected parts of triangles (n, 3, 3) [m]; triangles without area are left out."""
    points = np.round(triangles.reshape(-1, 3) / _SAME).astype(np.int64)
    unique, first, index = np.unique(points, axis=0, return_index=True, return_inverse=True)
    corners = triangles.reshape(-1, 3)[first]
    faces = index.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        return []
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(unique), len(unique)))
    part = connected_components(links, directed=False)[1][faces[:, 0]]
    order = np.argsort(part, kind="stable")
    groups = np.split(faces[order], np.nonzero(np.diff(part[order]))[0] + 1)
    return [_surface(corners, group) for group in groups]


def _surface(corners: Array, faces: Indices) -> MeshSurface:
    edges = np.sort(np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]]), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    used, renumbered = np.unique(faces, return_inverse=True)
    return MeshSurface(corners[used], renumbered.reshape(-1, 3), bool(np.all(counts % 2 == 0)))


@dataclass(frozen=True)
class PlanGrid:
    """A grid in the plane: ``origin`` (2,) [m] is the corner of its first of ``shape`` cells."""

    origin: Array
    cell: float
    shape: tuple[int, int]

    @classmethod
    def around(cls, points: Array) -> PlanGrid:
        """The grid around points (..., 2) [m]."""
        low, high = (f(points.reshape(-1, 2), axis=0) for f in (np.min, np.max))
        cell = max(_CELL, float((high - low).max()) / _CELLS)
        columns, rows = (np.ceil((high - low) / cell).astype(int) + 1).tolist()
        return cls(low, cell, (rows, columns))

    def empty(self) -> Mask:
        """A mask (rows, columns) without any cell."""
        return np.zeros(self.shape, dtype=np.bool_)

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
            window |= _inside((lines - corner) / self.cell, window.shape)

    def filled(self, triangles: Array) -> Mask:
        """Cells of triangles (k, 3, 2) [m]."""
        rows, columns = self.cells(triangles.reshape(-1, 2))
        canvas = np.zeros(self.shape, np.uint8)
        for corners in np.stack([columns, rows], axis=1).astype(np.int32).reshape(-1, 3, 2):
            cv2.fillConvexPoly(canvas, corners, 1)
        filled: Mask = canvas > 0
        return filled


def _inside(lines: Array, shape: tuple[int, ...]) -> Mask:
    """Cells whose centres are inside of closed outlines, by the number of lines left of them.

    ``lines`` (k, 2, 2) are in cells. Coordinates are whole steps, in which a row's centre is
    crossed by a closed outline an even number of times.
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
    crossed = np.zeros((shape[0], shape[1] + 1), np.int32)
    np.add.at(crossed, (row, column), 1)
    inside: Mask = np.cumsum(crossed, axis=1)[:, :-1] % 2 == 1
    return inside
