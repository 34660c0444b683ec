"""Surfaces of a world as textured patches, and their grouping into parts of one light.

Walls may have skirting boards and door frames; landmarks are plates on walls.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from navfw.features.landmark_appearance import plate_side
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.signals import Pose
from navfw.sim import solids, worldspec
from navfw.sim.shapes import Rectangle
from navfw.sim.textured_mesh import (
    Span,
    TexturedMesh,
    box_mesh,
    cylinder_mesh,
    side_count,
    split_positions,
)

STRETCHED = "stretched "
"""Prefix of the name of a texture that is stretched over each patch."""
_STAND_OFF = 0.006
"""Distance of a plate from its wall [m]: more than that of the textureless cover of a wall."""


def plate_mesh(mark: worldspec.LandmarkPlateSpec) -> TexturedMesh:
    """Return the plate of ``mark`` as a mesh in ``map``, its image upright from the front."""
    right, normal = plate_axes(mark)
    half = 0.5 * plate_side(mark.kind, mark.size)
    middle = np.array([*mark.at, mark.z]) + _STAND_OFF * normal
    across, up = half * right, np.array([0.0, 0.0, half])
    corners = [middle + i * across + j * up for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return TexturedMesh(
        vertices=[corner.tolist() for corner in corners],
        normals=[normal.tolist()] * 4,
        indices=[0, 1, 2, 0, 2, 3],
    ).stretched()


def plate_axes(mark: worldspec.LandmarkPlateSpec) -> tuple[Array, Array]:
    """Unit vectors (3,) in ``map``: to the image's right as seen from in front, and the normal."""
    c, s = math.cos(mark.yaw), math.sin(mark.yaw)
    return np.array([-s, c, 0.0]), np.array([c, s, 0.0])


_PROUD = 0.01
"""Distance [m] by which door frames project from the faces of their wall."""
_REVEAL = 0.005
"""Distance [m] by which door frames reach into the opening, so that no two faces are coplanar."""
_MAX_PARTS = 320
"""Largest number of parts, each of which is lit by the solids near it."""
_GROUPINGS = (
    *((by_plane, edge) for by_plane in (True, False) for edge in (4.0, 8.0, 16.0)),
    (False, math.inf),
)
"""Whether patches are grouped by plane, and the edge [m] of the squares that group them, from many
parts to few: the first one with few enough parts is used."""
_NARROW = 0.4
"""Faces narrower than this [m] are grouped with others regardless of their plane."""
_FLOOR_PATCH = 1.0
"""Largest edge of a patch of the floor [m]: large ones near the camera are slow to draw."""
_NO_SHIFT = np.zeros(2)

Plane = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class SurfacePatch:
    """A piece of a surface with one texture; a flat one has a ``plane`` (normal, offset)."""

    texture: str
    mesh: TexturedMesh
    plane: Plane | None = None


# --- floor, drops and walls -------------------------------------------------------------------


def floor_patches(world: worldspec.WorldSpec) -> Iterator[SurfacePatch]:
    """Yield floor and ceiling; no patch crosses the edge of a room or of a drop."""
    ex, ey, ez = np.eye(3)
    corner = np.array([world.x[0], world.y[0], 0.0])
    height = max([wall.height for wall in world.walls], default=2.4)
    # each (x, y): from, to
    areas = [(room.x, room.y) for room in world.rooms]
    areas += [(drop.x, drop.y) for drop in world.drops]
    all_columns = split_positions(
        world.x[1] - corner[0], [x - corner[0] for area in areas for x in area[0]], _FLOOR_PATCH
    )
    all_rows = split_positions(
        world.y[1] - corner[1], [y - corner[1] for area in areas for y in area[1]], _FLOOR_PATCH
    )
    for columns, rows in itertools.product(pairwise(all_columns), pairwise(all_rows)):
        x, y = corner[0] + 0.5 * sum(columns), corner[1] + 0.5 * sum(rows)
        room = _room_at(world, x, y)
        floor = (room and room.floor) or world.floor
        if not any(d.x[0] < x < d.x[1] and d.y[0] < y < d.y[1] for d in world.drops):
            yield _patch(floor, corner, ex, ey, columns, rows)
        ceiling = (room and room.ceiling) or world.ceiling
        if ceiling is not None:
            yield _patch(ceiling, corner + height * ez, ey, ex, rows, columns)


def drop_patches(world: worldspec.WorldSpec) -> Iterator[SurfacePatch]:
    """Yield treads, sides and risers of the drops."""
    for drop in world.drops:
        for tread in solids.treads_of(drop):
            yield from _tread_patches(tread, drop.texture, drop.walls)


def wall_patches(world: worldspec.WorldSpec, wall: solids.Solid) -> Iterator[SurfacePatch]:
    """Yield the faces of one wall piece, each with the texture of the room in front of it."""
    assert isinstance(wall.shape, Rectangle)  # noqa: S101 - walls and lintels are
    corners = wall.shape.corners
    ez = np.array([0.0, 0.0, 1.0])
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = math.dist(start, end)
        right = np.array([*(end - start) / length, 0.0])
        outward = np.array([right[1], -right[0]])
        corner = np.array([*start, wall.bottom])
        columns = split_positions(length, _room_edges(world, start, right[:2]))
        skirting = world.skirting if wall.kind == "wall" else None
        rows = split_positions(wall.height, [skirting.height] if skirting else [])
        for stretch in pairwise(columns):
            along = 0.5 * sum(stretch)
            room = _room_at(world, *(start + along * right[:2] + 0.02 * outward))
            texture = (room and room.walls) or wall.texture
            for level in pairwise(rows):
                board = skirting.texture if skirting and level[1] <= skirting.height else None
                yield _patch(board or texture, corner, right, ez, stretch, level)
    # top of a wall, and the underside of a lintel
    a, b, _, d = corners
    along, across = math.dist(a, b), math.dist(a, d)
    ex, ey = np.array([*(b - a) / along, 0.0]), np.array([*(d - a) / across, 0.0])
    columns, rows = split_positions(along), split_positions(across)
    yield from _patches(wall.texture, np.array([*a, wall.top]), ex, ey, columns, rows)
    if wall.bottom > 0.0:
        texture = wall.texture if world.door_frames is None else world.door_frames.texture
        yield from _patches(texture, np.array([*a, wall.bottom]), ey, ex, rows, columns)
    if wall.kind == "lintel" and world.door_frames is not None:
        yield from _frame_patches(world.door_frames, wall)


def _frame_patches(frame: worldspec.DoorFrameSpec, lintel: solids.Solid) -> Iterator[SurfacePatch]:
    """Yield the posts and the head of the frame of the opening below a lintel."""
    gap, width = lintel.shape, frame.width
    assert isinstance(gap, Rectangle)  # noqa: S101 - lintels are
    deep = 2.0 * (gap.half_y + _PROUD)
    beside, above = gap.half_x + 0.5 * width - _REVEAL, lintel.bottom + width
    posts = [(side * beside, (width, deep, above), 0.5 * above) for side in (-1.0, 1.0)]
    head = 0.0, (2.0 * gap.half_x, deep, width), lintel.bottom + 0.5 * width
    for along, size, middle in (*posts, head):
        x, y = Pose(gap.x, gap.y, gap.yaw).to_parent(along, 0.0)
        mesh = box_mesh(size, _NO_SHIFT).placed((x, y, middle), gap.yaw)
        yield SurfacePatch(frame.texture, mesh)


def _room_edges(world: worldspec.WorldSpec, start: Array, right: Array) -> list[float]:
    """Distances [m] along a wall's face at which edges of rooms intersect it."""
    cuts = []
    for room in world.rooms:
        for axis, edges in enumerate((room.x, room.y)):
            if abs(right[axis]) > 0.1:
                cuts += [float((edge - start[axis]) / right[axis]) for edge in edges]
    return cuts


def _room_at(world: worldspec.WorldSpec, x: float, y: float) -> worldspec.RoomSpec | None:
    for room in world.rooms:
        if room.x[0] <= x <= room.x[1] and room.y[0] <= y <= room.y[1]:
            return room
    return None


def _tread_patches(tread: solids.Tread, texture: str, walls: str) -> Iterator[SurfacePatch]:
    ex, ey, ez = np.eye(3)
    corner = np.array([tread.x[0], tread.y[0], -tread.depth])
    columns, rows = (
        split_positions(high - low, longest=_FLOOR_PATCH) for low, high in (tread.x, tread.y)
    )
    yield from _patches(texture, corner, ex, ey, columns, rows)
    for left, right, top in tread.walls():
        length = math.dist(left, right)
        along = np.array([right[0] - left[0], right[1] - left[1], 0.0]) / length
        corner = np.array([*left, -tread.depth])
        columns, rows = split_positions(length), split_positions(top + tread.depth)
        yield from _patches(walls, corner, along, ez, columns, rows)


def _patches(
    texture: str, corner: Array, right: Array, up: Array, columns: Array, rows: Array
) -> Iterator[SurfacePatch]:
    """Yield a face, split at all ``columns`` and ``rows`` [m]."""
    for across, above in itertools.product(pairwise(columns), pairwise(rows)):
        yield _patch(texture, corner, right, up, across, above)


def _patch(
    texture: str, corner: Array, right: Array, up: Array, columns: Span, rows: Span
) -> SurfacePatch:
    mesh = TexturedMesh()
    mesh.add_patch(corner, right, up, columns, rows, _NO_SHIFT)
    x, y, z = (float(n) for n in np.cross(right, up))
    return SurfacePatch(texture, mesh, (x, y, z, float(product((x, y, z), corner))))


# --- boxes and cylinders ----------------------------------------------------------------------


def solid_patches(solid: solids.Solid) -> Iterator[SurfacePatch]:
    """Yield a box or cylinder as one patch, and its front, if it has one, as another."""
    for front in (False, True) if solid.front else (False,):
        mesh = solid_mesh(solid, front=front).placed(solid.centre, solid.shape.yaw)
        yield SurfacePatch(f"{STRETCHED}{solid.front}" if front else solid.texture, mesh)


@lru_cache(maxsize=1024)
def solid_mesh(solid: solids.Solid, margin: float = 0.0, front: bool | None = None) -> TexturedMesh:
    """Return the mesh of a solid around its own centre, enlarged by ``margin`` [m] on all sides.

    ``front`` True gives only its front, False all but the front, None everything.
    """
    height, shape, shift = solid.height + 2.0 * margin, solid.shape, texture_shift(solid.name)
    if not isinstance(shape, Rectangle):
        return cylinder_mesh(shape.radius + margin, height, shift, side_count(shape.radius))
    size = (2 * (shape.half_x + margin), 2 * (shape.half_y + margin), height)
    long = {0, 2} if shape.half_x >= shape.half_y else {1, 3}
    if front:
        return box_mesh(size, shift, long).stretched()
    hidden = long if front is False and solid.front else set()
    return box_mesh(size, shift, set(range(5)) - hidden)


def texture_shift(name: str) -> Array:
    """Translation (2,) [m] of a solid's texture: equal solids differ in appearance."""
    return np.array(divmod(zlib.crc32(name.encode()) % 10_000, 100)) * 0.02


# --- grouping ---------------------------------------------------------------------------------


def merged_parts(patches: Sequence[SurfacePatch]) -> Iterator[tuple[str, TexturedMesh]]:
    """Merge patches of one texture: by plane if that gives few enough parts, else by area."""
    for by_plane, edge in _GROUPINGS:
        parts: dict[tuple[object, ...], list[SurfacePatch]] = {}
        for patch in patches:
            parts.setdefault((patch.texture, *_part_key(patch, by_plane, edge)), []).append(patch)
        if len(parts) <= _MAX_PARTS:
            break
    for group in parts.values():
        mesh = TexturedMesh()
        for patch in group:
            mesh.append(patch.mesh)
        yield group[0].texture, mesh


def _part_key(patch: SurfacePatch, by_plane: bool, edge: float) -> tuple[object, ...]:
    """What the patches of one part have in common; ``edge`` [m] is that of the squares."""
    plane = patch.plane if by_plane else None
    if plane is not None and plane[2] > 0.5 and plane[3] > 0.0:
        return ("top",)
    vertices = np.array(patch.mesh.vertices)[:, :2]
    if np.ptp(vertices, axis=0).max() < _NARROW:
        plane = None
    x, y = np.mean(vertices, axis=0).tolist()
    rounded = None if plane is None else tuple(round(value, 6) + 0.0 for value in plane)
    return rounded, math.floor(x / edge), math.floor(y / edge)
