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
from navfw.sim.meshes import Mesh, box_mesh, cylinder_mesh, splits
from navfw.sim.shapes import Rectangle
from navfw.sim.textures import STOCK, stock_texture, synthesize
from navfw.sim.worldfile import RoomSpec, WorldSpec

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
_NO_SHIFT = np.zeros(2)


class Scene:
    """The bodies of a world in one PyBullet client; ``names`` says which body is what."""

    def __init__(self, world: WorldSpec, client: int) -> None:
        self.world = world
        self.names: dict[int, str] = {}
        self._client = client
        self._textures: dict[str, int] = {}
        solids = solids_of(world)
        with tempfile.TemporaryDirectory(prefix="navfw-textures-") as folder:
            self._folder = Path(folder)
            self._build_floor()
            walls = [s for s in solids if s.kind in ("wall", "lintel")]
            for wall in world.walls:
                self._build_wall([s for s in walls if s.name == wall.name])
            for solid in solids:
                if solid.kind not in ("wall", "lintel"):
                    self._build_solid(solid)
            self._show_architecture(walls)

    def _build_floor(self) -> None:
        (x0, x1), (y0, y1) = self.world.x, self.world.y
        half = [0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * _FLOOR_THICKNESS]
        shape = self._call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
        centre = [0.5 * (x0 + x1), 0.5 * (y0 + y1), -0.5 * _FLOOR_THICKNESS]
        self._add_body("floor", centre, 0.0, collision=shape, group=FLOOR_GROUP)

    def _build_wall(self, pieces: list[Solid]) -> None:
        """Collision of all pieces of one wall: one body (every body costs 0.2 us a step)."""
        shapes = [piece.shape for piece in pieces if isinstance(piece.shape, Rectangle)]
        heights = [(piece.bottom, piece.top) for piece in pieces]
        collision = self._call(
            "createCollisionShapeArray",
            shapeTypes=[bullet.GEOM_BOX] * len(shapes),
            halfExtents=[
                [shape.half_x, shape.half_y, 0.5 * (top - bottom)]
                for shape, (bottom, top) in zip(shapes, heights, strict=True)
            ],
            collisionFramePositions=[
                [shape.x, shape.y, 0.5 * (top + bottom)]
                for shape, (bottom, top) in zip(shapes, heights, strict=True)
            ],
            collisionFrameOrientations=[_quaternion(shape.yaw) for shape in shapes],
        )
        self._add_body(pieces[0].name, [0.0, 0.0, 0.0], 0.0, collision)

    def _build_solid(self, solid: Solid) -> None:
        """Furniture and doors: each a body that shows itself, for it may move one day."""
        height = solid.top - solid.bottom
        shape = solid.shape
        # each body shows another part of its texture: two equal cupboards would look alike
        shift = np.array(divmod(zlib.crc32(solid.name.encode()) % 10_000, 100)) * 0.02
        if isinstance(shape, Rectangle):
            yaw = shape.yaw
            half = [shape.half_x, shape.half_y, 0.5 * height]
            collision = self._call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
            mesh = box_mesh((2 * shape.half_x, 2 * shape.half_y, height), shift)
        else:
            yaw = 0.0
            collision = self._call(
                "createCollisionShape", bullet.GEOM_CYLINDER, radius=shape.radius, height=height
            )
            mesh = cylinder_mesh(shape.radius, height, shift)
        centre = [shape.x, shape.y, 0.5 * (solid.bottom + solid.top)]
        self._add_body(solid.name, centre, yaw, collision, self._visual(mesh), solid.texture)

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
            path = self._folder / f"{len(self._textures)}.png"
            bgr = cv2.cvtColor(synthesize(spec), cv2.COLOR_RGB2BGR)
            cv2.imwrite(str(path), bgr, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            self._textures[name] = int(self._call("loadTexture", str(path)))
        return self._textures[name]

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)


def _quaternion(yaw: float) -> list[float]:
    return [0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)]
