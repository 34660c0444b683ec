"""Meshes of furniture by file, any mesh file or URDF in metres, z up; and their outlines.

The outline is upright boxes, for scene geometry, checks and maps. A mesh is cut into horizontal
bands. In each band the cells of a grid are occupied that its surface touches or whose centre it
encloses, and they are covered by rectangles. Physics and drawing use the triangles themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from navfw.config.input_file import cached_by_files, shown_path
from navfw.errors import ConfigError
from navfw.meshes.mesh_file import MAX_TRIANGLES, TriangleMesh, joined, read_mesh, windings
from navfw.numerics import Array, Mask
from navfw.numerics.products import product
from navfw.robot.urdf import UrdfCollision, attribute_numbers, read_urdf, urdf_error

Up = Literal["y", "z"]

_MIN_SIZE, _MAX_SIZE = 0.02, 50.0
"""Bounds of the largest extent of a mesh [m]."""
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Turns the y axis up."""
_SIDES = 24
"""Sides of a cylinder, and of a sphere's equator."""
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


@cached_by_files(64)
def furniture_mesh(file: str, scale: float, up: Up) -> TriangleMesh:
    """The mesh in a file, or a URDF's collision shapes with all joints at zero, in metres, z up.

    Raises:
        ConfigError: the file cannot be used (see ``read_mesh`` and ``read_urdf``), a URDF has no
            collision shapes or one that cannot be drawn, or the scaled mesh is smaller than 2 cm or
            larger than 50 m.

    """
    path = Path(file)
    mesh = _urdf_mesh(path) if path.suffix.lower() == ".urdf" else read_mesh(path)
    if len(mesh.faces) > MAX_TRIANGLES:
        what = f"has {len(mesh.faces)} triangles, at most {MAX_TRIANGLES}; simplify its meshes"
        raise ConfigError(what, file=shown_path(path))
    size = np.diag([scale, scale, scale, 1.0])
    mesh = mesh.moved(product(_Y_UP, size) if up == "y" else size)
    low, high = mesh.bounds
    extent = float((high - low).max())
    if not _MIN_SIZE <= extent <= _MAX_SIZE:
        what = (
            f"is {extent:g} m large, expected {_MIN_SIZE:g} to {_MAX_SIZE:g} m: give another scale"
        )
        raise ConfigError(f"{what} (0.001 for a file in millimetres)", file=shown_path(path))
    return mesh


@cached_by_files(64)
def furniture_outline(file: str, scale: float, up: Up) -> tuple[OutlineBox, ...]:
    """The boxes around the mesh in a file; raises like ``furniture_mesh``."""
    return boxes_around(furniture_mesh(file, scale, up))


# --- shapes of URDFs --------------------------------------------------------------------------


def _urdf_mesh(path: Path) -> TriangleMesh:
    """The collision shapes of all links in the axes of the root link [m]."""
    model = read_urdf(path)
    if not model.collisions:
        what = "no link has a collision shape; add <collision> elements, which are drawn as well"
        raise ConfigError(what, file=shown_path(path))
    return joined(
        [
            _shape_mesh(path, collision).moved(
                product(model.frame_of(collision.link), collision.frame)
            )
            for collision in model.collisions
        ]
    )


def _shape_mesh(path: Path, collision: UrdfCollision) -> TriangleMesh:
    """The mesh of one <geometry>, around its own origin."""
    shape, size = collision.shape, collision.size
    if size is not None:
        if min(size) <= 0.0:
            key = "size" if shape.tag == "box" else "length" if collision.radius > 0.0 else "radius"
            raise urdf_error(path, shape, f"{key} of <{shape.tag}>: expected positive lengths [m]")
        if shape.tag == "box":
            return _box(size)
        if shape.tag == "cylinder":
            profile = np.array([[0.0, -0.5], [1.0, -0.5], [1.0, 0.5], [0.0, 0.5]])
            return _revolved(profile * (collision.radius, size[2]))
        angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _SIDES // 2 + 1)
        profile = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        profile[[0, -1], 0] = 0.0
        return _revolved(profile * collision.radius)
    if shape.tag == "mesh":
        mesh = read_mesh(path.parent / shape.get("filename", ""))
        scale = attribute_numbers(path, shape, "scale", [1.0, 1.0, 1.0])
        if min(scale) > 0.0:
            return mesh.moved(np.diag([*scale, 1.0]))
        what = "expected positive scales; mirror the mesh in a modelling program"
        raise urdf_error(path, shape, what)
    what = f"expected a box, cylinder, sphere or mesh, got <{shape.tag}>; replace it by one of them"
    raise urdf_error(path, shape, what)


def _box(size: Array) -> TriangleMesh:
    """A box around the origin."""
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners * size, np.array(faces, np.int64))


def _revolved(profile: Array) -> TriangleMesh:
    """The body of a profile (N, 2) of radius and height, upwards, that begins and ends at 0."""
    angles = np.arange(_SIDES) * (2.0 * math.pi / _SIDES)
    rings = [np.stack([r * np.cos(angles), r * np.sin(angles), z + 0.0 * angles], axis=1)
             for r, z in profile[1:-1]]  # fmt: skip
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    side = np.arange(_SIDES)
    following = (side + 1) % _SIDES
    last = _SIDES * (len(rings) - 1)
    south, north = _SIDES * len(rings), _SIDES * len(rings) + 1
    faces = [np.stack([np.full(_SIDES, south), following, side], axis=1)]
    for ring in range(len(rings) - 1):
        a, b = side + _SIDES * ring, following + _SIDES * ring
        faces += [np.stack([a, b, b + _SIDES], axis=1)]
        faces += [np.stack([a, b + _SIDES, a + _SIDES], axis=1)]
    faces += [np.stack([side + last, following + last, np.full(_SIDES, north)], axis=1)]
    return TriangleMesh(np.concatenate([*rings, poles]), np.concatenate(faces).astype(np.int64))


# --- the outline ------------------------------------------------------------------------------


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
