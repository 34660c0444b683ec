"""A mesh of triangles: its surfaces, whether they are closed, and horizontal sections."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navfw.numerics import Array
from navfw.numerics.arrays import Indices
from navfw.numerics.products import product

_LEVEL = 0.999
"""Least share of a level triangle's normal that is upright."""
_STEPS = 1024
"""Steps of a coordinate within a cell: the same for equal points, so that outlines are closed."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices (N, 3) [m] and triangles (M, 3), counter-clockwise as seen from outside."""

    vertices: Array
    faces: Indices

    @classmethod
    def welded(cls, corners: Array, tolerance: float = 0.0) -> TriangleMesh:
        """The mesh of triangles (M, 3, 3) [m]; those without area are left out.

        Corners that are equal in steps of ``tolerance`` [m] become one vertex.
        """
        points = corners.reshape(-1, 3) + 0.0  # makes -0.0 equal to 0.0
        keys = np.round(points / tolerance) + 0.0 if tolerance else points
        _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        faces = index.reshape(-1, 3).astype(np.int64)
        a, b, c = faces.T
        return cls(points[first], faces[(a != b) & (b != c) & (c != a)])

    @property
    def corners(self) -> Array:
        """(M, 3, 3) corners of the triangles [m]."""
        return self.vertices[self.faces]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest coordinates (3,) [m]."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @property
    def normals(self) -> Array:
        """(M, 3) normals of the triangles, twice as long [m^2] as their area."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a)

    @property
    def level_triangles(self) -> Array:
        """(k, 3, 3) corners [m] of the level triangles."""
        normals = self.normals
        level = np.abs(normals[:, 2]) >= _LEVEL * np.linalg.norm(normals, axis=1)
        chosen: Array = self.corners[level]
        return chosen

    @cached_property
    def open_edges(self) -> int:
        """Number of edges with a triangle on one side only; 0: the mesh encloses a volume."""
        edges = np.sort(np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=-1), axis=-1)
        numbers = edges[..., 0] * len(self.vertices) + edges[..., 1]
        return int(np.count_nonzero(np.unique(numbers, return_counts=True)[1] % 2))

    def moved(self, transform: Array) -> TriangleMesh:
        """The mesh in other axes; ``transform`` (4, 4) may scale, but not mirror."""
        turned = product(self.vertices, transform[:3, :3].T)
        return TriangleMesh(turned + transform[:3, 3], self.faces)

    def surfaces(self) -> list[TriangleMesh]:
        """The connected parts."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        if not len(self.faces):
            return []
        edges = np.concatenate([self.faces[:, :2], self.faces[:, 1:]])
        links = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(self.vertices),) * 2)
        surface = connected_components(links, directed=False)[1][self.faces[:, 0]]
        order = np.argsort(surface, kind="stable")
        groups = np.split(self.faces[order], np.nonzero(np.diff(surface[order]))[0] + 1)
        used = (np.unique(group, return_inverse=True) for group in groups)
        return [TriangleMesh(self.vertices[u], faces.reshape(-1, 3)) for u, faces in used]

    def section(self, height: float) -> Array:
        """Line segments (k, 2, 2) [m] where the mesh crosses the plane at ``height`` [m].

        Seen from above, what the mesh encloses is on the left of each.
        """
        above = self.vertices[self.faces, 2] > height
        count = above.sum(axis=1)
        crossing = (count == 1) | (count == 2)
        faces, above, count = self.faces[crossing], above[crossing], count[crossing]
        row = np.arange(len(faces))
        alone = np.where(count == 1, above.argmax(axis=1), above.argmin(axis=1))
        # the line enters by the edge after the lower corner that stands alone, else leaves by it
        turns = (np.where(count == 1, turn, 3 - turn) for turn in (1, 2))
        ends = [self._cut(faces[row, alone], faces[row, (alone + t) % 3], height) for t in turns]
        return np.stack(ends, axis=1)

    def _cut(self, one: Indices, other: Indices, height: float) -> Array:
        """Points (k, 2) of edges at ``height``: the same for both triangles of an edge."""
        low, high = np.minimum(one, other), np.maximum(one, other)
        start, end = self.vertices[low], self.vertices[high]
        share = (height - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
        return start[:, :2] + share * (end - start)[:, :2]


def joined(meshes: list[TriangleMesh]) -> TriangleMesh:
    """All ``meshes`` as one."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])[:-1]
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=True)]
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


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
