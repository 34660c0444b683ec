"""Converts a mesh to upright solids: rectangles and circles, each from a bottom to a top.

The mesh is cut at the heights of its corners. The area that it covers between two of them is drawn
on a grid; each connected region becomes the rectangle or circle that it fills, or several
rectangles (``plan_walls``). A closed surface is solid inside, an open one as thin as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from navfw.config.input_file import cached_by_files
from navfw.errors import WorldError
from navfw.meshes.mesh_file import TriangleMesh, windings
from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices
from navfw.sim.furniture_meshes import Up, furniture_mesh
from navfw.sim.plan_walls import wall_rectangles
from navfw.sim.shapes import Circle, Rectangle, Shape

MAX_PARTS = 4000
"""Largest number of solids for one mesh."""

_CELL = 0.02
"""Edge of a cell [m]."""
_CELLS = 600
"""Number of cells along the longer side of a mesh that is too large for cells of that size."""
_TOO_MANY = f"becomes more than {MAX_PARTS} solids; simplify the mesh"
_LAYERS = 32
"""Largest number of layers: a curved surface is cut at evenly spaced heights."""
_WITHIN = (0.1, 0.5, 0.9)
"""Heights of the cuts within a layer, as shares of its height."""
_MIN_THICKNESS = 0.02
"""Smallest size of a solid [m], given to a surface without volume."""
_SAME = 1e-5
"""Distance [m] below which corners are merged."""
_LEVEL = 0.01
"""Smallest difference in height [m] of corners that bound different layers."""
_TOP = 20.0
"""Height [m] above which nothing is kept: worlds end there."""
_BORDER = 4
"""Number of free cells around a region."""
_NEIGHBOURS = np.ones((3, 3), np.uint8)
"""A cell and those around it."""
_FILLED = 0.97
"""Share of its convex hull, or of a hull's rectangle, at which a region counts as filling it."""
_ROUND = 0.93
"""Share of its circle that a round hull covers: that of a polygon of 10 corners."""


@dataclass(frozen=True, slots=True)
class UprightPart:
    """A solid with the outline ``shape`` from ``bottom`` to ``top`` [m].

    In a world it has a ``name``, and the number of the ``mesh`` that it is part of; 0 if of none.
    """

    shape: Shape
    bottom: float
    top: float
    name: str = ""
    mesh: int = 0


@dataclass(frozen=True)
class _SectionGrid:
    """A grid on which sections are drawn; ``origin`` (2,) [m] is the corner of its first cell."""

    origin: Array
    cell: float
    shape: tuple[int, int]

    @classmethod
    def around(cls, points: Array) -> _SectionGrid:
        """Return the grid around points (..., 2) [m]."""
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


@dataclass(slots=True)
class _Layer:
    """What a mesh covers from ``bottom`` to ``top`` [m], and the corners (k, 2) [m] of it."""

    bottom: float
    top: float
    covered: Mask
    corners: Array


@cached_by_files(64)
def furniture_parts(file: str, scale: float, up: Up) -> tuple[UprightPart, ...]:
    """Convert the furniture in a file to upright parts, in its own axes [m].

    Raises:
        ConfigError: the file cannot be used (``furniture_mesh``).
        WorldError: there would be too many.

    """
    mesh = furniture_mesh(file, scale, up)
    base, height = float(mesh.bounds[0][2]), float(np.ptp(mesh.bounds, axis=0)[2])
    stretch = max(1.0, _MIN_THICKNESS / height)  # of a thin board
    parts = mesh_solids((mesh.corners - (0.0, 0.0, base)) * (1.0, 1.0, stretch))
    return tuple(
        replace(part, bottom=base + part.bottom / stretch, top=base + part.top / stretch)
        for part in parts
    )


def mesh_solids(triangles: Array) -> list[UprightPart]:
    """Convert triangles (n, 3, 3) [m] to solids that cover them between the floor, z = 0, and 20 m.

    Outlines are accurate to 2 cm, or to a 600th of the length of a mesh longer than 12 m.

    Raises:
        WorldError: there would be too many.

    """
    surfaces = TriangleMesh.welded(triangles, _SAME).surfaces()
    if not surfaces:
        return []
    grid = _SectionGrid.around(triangles[..., :2])
    parts: list[UprightPart] = []
    for layer in (*_upright_layers(surfaces, grid), *_flat_layers(surfaces, grid)):
        parts += [UprightPart(shape, layer.bottom, layer.top) for shape in _shapes(layer, grid)]
        if len(parts) > MAX_PARTS:
            raise WorldError(_TOO_MANY)
    return parts


def _upright_layers(surfaces: list[TriangleMesh], grid: _SectionGrid) -> list[_Layer]:
    """The layers between corners at different heights; neighbours of one shape are one layer."""
    levels = _levels(np.concatenate([surface.vertices[:, 2] for surface in surfaces]))
    layers: list[_Layer] = []
    for bottom, top in pairwise(levels):
        covered, corners = np.zeros(grid.shape, np.bool_), []
        for share in _WITHIN:
            for surface in surfaces:
                lines = surface.section(bottom + share * (top - bottom))
                corners.append(lines.reshape(-1, 2))
                grid.draw(covered, lines, closed=not surface.open_edges)
        layer = _Layer(bottom, top, covered, np.concatenate(corners))
        if layers and layers[-1].top == bottom and _alike(layers[-1].covered, covered):
            below = layers[-1]
            below.top = top
            below.covered |= covered
            below.corners = np.concatenate([below.corners, layer.corners])
        elif covered.any():
            layers.append(layer)
    return layers


def _levels(heights: Array) -> list[float]:
    """Heights [m] of the bounds of layers above the floor, ascending."""
    bottom, top = max(float(heights.min()), 0.0), min(float(heights.max()), _TOP)
    if top <= bottom:
        return []
    inside = np.unique(heights[(heights > bottom) & (heights < top)])
    levels = [bottom]
    for height in inside.tolist():
        if height - levels[-1] >= _LEVEL and top - height >= _LEVEL:
            levels.append(height)
    levels.append(top)
    return levels if len(levels) <= _LAYERS + 1 else np.linspace(bottom, top, _LAYERS + 1).tolist()


def _flat_layers(surfaces: list[TriangleMesh], grid: _SectionGrid) -> Iterator[_Layer]:
    """Level parts of surfaces without volume, as table tops may be drawn, above the floor."""
    level = [surface.level_triangles for surface in surfaces if surface.open_edges]
    if not level:
        return
    triangles = np.concatenate(level)
    heights = np.round(triangles[:, 0, 2] / _LEVEL) * _LEVEL
    for height in np.unique(heights[(heights > _MIN_THICKNESS) & (heights <= _TOP)]).tolist():
        plane = triangles[heights == height][..., :2]
        yield _Layer(height - _MIN_THICKNESS, height, grid.filled(plane), plane.reshape(-1, 2))


def _alike(one: Mask, other: Mask) -> bool:
    """Whether each covers no cell that is not within a cell of the other."""
    if not (one.any() and other.any()):
        return False
    near_one, near_other = (cv2.dilate(m.astype(np.uint8), _NEIGHBOURS) > 0 for m in (one, other))
    return not (np.any(one & ~near_other) or np.any(other & ~near_one))


def _shapes(layer: _Layer, grid: _SectionGrid) -> Iterator[Shape]:
    """Rectangles and circles that cover what a layer covers."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(layer.covered.astype(np.uint8))
    if len(boxes) > MAX_PARTS:
        raise WorldError(_TOO_MANY)
    region_of = labels[grid.cells(layer.corners)]
    order = np.argsort(region_of, kind="stable")
    begins = np.searchsorted(region_of[order], np.arange(len(boxes) + 1))
    for region in range(1, len(boxes)):  # 0 is what is free
        x, y, width, height = boxes[region, :4].tolist()
        mask = labels[y : y + height, x : x + width] == region
        corners = layer.corners[order[begins[region] : begins[region + 1]]]
        shape = _simple_shape(mask, corners, grid.cell)
        if shape is not None:
            yield shape
        else:
            yield from _rectangles(mask, grid.origin + grid.cell * np.array([x, y]), grid.cell)


def _simple_shape(mask: Mask, corners: Array, cell: float) -> Shape | None:
    """The rectangle or circle that a region with these corners fills; None: it is another."""
    if len(corners) < 2:
        return None
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    hull = cv2.convexHull((corners - middle).astype(np.float32))
    area = cv2.contourArea(hull)
    if np.count_nonzero(mask) * cell * cell < _FILLED * area:
        return None
    (x, y), (long, wide), degrees = cv2.minAreaRect(hull)
    if area >= _FILLED * long * wide:
        half_x, half_y = (0.5 * max(size, _MIN_THICKNESS) for size in (long, wide))
        return Rectangle(middle[0] + x, middle[1] + y, half_x, half_y, np.radians(degrees))
    (x, y), radius = cv2.minEnclosingCircle(hull)
    if area >= _ROUND * np.pi * radius * radius:
        return Circle(middle[0] + x, middle[1] + y, radius)
    return None


def _rectangles(mask: Mask, corner: Array, cell: float) -> Iterator[Rectangle]:
    """Rectangles along the outline of a region whose first cell's corner is at ``corner`` [m]."""
    padded = np.pad(mask, _BORDER)
    height, width = (cell * count for count in padded.shape)
    x, y = (corner - _BORDER * cell).tolist()
    for wall in wall_rectangles(~padded, cell):
        if 0.0 < wall.x < width and 0.0 < wall.y < height:  # others are around the grid
            yield Rectangle(wall.x + x, wall.y + y, wall.half_x, wall.half_y, wall.yaw)
