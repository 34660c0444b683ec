"""What the camera sees of a world: textured meshes, in parts, of which those in sight are drawn.

The meshes live in a raster of their own, beside the physics: there they would cost time in every
step, and here the parts can be as many as drawing wants. A display for people shows them as well.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from navfw.landmark_appearance import plate_image
from navfw.signals import Array, Image
from navfw.sim.display import Display
from navfw.sim.drop_geometry import Tread, drop_at, treads_of
from navfw.sim.landmark_plates import plate_bounds, plate_mesh
from navfw.sim.meshes import Mesh, box_mesh, cylinder_mesh, smooth_sides, splits
from navfw.sim.raster import Raster
from navfw.sim.shapes import Rectangle
from navfw.sim.solids import Solid, solids_of
from navfw.sim.textures import STOCK, stock_texture, synthesize
from navfw.sim.visibility import PartBounds, Visibility
from navfw.sim.worldspec import RoomSpec, TextureSpec, WorldSpec

__all__ = ["Scenery"]

_FEW = 24
"""More things than this are shown by texture and neighbourhood instead of one by one."""
_PARTS = 192
"""More parts than this cost more to look at than they save."""
_BLOCKS = (4.0, 8.0, 16.0)
"""Edges [m] of the squares that the plan is cut into, the finest that gives few enough parts."""
_NARROW = 0.4
"""Faces that are narrower [m] are put together with others, whatever way they look."""
_SKIN = 0.003
"""How far [m] a skin without texture stands off what it hides."""
_SLACK = 1e-5
_FLOOR = 1.0
"""Largest edge [m] of a patch of the floor: those at one's feet are dear to draw."""
_NO_SHIFT = np.zeros(2)

Plane = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class _Patch:
    """A piece of a surface in one texture; ``plane`` (normal, offset) of what is flat."""

    texture: str
    mesh: Mesh
    plane: Plane | None = None

    @property
    def narrow(self) -> bool:
        """Whether it is a wall's end or a side of an opening."""
        return float(np.ptp(np.array(self.mesh.vertices)[:, :2], axis=0).max()) < _NARROW

    @property
    def middle(self) -> tuple[float, float]:
        """Where it is in the plan [m]."""
        x, y, _ = np.mean(self.mesh.vertices, axis=0)
        return float(x), float(y)


class Scenery:
    """The bodies that show a world, in ``raster``; in ``display`` too, if there is one.

    ``cull`` False draws everything always. The display shows everything until somebody hides what
    is ``out_of_sight`` in it.
    """

    def __init__(self, world: WorldSpec, display: Display | None = None, cull: bool = True) -> None:
        self.world = world
        self.raster = Raster()
        self._display = display
        self._displayed: dict[int, int] = {}
        self._cull = cull
        self._textures: dict[str, int] = {}
        self._images: list[Image] = []
        solids = solids_of(world)
        walls = [s for s in solids if s.kind in ("wall", "lintel")]
        things = [s for s in solids if s.kind in ("box", "cylinder")]
        self._bodies: list[int] = []
        outlines: list[PartBounds] = []
        # what is in front first, so that the wall behind it is never shaded
        for mark in world.landmarks:
            grey = plate_image(mark.kind, mark.id)
            plate = self._load_image(np.repeat(grey[..., None], 3, axis=2))
            self._bodies.append(self._add(plate_mesh(mark), plate))
            outlines.append(plate_bounds(mark))
        if len(things) <= _FEW:
            for thing in things:
                self._bodies.append(self.show(thing))
                outlines.append(_outline_of(thing))
            things = []
        # things first, then walls: what they hide of floors and ceilings is then never shaded
        patches = [_patch_of(thing) for thing in things]
        patches += [patch for wall in walls for patch in self._wall_patches(wall)]
        patches += [*self._floor_patches(), *self._drop_patches()]
        for texture, mesh, outline in _parts_of(patches):
            self._bodies.append(self._add(mesh, texture))
            outlines.append(outline)
        self._visibility = _visibility(world, solids, outlines)
        self._shown = np.ones(len(outlines), np.bool_)

    def look(self, eye: Array, middle: float, half: float) -> None:
        """Have ready what is seen from ``eye`` (3,) [m], ``half`` [rad] around ``middle``."""
        if not self._cull:
            return
        seen = self._visibility.seen(eye, middle, half)
        if (seen != self._shown).any():
            self.raster.hide([self._bodies[i] for i in np.flatnonzero(~seen)])
            self._shown = seen

    @property
    def out_of_sight(self) -> tuple[int, ...]:
        """The display's bodies that were not seen at the last ``look``."""
        return tuple(self._displayed[self._bodies[i]] for i in np.flatnonzero(~self._shown))

    def show(self, solid: Solid) -> int:
        """One thing by itself; returns its body."""
        shape = solid.shape
        centre = (shape.x, shape.y, 0.5 * (solid.bottom + solid.top))
        return self._add(_mesh_of(solid), solid.texture, centre, _yaw_of(solid))

    def show_walker(self, name: str, radius: float, height: float, texture: str) -> int:
        """Someone who walks; where, is told to ``place``."""
        mesh = cylinder_mesh(radius, height, _shift_of(name))
        return self._add(mesh, texture)

    def cover(self, solids: Sequence[Solid], brightness: float) -> int:
        """Hide ``solids`` behind a skin without texture [grey levels]; returns its body.

        It stands off by less than anything measures.
        """
        mesh = Mesh()
        for solid in solids:
            centre = (solid.shape.x, solid.shape.y, 0.5 * (solid.bottom + solid.top))
            mesh.add_mesh(_mesh_of(solid, _SKIN), centre, _yaw_of(solid))
        if not solids:
            mesh = Mesh.without_area()
        return self._add(mesh, self._load(TextureSpec(contrast=0.0, brightness=brightness)))

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Move a body: position [m] and orientation (x, y, z, w)."""
        self.raster.place(body, position, turn)
        if self._display is not None:
            self._display.place(self._displayed[body], position, turn)

    def remove(self, body: int) -> None:
        """Show a body no longer."""
        self.raster.remove(body)
        if self._display is not None:
            self._display.remove(self._displayed.pop(body))

    # ------------------------------------------------------------------------------------------

    def _add(
        self,
        mesh: Mesh,
        texture: str | int,
        position: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
    ) -> int:
        turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
        picture = self._texture(texture) if isinstance(texture, str) else texture
        body = self.raster.add(mesh, picture, position, turn)
        if self._display is not None:
            self._displayed[body] = self._display.add(mesh, self._images[picture], position, turn)
        return body

    def _floor_patches(self) -> Iterator[_Patch]:
        """Floor and ceiling; no patch crosses a room's edge, or that of a drop."""
        world = self.world
        ex, ey, ez = np.eye(3)
        corner = np.array([world.x[0], world.y[0], 0.0])
        height = max([wall.height for wall in world.walls], default=2.4)
        # each (x, y): from, to
        areas = [(room.x, room.y) for room in world.rooms]
        areas += [(drop.x, drop.y) for drop in world.drops]
        all_columns = splits(
            world.x[1] - corner[0], [x - corner[0] for area in areas for x in area[0]], _FLOOR
        )
        all_rows = splits(
            world.y[1] - corner[1], [y - corner[1] for area in areas for y in area[1]], _FLOOR
        )
        for i in range(len(all_columns) - 1):
            for j in range(len(all_rows) - 1):
                columns, rows = all_columns[i : i + 2], all_rows[j : j + 2]
                middle = corner[0] + columns.mean(), corner[1] + rows.mean()
                room = self._room_at(*middle)
                floor = (room and room.floor) or world.floor
                if drop_at(world, *middle) is None:
                    yield _patch(floor, corner, ex, ey, columns, rows)
                ceiling = (room and room.ceiling) or world.ceiling
                if ceiling is not None:
                    yield _patch(ceiling, corner + height * ez, ey, ex, rows, columns)

    def _drop_patches(self) -> Iterator[_Patch]:
        """What one sees in the drops."""
        for drop in self.world.drops:
            for tread in treads_of(drop):
                yield from _tread_patches(tread, drop.texture, drop.walls)

    def _wall_patches(self, wall: Solid) -> Iterator[_Patch]:
        """The faces of one wall piece, each patch in the texture of the room it looks into."""
        assert isinstance(wall.shape, Rectangle)  # noqa: S101 - walls are
        corners = wall.shape.corners
        ez = np.array([0.0, 0.0, 1.0])
        rows = splits(wall.top - wall.bottom)
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            length = math.dist(start, end)
            right = np.array([*(end - start) / length, 0.0])
            outward = np.array([right[1], -right[0]])
            corner = np.array([*start, wall.bottom])
            columns = splits(length, self._room_cuts(start, right[:2]))
            for i in range(len(columns) - 1):
                middle = start + columns[i : i + 2].mean() * right[:2] + 0.02 * outward
                room = self._room_at(*middle)
                texture = (room and room.walls) or wall.texture
                yield from _patches(texture, corner, right, ez, columns[i : i + 2], rows)
        # top of a wall, and the underside of a lintel
        a, b, _, d = corners
        along, across = math.dist(a, b), math.dist(a, d)
        ex, ey = np.array([*(b - a) / along, 0.0]), np.array([*(d - a) / across, 0.0])
        columns, rows = splits(along), splits(across)
        yield from _patches(wall.texture, np.array([*a, wall.top]), ex, ey, columns, rows)
        if wall.bottom > 0.0:
            yield from _patches(wall.texture, np.array([*a, wall.bottom]), ey, ex, rows, columns)

    def _room_cuts(self, start: Array, right: Array) -> list[float]:
        """Where along a wall's face the rooms' edges meet it [m]."""
        cuts = []
        for room in self.world.rooms:
            for axis, edges in enumerate((room.x, room.y)):
                if abs(right[axis]) > 0.1:
                    cuts += [float((edge - start[axis]) / right[axis]) for edge in edges]
        return cuts

    def _room_at(self, x: float, y: float) -> RoomSpec | None:
        for room in self.world.rooms:
            if room.x[0] <= x <= room.x[1] and room.y[0] <= y <= room.y[1]:
                return room
        return None

    def _texture(self, name: str) -> int:
        """The raster's number of a texture."""
        if name not in self._textures:
            spec = self.world.textures.get(name)
            if spec is None and name in STOCK:
                spec = stock_texture(name)
            assert spec is not None  # noqa: S101 - check_world has seen to it
            self._textures[name] = self._load(spec)
        return self._textures[name]

    def _load(self, spec: TextureSpec) -> int:
        return self._load_image(synthesize(spec))

    def _load_image(self, image: Image) -> int:
        self._images.append(image)
        return self.raster.add_texture(image)


def _visibility(
    world: WorldSpec, solids: Sequence[Solid], outlines: Sequence[PartBounds]
) -> Visibility:
    """Walls hide what is behind them if nothing at all looks over them."""
    highest = max([wall.height for wall in world.walls], default=0.0)
    highest = max([highest, *(s.top for s in solids), *(m.height for m in world.movers)])
    hiding = [
        solid.shape
        for solid in solids
        if solid.kind == "wall" and solid.top >= highest and isinstance(solid.shape, Rectangle)
    ]
    return Visibility(hiding, highest, outlines)


def _parts_of(patches: Sequence[_Patch]) -> Iterable[tuple[str, Mesh, PartBounds]]:
    """Patches of one texture put together: those on one plane if possible, else neighbours."""
    for key in _keys():
        parts: dict[tuple[object, ...], list[_Patch]] = {}
        for patch in patches:
            parts.setdefault((patch.texture, *key(patch)), []).append(patch)
        if len(parts) <= _PARTS:
            break
    for part in parts.values():
        mesh = Mesh()
        for patch in part:
            mesh.append(patch.mesh)
        planes = {_rounded(patch.plane) for patch in part}
        plane = part[0].plane if len(planes) == 1 else None
        direction = 0.0
        if plane is not None:
            direction = math.atan2(plane[0], -plane[1]) if abs(plane[2]) < 0.5 else 0.0
            plane = (*plane[:3], plane[3] - _SLACK)
        yield part[0].texture, mesh, PartBounds.around(np.array(mesh.vertices), direction, plane)


def _keys() -> Iterator[Callable[[_Patch], tuple[object, ...]]]:
    """Ways to put patches together, from many parts to few."""
    for edge in _BLOCKS:
        yield partial(_face_key, edge=edge)
    for edge in _BLOCKS:
        yield partial(_block_key, edge=edge)
    yield lambda _: ()


def _block_key(patch: _Patch, edge: float) -> tuple[object, ...]:
    x, y = patch.middle
    return math.floor(x / edge), math.floor(y / edge)


def _face_key(patch: _Patch, edge: float) -> tuple[object, ...]:
    if patch.plane is not None and patch.plane[2] > 0.5 and patch.plane[3] > 0.0:
        return ("top",)  # of a wall: nobody sees it
    return (_rounded(None if patch.narrow else patch.plane), *_block_key(patch, edge))


def _rounded(plane: Plane | None) -> tuple[float, ...] | None:
    return None if plane is None else tuple(round(value, 6) + 0.0 for value in plane)


def _patches(
    texture: str, corner: Array, right: Array, up: Array, columns: Array, rows: Array
) -> Iterator[_Patch]:
    """A face, split at all ``columns`` and ``rows`` [m]."""
    for i in range(len(columns) - 1):
        for j in range(len(rows) - 1):
            yield _patch(texture, corner, right, up, columns[i : i + 2], rows[j : j + 2])


def _tread_patches(tread: Tread, texture: str, walls: str) -> Iterator[_Patch]:
    """A tread and the walls that face it."""
    ex, ey, ez = np.eye(3)
    corner = np.array([tread.x[0], tread.y[0], -tread.depth])
    columns, rows = (splits(high - low, longest=_FLOOR) for low, high in (tread.x, tread.y))
    yield from _patches(texture, corner, ex, ey, columns, rows)
    for left, right, top in tread.walls():
        length = math.dist(left, right)
        along = np.array([right[0] - left[0], right[1] - left[1], 0.0]) / length
        corner = np.array([*left, -tread.depth])
        yield from _patches(walls, corner, along, ez, splits(length), splits(top + tread.depth))


def _patch(
    texture: str, corner: Array, right: Array, up: Array, columns: Array, rows: Array
) -> _Patch:
    """The patch of a face between two columns and two rows."""
    mesh = Mesh()
    mesh.add_patch(corner, right, up, columns, rows, _NO_SHIFT)
    x, y, z = (float(n) for n in np.cross(right, up))
    return _Patch(texture, mesh, (x, y, z, float(np.dot((x, y, z), corner))))


def _patch_of(thing: Solid) -> _Patch:
    centre = (thing.shape.x, thing.shape.y, 0.5 * (thing.bottom + thing.top))
    mesh = Mesh()
    mesh.add_mesh(_mesh_of(thing), centre, _yaw_of(thing))
    return _Patch(thing.texture, mesh)


def _outline_of(thing: Solid) -> PartBounds:
    shape = thing.shape
    if isinstance(shape, Rectangle):
        return PartBounds(shape.corners)
    return PartBounds(Rectangle(shape.x, shape.y, shape.radius, shape.radius).corners)


def _yaw_of(solid: Solid) -> float:
    return solid.shape.yaw if isinstance(solid.shape, Rectangle) else 0.0


def _mesh_of(solid: Solid, skin: float = 0.0) -> Mesh:
    """How a box or cylinder looks, around its own middle; ``skin`` [m] thicker all around."""
    height, shape, shift = solid.top - solid.bottom, solid.shape, _shift_of(solid.name)
    height += 2.0 * skin
    if isinstance(shape, Rectangle):
        size = (2 * (shape.half_x + skin), 2 * (shape.half_y + skin), height)
        return box_mesh(size, shift)
    return cylinder_mesh(shape.radius + skin, height, shift, smooth_sides(shape.radius))


def _shift_of(name: str) -> Array:
    """Which part of its texture a thing shows [m]: two equal cupboards would look alike."""
    return np.array(divmod(zlib.crc32(name.encode()) % 10_000, 100)) * 0.02
