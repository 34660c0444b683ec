"""Solids of a world, with shape and height, and its drops: holes in the floor.

Walls are cut into straight pieces between openings, with a lintel above each opening. Physics,
rendering, scene geometry and its checks are all built from these solids. A mesh is several solids
of one name, its upright parts; physics and rendering use its triangles instead.

A drop is a row of treads, each deeper than the one before; a pit has only one tread. Where two
treads, or a tread and the floor, differ in height there is a wall that faces the lower one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from navfw.numerics import Array
from navfw.signals import Pose
from navfw.sim.shapes import OVERLAP_TOLERANCE, Circle, Rectangle, Shape, overlap_depth
from navfw.sim.upright_parts import furniture_parts
from navfw.sim.worldspec import DropSpec, MeshSpec, OpeningSpec, WallSpec, WorldSpec

Kind = Literal["wall", "lintel", "door", "box", "cylinder", "mesh", "drop", "mover"]

_ON_LINE = 0.02
"""Largest distance of an opening's centre from the wall's line [m]: coordinates are rounded."""


@dataclass(frozen=True, slots=True)
class Solid:
    """An upright prism: outline ``shape``, from ``bottom`` to ``top`` [m] above the floor.

    ``front`` is a texture stretched over the two longer sides of a rectangle, or None.
    """

    name: str
    kind: Kind
    shape: Shape
    bottom: float = 0.0
    top: float = 0.0
    texture: str = ""
    front: str | None = None

    @property
    def height(self) -> float:
        """Height [m] from bottom to top."""
        return self.top - self.bottom

    @property
    def centre(self) -> tuple[float, float, float]:
        """Centre (x, y, z) [m]."""
        return self.shape.x, self.shape.y, 0.5 * (self.bottom + self.top)


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight part of a wall's centre line; its ends are extended by these lengths [m]."""

    start: tuple[float, float]
    end: tuple[float, float]
    extend_start: float
    extend_end: float

    @property
    def length(self) -> float:
        """Length of the line [m], without the extensions."""
        return math.dist(self.start, self.end)

    @property
    def yaw(self) -> float:
        """Direction of the line [rad]."""
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    def locate(self, point: tuple[float, float]) -> tuple[float, float]:
        """Return a point's distance along the line and signed distance to its left [m]."""
        return Pose(*self.start, self.yaw).to_local(*point)

    def piece(self, begin: float, end: float, thickness: float) -> Rectangle:
        """Return the wall's rectangle between two distances along the line [m]."""
        x, y = Pose(*self.start, self.yaw).to_parent(0.5 * (begin + end), 0.0)
        return Rectangle(x, y, 0.5 * (end - begin), 0.5 * thickness, self.yaw)


def wall_segments(wall: WallSpec) -> list[Segment]:
    """Return the straight parts of a wall, extended at corners of its line but not at free ends."""
    points = wall.points
    closed = points[0] == points[-1] and len(points) > 2
    last = len(points) - 2
    fill = 0.5 * wall.thickness
    return [
        Segment(start, end, *(fill if closed or inner else 0.0 for inner in (i > 0, i < last)))
        for i, (start, end) in enumerate(pairwise(points))
    ]


def opening_segment(wall: WallSpec, opening: OpeningSpec) -> int | None:
    """Index of the wall's segment that contains the whole opening; None if none does."""
    half = 0.5 * opening.width
    for i, segment in enumerate(wall_segments(wall)):
        along, off = segment.locate(opening.at)
        if abs(off) <= _ON_LINE and half <= along + 1e-9 and along <= segment.length - half + 1e-9:
            return i
    return None


def solids_of(world: WorldSpec) -> list[Solid]:
    """Return every solid of a valid world except the floor, in the order of the file."""
    solids: list[Solid] = []
    gaps: dict[str, tuple[Rectangle, float]] = {}
    for wall in world.walls:
        solids += _wall_solids(wall, gaps)
    for door in world.doors:
        if door.state == "closed":
            shape, height = gaps[door.opening]
            solids.append(Solid(door.name, "door", shape, 0.0, height, door.texture, door.front))
    for box in world.boxes:
        rectangle = Rectangle(*box.at, 0.5 * box.size[0], 0.5 * box.size[1], box.yaw)
        top = box.base + box.size[2]
        solids.append(Solid(box.name, "box", rectangle, box.base, top, box.texture, box.front))
    for cylinder in world.cylinders:
        base, top = cylinder.base, cylinder.base + cylinder.height
        circle = Circle(*cylinder.at, cylinder.radius)
        solids.append(Solid(cylinder.name, "cylinder", circle, base, top, cylinder.texture))
    for mesh in world.meshes:
        solids += _mesh_solids(mesh)
    return solids


def _mesh_solids(mesh: MeshSpec) -> Iterator[Solid]:
    """Yield the upright parts of a mesh in the map."""
    place = Pose(*mesh.at, mesh.yaw)
    for part in furniture_parts(mesh.file, mesh.scale, mesh.up):
        x, y = place.to_parent(part.shape.x, part.shape.y)
        shape = replace(part.shape, x=x, y=y)
        if isinstance(shape, Rectangle):
            shape = replace(shape, yaw=shape.yaw + mesh.yaw)
        low, high = mesh.base + part.bottom, mesh.base + part.top
        yield Solid(mesh.name, "mesh", shape, low, high, mesh.texture)


def _wall_solids(wall: WallSpec, gaps: dict[str, tuple[Rectangle, float]]) -> list[Solid]:
    """Pieces and lintels of one wall; ``gaps`` receives leaf shape and height of each opening."""
    solids: list[Solid] = []
    for i, segment in enumerate(wall_segments(wall)):
        openings = [o for o in wall.openings if opening_segment(wall, o) == i]
        begin = -segment.extend_start
        for opening in sorted(openings, key=lambda o: segment.locate(o.at)[0]):
            along = segment.locate(opening.at)[0]
            left, right = along - 0.5 * opening.width, along + 0.5 * opening.width
            solids += _piece(wall, segment.piece(begin, left, wall.thickness))
            gap = segment.piece(left, right, wall.thickness)
            height = min(opening.height, wall.height)
            # the leaf is thinner than the wall, so that no two faces are coplanar
            leaf = segment.piece(left, right, 0.6 * wall.thickness)
            gaps[opening.name] = (leaf, height)
            if wall.height - height > 0.01:
                solids.append(Solid(wall.name, "lintel", gap, height, wall.height, wall.texture))
            begin = right
        end = segment.length + segment.extend_end
        solids += _piece(wall, segment.piece(begin, end, wall.thickness))
    return solids


def _piece(wall: WallSpec, shape: Rectangle) -> list[Solid]:
    if shape.half_x < 0.005:  # no wall beside an opening at the corner
        return []
    return [Solid(wall.name, "wall", shape, 0.0, wall.height, wall.texture)]


# --- drops ------------------------------------------------------------------------------------

_FALL_DEPTH = 0.02
"""Depth [m] of a support point below the floor at which the robot has fallen."""

_FALL_MARGIN = 0.1
"""Distance [m] around a drop within which a fallen support point counts as in it."""

Corner = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Tread:
    """A level part of a drop: x and y from, to [m] and its depth below the floor [m].

    ``rims`` are the heights [m] (negative: below the floor) of the surfaces next to it: west, east,
    south, north.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    depth: float
    rims: tuple[float, float, float, float]

    @property
    def rectangle(self) -> Rectangle:
        """The tread's outline in the plane."""
        return _rectangle(self.x, self.y)

    def walls(self) -> Iterator[tuple[Corner, Corner, float]]:
        """Yield the vertical faces around it, seen from it: left end, right end, upper edge [m]."""
        (x0, x1), (y0, y1) = self.x, self.y
        sides = (
            ((x0, y0), (x0, y1)),
            ((x1, y1), (x1, y0)),
            ((x1, y0), (x0, y0)),
            ((x0, y1), (x1, y1)),
        )
        for (start, end), rim in zip(sides, self.rims, strict=True):
            if rim > -self.depth:
                yield start, end, rim


def drop_rectangle(drop: DropSpec) -> Rectangle:
    """Return the outline of a drop in the plane."""
    return _rectangle(drop.x, drop.y)


def _rectangle(x: tuple[float, float], y: tuple[float, float]) -> Rectangle:
    half = 0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0])
    return Rectangle(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), *half)


def treads_of(drop: DropSpec) -> list[Tread]:
    """Return the treads of a drop, from the uppermost down."""
    count = max(drop.steps, 1)
    along, across = (drop.x, drop.y) if drop.down in ("east", "west") else (drop.y, drop.x)
    cuts = np.linspace(*along, count + 1).tolist()
    spans = list(pairwise(cuts))
    if drop.down in ("west", "south"):
        spans.reverse()
    treads = []
    for i, span in enumerate(spans):
        upper = -drop.depth * i / count
        lower = -drop.depth * (i + 2) / count if i + 1 < count else 0.0
        ends = (upper, lower) if drop.down in ("east", "north") else (lower, upper)
        depth = drop.depth * (i + 1) / count
        if drop.down in ("east", "west"):
            treads.append(Tread(span, across, depth, (*ends, 0.0, 0.0)))
        else:
            treads.append(Tread(across, span, depth, (0.0, 0.0, *ends)))
    return treads


def floor_pieces(world: WorldSpec) -> list[Rectangle]:
    """Return the floor of a world without its drops, as adjacent rectangles."""
    if not world.drops:
        return [_rectangle(world.x, world.y)]
    edges = sorted({*world.x, *(x for drop in world.drops for x in drop.x)})
    pieces = []
    for span in pairwise(edges):
        middle = 0.5 * (span[0] + span[1])
        holes = sorted(drop.y for drop in world.drops if drop.x[0] < middle < drop.x[1])
        bounds = [world.y[0], *(y for hole in holes for y in hole), world.y[1]]
        pieces += [
            _rectangle(span, (low, high))
            for low, high in zip(bounds[::2], bounds[1::2], strict=True)
            if high - low > 1e-6
        ]
    return pieces


def drop_under(world: WorldSpec, shape: Shape) -> DropSpec | None:
    """Return the drop that overlaps ``shape`` by more than the tolerance; None if there is none."""
    overlapping = (
        drop
        for drop in world.drops
        if overlap_depth(shape, drop_rectangle(drop)) > OVERLAP_TOLERANCE
    )
    return next(overlapping, None)


def fallen_into(world: WorldSpec, points: Array) -> str | None:
    """Return the name of the drop that the robot has fallen into; None while it stands.

    ``points`` (N, 3) [m] are the robot's support points: below wheels and casters.
    """
    for drop in world.drops:
        inside = drop_rectangle(drop).distance(points[:, :2]) < _FALL_MARGIN
        if bool((inside & (points[:, 2] < -_FALL_DEPTH)).any()):
            return drop.name
    return None
