"""Building a world in PyBullet: simple collision shapes, textured meshes, named bodies."""

from __future__ import annotations

import math
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.signals import Array
from navfw.sim.engine import bullet
from navfw.sim.layout import Solid, solids_of
from navfw.sim.meshes import Mesh, box_mesh, cylinder_mesh, smooth_sides, splits
from navfw.sim.shapes import Rectangle
from navfw.sim.textures import STOCK, stock_texture, synthesize
from navfw.sim.worldfile import MoverSpec, RoomSpec, TextureSpec, WorldSpec

__all__ = ["BODY_GROUP", "FLOOR_GROUP", "SOLID_GROUP", "WHEEL_GROUP", "Scene"]

FLOOR_GROUP = 1
"""Collision group of what one drives on."""
SOLID_GROUP = 2
"""Collision group of everything that one must not touch."""
BODY_GROUP = 4
"""Collision group of the robot's base."""
WHEEL_GROUP = 8
"""Collision group of what the robot stands on."""

_FLOOR_THICKNESS = 0.2
_FEW = 24
"""More things than this share bodies: each body costs about 1 us in every physics step."""
_PIECES = 16
"""PyBullet's limit of shapes in one body."""
_SKIN = 0.003
"""How far [m] a skin without texture stands off what it hides."""
_NO_SHIFT = np.zeros(2)


class Scene:
    """The bodies of a world in one PyBullet client.

    ``names`` says which body is what, ``name_at`` also which of several things that share a body.
    ``movers`` are the bodies of those who walk, in the order of the world file.
    """

    def __init__(self, world: WorldSpec, client: int) -> None:
        self.world = world
        self.names: dict[int, str] = {}
        self._client = client
        self._textures: dict[str, int] = {}
        self._shared: dict[int, list[Solid]] = {}
        self.movers: list[int] = []
        solids = solids_of(world)
        self._build_floor()
        walls = [s for s in solids if s.kind in ("wall", "lintel")]
        for wall in world.walls:
            self._build_wall([s for s in walls if s.name == wall.name])
        things = [s for s in solids if s.kind in ("box", "cylinder")]
        separate = things if len(things) <= _FEW else []
        for solid in (*(s for s in solids if s.kind == "door"), *separate):
            self.put_up(solid)
        self.movers = [self._build_mover(mover) for mover in world.movers]
        if len(things) > _FEW:
            self._build_together(things)
        self._show_architecture(walls)

    def name_at(self, body: int, x: float, y: float) -> str:
        """What is touched when ``body`` is touched at (x, y) [m]."""
        shared = self._shared.get(body)
        if shared is None:
            return self.names.get(body, f"body {body}")
        point = np.array([[x, y]])
        return min(shared, key=lambda solid: float(solid.shape.distance(point)[0])).name

    def _build_floor(self) -> None:
        (x0, x1), (y0, y1) = self.world.x, self.world.y
        half = [0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * _FLOOR_THICKNESS]
        shape = self._call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
        centre = [0.5 * (x0 + x1), 0.5 * (y0 + y1), -0.5 * _FLOOR_THICKNESS]
        self._add_body("floor", centre, 0.0, collision=shape, group=FLOOR_GROUP)

    def _build_wall(self, pieces: list[Solid]) -> None:
        """Collision of all pieces of one wall, in as few bodies as can be."""
        for i in range(0, len(pieces), _PIECES):
            self._add_body(
                pieces[0].name, [0.0, 0.0, 0.0], 0.0, self._collision_of(pieces[i : i + _PIECES])
            )

    def _collision_of(self, solids: list[Solid]) -> int:
        """One collision shape for all of ``solids``, boxes and cylinders."""
        boxes = [s.shape if isinstance(s.shape, Rectangle) else None for s in solids]
        heights = [s.top - s.bottom for s in solids]
        return int(
            self._call(
                "createCollisionShapeArray",
                shapeTypes=[bullet.GEOM_CYLINDER if b is None else bullet.GEOM_BOX for b in boxes],
                halfExtents=[
                    [0.0, 0.0, 0.0] if b is None else [b.half_x, b.half_y, 0.5 * height]
                    for b, height in zip(boxes, heights, strict=True)
                ],
                radii=[0.0 if isinstance(s.shape, Rectangle) else s.shape.radius for s in solids],
                lengths=heights,
                collisionFramePositions=[
                    [s.shape.x, s.shape.y, 0.5 * (s.top + s.bottom)] for s in solids
                ],
                collisionFrameOrientations=[
                    _quaternion(0.0 if b is None else b.yaw) for b in boxes
                ],
            )
        )

    def _build_together(self, things: list[Solid]) -> None:
        """Many things: neighbours share a body, and all of one texture are shown at once."""
        order = sorted(things, key=lambda s: (math.floor(s.shape.x / 1.5), s.shape.y))
        for i in range(0, len(order), _PIECES):
            part = order[i : i + _PIECES]
            body = self._add_body(part[0].name, [0.0, 0.0, 0.0], 0.0, self._collision_of(part))
            self._shared[body] = part
        meshes: dict[str, Mesh] = {}
        for thing in things:
            yaw = thing.shape.yaw if isinstance(thing.shape, Rectangle) else 0.0
            centre = (thing.shape.x, thing.shape.y, 0.5 * (thing.bottom + thing.top))
            meshes.setdefault(thing.texture, Mesh()).add_mesh(_mesh_of(thing), centre, yaw)
        for texture, mesh in meshes.items():
            self._add_body("", [0.0, 0.0, 0.0], 0.0, -1, self._visual(mesh), texture)

    def _build_mover(self, mover: MoverSpec) -> int:
        """Someone who walks; where, is for ``navfw.sim.movers`` to say."""
        size = {"radius": mover.radius, "height": mover.height}
        collision = self._call("createCollisionShape", bullet.GEOM_CYLINDER, **size)
        mesh = cylinder_mesh(mover.radius, mover.height, _shift_of(mover.name))
        centre = [*mover.path[0], 0.5 * mover.height]
        return self._add_body(mover.name, centre, 0.0, collision, self._visual(mesh), mover.texture)

    def put_up(self, solid: Solid) -> int:
        """Furniture, doors, what appears on the way: each a body that shows itself."""
        height = solid.top - solid.bottom
        shape = solid.shape
        if isinstance(shape, Rectangle):
            yaw = shape.yaw
            half = [shape.half_x, shape.half_y, 0.5 * height]
            collision = self._call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
        else:
            yaw = 0.0
            collision = self._call(
                "createCollisionShape", bullet.GEOM_CYLINDER, radius=shape.radius, height=height
            )
        centre = [shape.x, shape.y, 0.5 * (solid.bottom + solid.top)]
        visual = self._visual(_mesh_of(solid))
        return self._add_body(solid.name, centre, yaw, collision, visual, solid.texture)

    def take_away(self, name: str) -> None:
        """Remove what was put up under that name."""
        body = next(body for body, known in self.names.items() if known == name)
        self.remove(body)

    def cover(self, solids: list[Solid], brightness: float) -> int:
        """Hide ``solids`` behind a skin without texture [grey levels]; returns it, for ``remove``.

        It has no collision shape, and stands off by less than anything measures.
        """
        mesh = Mesh()
        for solid in solids:
            yaw = solid.shape.yaw if isinstance(solid.shape, Rectangle) else 0.0
            centre = (solid.shape.x, solid.shape.y, 0.5 * (solid.bottom + solid.top))
            mesh.add_mesh(_mesh_of(solid, _SKIN), centre, yaw)
        visual = self._visual(mesh) if solids else -1
        skin = self._add_body("", [0.0, 0.0, 0.0], 0.0, -1, visual)
        plain = self._load(TextureSpec(contrast=0.0, brightness=brightness))
        self._call("changeVisualShape", skin, -1, textureUniqueId=plain)
        return skin

    def remove(self, body: int) -> None:
        """Remove a body."""
        self._call("removeBody", body)
        self.names.pop(body, None)

    def _show_architecture(self, walls: list[Solid]) -> None:
        """Floor, walls and ceiling: one body without collision for each texture."""
        meshes: dict[str, Mesh] = {}
        # walls first: what they hide of floors and ceilings is then never shaded
        for wall in walls:
            self._wall_meshes(wall, meshes)
        self._floor_meshes(meshes)
        for texture, mesh in meshes.items():
            self._add_body("", [0.0, 0.0, 0.0], 0.0, -1, self._visual(mesh), texture)

    def _floor_meshes(self, meshes: dict[str, Mesh]) -> None:
        world = self.world
        ex, ey, ez = np.eye(3)
        corner = np.array([world.x[0], world.y[0], 0.0])
        height = max([wall.height for wall in world.walls], default=2.4)
        for columns, rows in self._floor_patches():
            room = self._room_at(corner[0] + columns.mean(), corner[1] + rows.mean())
            floor = (room and room.floor) or world.floor
            mesh = meshes.setdefault(floor, Mesh())
            mesh.add_patch(corner, ex, ey, columns, rows, _NO_SHIFT)
            ceiling = (room and room.ceiling) or world.ceiling
            if ceiling is not None:
                mesh = meshes.setdefault(ceiling, Mesh())
                mesh.add_patch(corner + height * ez, ey, ex, rows, columns, _NO_SHIFT)

    def _floor_patches(self) -> Iterator[tuple[Array, Array]]:
        """Columns and rows [m from the corner] of each patch; none crosses a room's edge."""
        x0, y0 = self.world.x[0], self.world.y[0]
        columns = splits(self.world.x[1] - x0, [x - x0 for r in self.world.rooms for x in r.x])
        rows = splits(self.world.y[1] - y0, [y - y0 for r in self.world.rooms for y in r.y])
        for i in range(len(columns) - 1):
            for j in range(len(rows) - 1):
                yield columns[i : i + 2], rows[j : j + 2]

    def _wall_meshes(self, wall: Solid, meshes: dict[str, Mesh]) -> None:
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
                mesh = meshes.setdefault(texture, Mesh())
                mesh.add_face(corner, right, ez, columns[i : i + 2], rows, _NO_SHIFT)
        self._level_faces(wall, meshes.setdefault(wall.texture, Mesh()))

    def _level_faces(self, wall: Solid, mesh: Mesh) -> None:
        """Top of a wall, and the underside of a lintel."""
        assert isinstance(wall.shape, Rectangle)  # noqa: S101
        a, b, _, d = wall.shape.corners
        along, across = math.dist(a, b), math.dist(a, d)
        ex, ey = np.array([*(b - a) / along, 0.0]), np.array([*(d - a) / across, 0.0])
        columns, rows = splits(along), splits(across)
        mesh.add_face(np.array([*a, wall.top]), ex, ey, columns, rows, _NO_SHIFT)
        if wall.bottom > 0.0:
            mesh.add_face(np.array([*a, wall.bottom]), ey, ex, rows, columns, _NO_SHIFT)

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

    def _unseen(self) -> int:
        """A visual shape without area."""
        point = [[0.0, 0.0, 0.0]] * 3
        return self._visual(Mesh(point, [[0.0, 0.0, 1.0]] * 3, [[0.0, 0.0]] * 3, [0, 1, 2]))

    def _visual(self, mesh: Mesh) -> int:
        return int(
            self._call(
                "createVisualShape",
                bullet.GEOM_MESH,
                vertices=mesh.vertices,
                indices=mesh.indices,
                uvs=mesh.uvs,
                normals=mesh.normals,
                specularColor=[0.0, 0.0, 0.0],
            )
        )

    def _add_body(
        self,
        name: str,
        position: list[float],
        yaw: float,
        collision: int = -1,
        visual: int = -1,
        texture: str | None = None,
        group: int = SOLID_GROUP,
    ) -> int:
        if visual < 0:
            visual = self._unseen()  # or PyBullet would draw the collision shape itself
        body = int(
            self._call("createMultiBody", 0.0, collision, visual, position, _quaternion(yaw))
        )
        if collision >= 0:
            # without this mask walls would be tested against each other: 100 us a step more
            meets = WHEEL_GROUP if group == FLOOR_GROUP else BODY_GROUP
            self._call("setCollisionFilterGroupMask", body, -1, group, meets)
            self._call("changeDynamics", body, -1, lateralFriction=1.0, restitution=0.0)
            self.names[body] = name
        if texture is not None:
            self._call("changeVisualShape", body, -1, textureUniqueId=self._texture(texture))
        return body

    def _texture(self, name: str) -> int:
        """PyBullet's id of a texture; it takes pictures only from files."""
        if name not in self._textures:
            spec = self.world.textures.get(name)
            if spec is None and name in STOCK:
                spec = stock_texture(name)
            assert spec is not None  # noqa: S101 - check_world has seen to it
            self._textures[name] = self._load(spec)
        return self._textures[name]

    def _load(self, spec: TextureSpec) -> int:
        with tempfile.TemporaryDirectory(prefix="navfw-textures-") as folder:
            # uncompressed: written and read ten times as fast as PNG
            path = Path(folder) / "texture.bmp"
            cv2.imwrite(str(path), cv2.cvtColor(synthesize(spec), cv2.COLOR_RGB2BGR))
            return int(self._call("loadTexture", str(path)))

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)


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


def _quaternion(yaw: float) -> list[float]:
    return [0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)]
