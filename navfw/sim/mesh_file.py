"""Closed triangle meshes from OBJ and STL files, of bounded size; what cannot be drawn is refused.

Positions and faces alone are read: no materials, colours, normals or texture coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from navfw.config.input_file import read_input, shown_path
from navfw.errors import ConfigError
from navfw.numerics.arrays import Indices
from navfw.numerics.products import product
from navfw.signals import Array

MAX_TRIANGLES = 20_000
"""Largest number of triangles of a mesh: each image that shows it draws them all."""
_MESH_SUFFIXES = (".obj", ".stl")
"""Suffixes of mesh files."""
_MAX_BYTES = 10_000_000
"""Largest size of a mesh file [byte]."""
_FREE_FORM = {"cstype", "curv", "curv2", "surf", "deg"}
"""Keywords of curved surfaces in OBJ files."""
_STL_HEADER, _STL_RECORD = 84, 50
"""Bytes of a binary STL file before its triangles, and of each of them."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices (N, 3) [m] and triangles (M, 3), counter-clockwise as seen from outside."""

    vertices: Array
    faces: Indices

    @property
    def corners(self) -> Array:
        """(M, 3, 3) corners of the triangles [m]."""
        corners: Array = self.vertices[self.faces]
        return corners

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest coordinates (3,) [m]."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def moved(self, transform: Array) -> TriangleMesh:
        """The mesh in other axes; ``transform`` (4, 4) may scale, but not mirror."""
        turned = product(self.vertices, transform[:3, :3].T)
        return TriangleMesh(turned + transform[:3, 3], self.faces)


def joined(meshes: list[TriangleMesh]) -> TriangleMesh:
    """All ``meshes`` as one."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])[:-1]
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=True)]
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def read_mesh(path: Path) -> TriangleMesh:
    """The closed mesh in an OBJ or STL file, in the file's unit.

    Raises:
        ConfigError: the file cannot be read, is too large, damaged, has curved or concave faces or
            more than ``MAX_TRIANGLES``, or its surface is open or turned inside out.

    """
    suffix = path.suffix.lower()
    if suffix not in _MESH_SUFFIXES:
        what = f"expected an OBJ or STL file, got {path.name!r}; export the mesh as OBJ"
        raise ConfigError(what, file=shown_path(path))
    content = read_input(path, _MAX_BYTES)
    corners = _obj_triangles(path, content) if suffix == ".obj" else _stl_triangles(path, content)
    if not len(corners):
        raise ConfigError("has no triangles; export the mesh again", file=shown_path(path))
    if not np.isfinite(corners).all() or np.abs(corners).max() > 1e6:
        raise ConfigError("has coordinates beyond 1e6", file=shown_path(path))
    # adding 0.0 makes -0.0 equal to 0.0
    vertices, inverse = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 3).astype(np.int64)
    a, b, c = faces.T
    mesh = TriangleMesh(vertices, faces[(a != b) & (b != c) & (c != a)])
    _check_closed(path, mesh)
    return mesh


def _check_closed(path: Path, mesh: TriangleMesh) -> None:
    """Check that every edge has a triangle on either side, all of them facing outwards."""
    a, b = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    count = len(mesh.vertices)
    forward, backward = np.sort(a * count + b), np.sort(b * count + a)
    if not np.array_equal(forward, backward):
        _, uses = np.unique(np.minimum(a, b) * count + np.maximum(a, b), return_counts=True)
        if bordering := int(np.count_nonzero(uses % 2)):
            what = (
                f"the mesh is open: {bordering} edges have a triangle on one side only; close its"
            )
            help_ = "holes in a modelling program, and give sheets a thickness"
        else:
            what = "some faces are turned inside out; make their normals point outwards in a"
            help_ = "modelling program (Blender: Mesh > Normals > Recalculate Outside)"
        raise ConfigError(f"{what} {help_}", file=shown_path(path))
    p, q, r = (mesh.corners[:, k] - mesh.vertices[0] for k in range(3))
    if float(np.einsum("ij,ij->", p, np.cross(q, r))) <= 0.0:
        what = "the mesh encloses no volume, or its faces are turned inside out; flip its normals"
        raise ConfigError(what, file=shown_path(path))


def _too_many(path: Path) -> ConfigError:
    what = f"has more than {MAX_TRIANGLES} triangles; simplify it (Blender: Decimate modifier)"
    return ConfigError(what, file=shown_path(path))


# --- OBJ --------------------------------------------------------------------------------------


def _obj_triangles(path: Path, content: bytes) -> Array:
    """(M, 3, 3) corners of an OBJ file's triangles; polygons are divided."""
    points: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    polygons: list[tuple[int, int, int]] = []  # line, first and one past the last triangle
    for number, text in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
        keyword, *values = text.split("#", 1)[0].split() or [""]
        if keyword == "v":
            points.append(_position(path, number, values))
        elif keyword == "f":
            ring = list(_ring(path, number, values, len(points)))
            first = len(triangles)
            triangles += [(ring[0], b, c) for b, c in pairwise(ring[1:])]
            polygons.append((number, first, len(triangles)))
            if len(triangles) > MAX_TRIANGLES:
                raise _too_many(path)
        elif keyword in _FREE_FORM:
            what = "curved surfaces are not supported; export triangles"
            raise ConfigError(what, file=shown_path(path), line=number)
    corners = np.array(points).reshape(-1, 3)[np.array(triangles, np.int64).reshape(-1, 3)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for number, first, end in polygons:
        parts = normals[first:end]
        if len(parts) > 1 and (product(parts, parts.sum(axis=0)) < 0.0).any():
            what = "the face is concave; triangulate the mesh when exporting it"
            raise ConfigError(what, file=shown_path(path), line=number)
    return corners


def _position(path: Path, number: int, values: list[str]) -> list[float]:
    try:
        position = [float(value) for value in values[:3]]
    except ValueError:
        position = []
    if len(position) != 3 or not all(math.isfinite(value) for value in position):
        got = " ".join(values)[:40]
        what = f"expected the x, y and z of a vertex, got {got!r}; export the mesh again"
        raise ConfigError(what, file=shown_path(path), line=number)
    return position


def _ring(path: Path, number: int, values: list[str], count: int) -> Iterator[int]:
    """Indices of a face's vertices; negative ones count from the last of ``count`` vertices."""
    for value in values:
        try:
            index = int(value.split("/", 1)[0])
        except ValueError:
            index = 0
        if not 0 < abs(index) <= count:
            what = f"expected the number of a vertex from 1 to {count}, got {value[:40]!r}"
            raise ConfigError(f"{what}; export it again", file=shown_path(path), line=number)
        yield index - 1 if index > 0 else count + index
    if len(values) < 3:
        what = f"a face has at least 3 vertices, got {len(values)}; export the mesh again"
        raise ConfigError(what, file=shown_path(path), line=number)


# --- STL --------------------------------------------------------------------------------------


def _stl_triangles(path: Path, content: bytes) -> Array:
    """(M, 3, 3) corners of a binary or ASCII STL file's triangles."""
    if len(content) >= _STL_HEADER:
        count = int.from_bytes(content[80:_STL_HEADER], "little")
        if len(content) == _STL_HEADER + _STL_RECORD * count:
            if count > MAX_TRIANGLES:
                raise _too_many(path)
            kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
            records = np.frombuffer(content, kind, count, _STL_HEADER)
            binary: Array = records["corners"].astype(np.float64)
            return binary
    if not content.lstrip().startswith(b"solid"):
        what = "is no STL file, or a part of it is missing; export the mesh again"
        raise ConfigError(what, file=shown_path(path))
    positions = []
    for number, text in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
        keyword, *values = text.split() or [""]
        if keyword == "vertex":
            positions.append(_position(path, number, values))
    if len(positions) > 3 * MAX_TRIANGLES:
        raise _too_many(path)
    if len(positions) % 3:
        what = "its last triangle is incomplete; export the mesh again"
        raise ConfigError(what, file=shown_path(path))
    return np.array(positions).reshape(-1, 3, 3)
