"""Triangle meshes, their surfaces and horizontal sections, and reading of mesh files."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.input_file import read_input, shown_path
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.arrays import Indices
from navfw.numerics.products import product

_LEVEL = 0.999
"""Smallest vertical share of the normal of a triangle that counts as level."""
_STEPS = 1024
"""Steps of a coordinate in a cell: equal points get equal steps, so outlines stay closed."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices (N, 3) [m] and triangles (M, 3), counter-clockwise as seen from outside."""

    vertices: Array
    faces: Indices

    @classmethod
    def welded(cls, corners: Array, tolerance: float = 0.0) -> TriangleMesh:
        """Make the mesh of triangles (M, 3, 3) [m], without those that have no area.

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
        """Corners (M, 3, 3) of the triangles [m]."""
        return self.vertices[self.faces]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest coordinates, each (3,) [m]."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @property
    def normals(self) -> Array:
        """Normals (M, 3) of the triangles; their length is twice the area [m^2]."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a)

    @property
    def level_triangles(self) -> Array:
        """Corners (k, 3, 3) [m] of the triangles that are level."""
        normals = self.normals
        level = np.abs(normals[:, 2]) >= _LEVEL * np.linalg.norm(normals, axis=1)
        chosen: Array = self.corners[level]
        return chosen

    @cached_property
    def open_edges(self) -> int:
        """Number of edges with only one triangle; 0 if the mesh encloses a volume."""
        edges = np.sort(np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=-1), axis=-1)
        numbers = edges[..., 0] * len(self.vertices) + edges[..., 1]
        return int(np.count_nonzero(np.unique(numbers, return_counts=True)[1] % 2))

    def moved(self, transform: Array) -> TriangleMesh:
        """Return the mesh transformed by ``transform`` (4, 4), which may scale, but not mirror."""
        turned = product(self.vertices, transform[:3, :3].T)
        return TriangleMesh(turned + transform[:3, 3], self.faces)

    def surfaces(self) -> list[TriangleMesh]:
        """Return the connected parts of the mesh."""
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
        """Return line segments (k, 2, 2) [m] where the mesh crosses the plane at ``height`` [m].

        Seen from above, the inside of the mesh is on the left of each segment.
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
    """Return all ``meshes`` as one."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])[:-1]
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=True)]
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def windings(lines: Array, shape: tuple[int, ...]) -> Indices:
    """Number of times that closed outlines surround each cell's centre, counter-clockwise positive.

    If outlines have no direction, the number is odd inside. ``lines`` (k, 2, 2) are in cells of a
    grid (rows, columns). Coordinates are rounded to whole steps, so that a closed outline crosses a
    row's centre an even number of times.
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


def solid_mesh(kind: str, size: Sequence[float] | Array) -> TriangleMesh:
    """Make a closed mesh, around the origin, of a shape of URDF or SDF, extent ``size`` (3,) [m].

    A cylinder, cone or capsule is upright; ellipsoids are called so or ``sphere``.
    """
    # a second of computing, which other worlds do not need
    from trimesh import creation

    make: Any = creation
    match kind:
        case "box":
            mesh = make.box(size)
        case "capsule":
            mesh = make.capsule(radius=0.5 * size[0], height=size[2] - size[0])
        case "sphere" | "ellipsoid":
            mesh = make.icosphere(radius=0.5).apply_scale(size)
        case _:
            mesh = getattr(make, kind)(radius=0.5, height=1.0).apply_scale(size)
    return TriangleMesh(np.array(mesh.vertices - mesh.bounds.mean(axis=0)), np.array(mesh.faces))


_FREE_FORM = {"cstype", "curv", "curv2", "surf", "deg"}
"""Keywords of curved surfaces in OBJ files."""
_MAX_COORDINATE = 1e6
"""Largest coordinate, in the file's unit."""


MAX_TRIANGLES = 20_000
"""Largest number of triangles of a mesh that is drawn: each image that shows it draws all."""


def read_mesh(path: Path) -> TriangleMesh:
    """Read the closed mesh in a file, in the file's unit.

    Raises:
        ConfigError: ``read_triangles`` refuses it, or its surface is open or inside out.

    """
    mesh = TriangleMesh.welded(read_triangles(path, MAX_TRIANGLES, convex=True))
    _check_closed(path, mesh)
    return mesh


def read_triangles(path: Path, limit: int, *, convex: bool = False) -> Array:
    """Read the corners (M, 3, 3) of the triangles in a mesh file, in its unit; polygons are split.

    Those of a COLLADA file are converted to metres; its upward axis is ignored.

    Raises:
        ConfigError: the file cannot be read, is of unknown format, damaged, has curved surfaces,
            or more triangles than the ``limit``; or concave faces, if they must be ``convex``.

    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        expected = ", ".join(MESH_SUFFIXES)
        what = f"expected a mesh ({expected}), got {path.name!r}; export the mesh as OBJ"
        raise _error(path, what)
    corners = reader(path, read_input(path), convex)
    if len(corners) > limit:
        what = f"has more than {limit} triangles; simplify it (Blender: Decimate modifier)"
        raise _error(path, what)
    if not len(corners):
        raise _error(path, "has no triangles; export the mesh again")
    if not np.isfinite(corners).all() or np.abs(corners).max() > _MAX_COORDINATE:
        raise _error(path, "has coordinates beyond 1e6; export the mesh again")
    return corners


def _check_closed(path: Path, mesh: TriangleMesh) -> None:
    """Check that every edge has a triangle on either side, all of them facing outwards."""
    a, b = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    count = len(mesh.vertices)
    if not np.array_equal(np.sort(a * count + b), np.sort(b * count + a)):
        if mesh.open_edges:
            what = (
                f"the mesh is open: {mesh.open_edges} edges have a triangle on one side only; close"
            )
            help_ = "its holes in a modelling program, and give sheets a thickness"
        else:
            what = "some faces are turned inside out; make their normals point outwards in a"
            help_ = "modelling program (Blender: Mesh > Normals > Recalculate Outside)"
        raise _error(path, f"{what} {help_}")
    first_corners = mesh.corners[:, 0] - mesh.vertices[0]
    if float(np.einsum("ij,ij->", first_corners, mesh.normals)) <= 0.0:
        what = "the mesh encloses no volume, or its faces are turned inside out; flip its normals"
        raise _error(path, what)


def _error(path: Path, what: str, line: int | None = None) -> ConfigError:
    return ConfigError(what, file=shown_path(path), line=line)


# --- formats ----------------------------------------------------------------------------------


def _by_trimesh(path: Path, content: bytes, convex: bool) -> Array:
    """Whatever trimesh reads by the file's suffix; neither textures nor other files are read."""
    del convex
    # a second of computing, which OBJ files do not need
    import trimesh
    from trimesh.units import unit_conversion

    kind = path.suffix[1:].lower()
    try:
        options = {"skip_materials": True, "process": False}
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=kind, **options)
        unit = unit_conversion(mesh.units, "meters") if mesh.units else 1.0
        return np.asarray(getattr(mesh, "triangles", ()), dtype=float).reshape(-1, 3, 3) * unit
    except Exception as error:  # whatever parsers of foreign files raise
        reason = f"{type(error).__name__}: {error}; export the mesh again"
        raise _error(path, f"cannot be read as {kind.upper()}: {reason}") from None


def _obj(path: Path, content: bytes, convex: bool) -> Array:
    points: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    polygons: list[tuple[int, int, int]] = []  # line, first and one past the last triangle
    for line, text in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
        keyword, *values = text.partition("#")[0].lower().split() or [""]
        if keyword == "v":
            points.append(_position(path, line, values))
        elif keyword == "f":
            ring = list(_ring(path, line, values, len(points)))
            first = len(triangles)
            triangles += [(ring[0], b, c) for b, c in pairwise(ring[1:])]
            polygons.append((line, first, len(triangles)))
        elif keyword in _FREE_FORM:
            raise _error(path, "curved surfaces are not supported; export triangles", line)
    mesh = TriangleMesh(np.array(points).reshape(-1, 3), np.array(triangles, int).reshape(-1, 3))
    normals = mesh.normals
    for line, first, end in polygons if convex else ():
        of_polygon = normals[first:end]
        if end - first > 1 and (product(of_polygon, of_polygon.sum(axis=0)) < 0.0).any():
            raise _error(path, "the face is concave; triangulate the mesh when exporting it", line)
    return mesh.corners


_READERS: dict[str, Callable[[Path, bytes, bool], Array]] = {
    ".dae": _by_trimesh,
    ".obj": _obj,
    ".stl": _by_trimesh,
}
MESH_SUFFIXES = tuple(_READERS)
"""Suffixes of the mesh files that can be read."""


def _position(path: Path, line: int, values: list[str]) -> list[float]:
    try:
        position = [float(value) for value in values[:3]]
    except ValueError:
        position = []
    if len(position) != 3 or not all(math.isfinite(value) for value in position):
        got = " ".join(values)[:40]
        what = f"expected the x, y and z of a vertex, got {got!r}; export the mesh again"
        raise _error(path, what, line)
    return position


def _ring(path: Path, line: int, values: list[str], count: int) -> Iterator[int]:
    """Indices of a face's vertices; negative ones count from the last of ``count`` vertices."""
    for value in values:
        try:
            index = int(value.split("/", 1)[0])
        except ValueError:
            index = 0
        if not 0 < abs(index) <= count:
            what = f"expected the number of a vertex from 1 to {count}, got {value[:40]!r}"
            raise _error(path, f"{what}; export it again", line)
        yield index - 1 if index > 0 else count + index
    if len(values) < 3:
        what = f"a face has at least 3 vertices, got {len(values)}; export the mesh again"
        raise _error(path, what, line)
