"""A world's collision bodies in PyBullet, with names: simple shapes share bodies, and meshes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from navfw.sim.engine import BulletClient, bullet, quaternion
from navfw.sim.furniture_meshes import furniture_mesh
from navfw.sim.scenery import Scenery
from navfw.sim.shapes import Rectangle
from navfw.sim.solids import Solid, floor_pieces, solids_of, treads_of
from navfw.sim.textured_mesh import TexturedMesh
from navfw.sim.worldspec import MeshSpec, WalkerSpec, WorldSpec

FLOOR_GROUP = 1
"""Collision group of the floor and of treads."""
SOLID_GROUP = 2
"""Collision group of solids and walkers: their contact with the base is a collision."""
BODY_GROUP = 4
"""Collision group of the robot's base."""
WHEEL_GROUP = 8
"""Collision group of the robot's wheels and casters."""

_FLOOR = "floor"
"""Name of the floor's bodies."""
_FLOOR_THICKNESS = 0.2
"""Thickness of the boxes that form the floor [m]."""
_SHAPES_PER_BODY = 16
"""PyBullet's limit of shapes in one body. Each body costs about 1 us in every physics step."""
_CONTACT_TOLERANCE = 0.02
"""Largest distance [m] of a contact point above or below its solid."""


class PhysicsWorld(BulletClient):
    """Builds the collision bodies of a world in one PyBullet client.

    ``scenery`` holds their meshes. ``walkers`` are the bodies of the world's walkers, in the order
    of the file. A display of the scenery may use the same client.
    """

    def __init__(self, world: WorldSpec, client: int, scenery: Scenery) -> None:
        super().__init__(client)
        self.world = world
        self.scenery = scenery
        self._names: dict[int, str] = {}
        self._shared: dict[int, list[Solid]] = {}
        self._visuals: dict[int, int] = {}
        self._build_floor()
        solids = solids_of(world)
        for door in (s for s in solids if s.kind == "door"):
            self.add_solid(door)
        self.walkers = [self._build_walker(walker) for walker in world.movers]
        self._build_static([s for s in solids if s.kind not in ("door", "mesh")])
        for mesh in world.meshes:
            self._build_mesh(mesh)

    @property
    def floor(self) -> tuple[int, ...]:
        """The PyBullet ids of the bodies that form the floor."""
        return tuple(body for body, name in self._names.items() if name == _FLOOR)

    def name_at(self, body: int, x: float, y: float, z: float) -> str:
        """Return the name of the solid to which a contact of ``body`` at (x, y, z) [m] belongs."""
        shared = self._shared.get(body)
        if shared is None:
            return self._names.get(body, f"body {body}")
        point = np.array([[x, y]])
        level = [
            s for s in shared if s.bottom - _CONTACT_TOLERANCE <= z <= s.top + _CONTACT_TOLERANCE
        ] or shared
        return min(level, key=lambda solid: float(solid.shape.distance(point)[0])).name

    def add_solid(self, solid: Solid) -> None:
        """Add a removable solid, such as a door, as a body of its own."""
        shape = solid.shape
        if isinstance(shape, Rectangle):
            half = [shape.half_x, shape.half_y, 0.5 * solid.height]
            collision = self._call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
        else:
            size = {"radius": shape.radius, "height": solid.height}
            collision = self._call("createCollisionShape", bullet.GEOM_CYLINDER, **size)
        body = self._add_body(solid.name, solid.centre, collision, yaw=shape.yaw)
        self._visuals[body] = self.scenery.add_solid(solid)

    def remove_solid(self, name: str) -> None:
        """Remove a solid that ``add_solid`` added."""
        body = next(body for body, body_name in self._names.items() if body_name == name)
        self._call("removeBody", body)
        del self._names[body]
        self.scenery.remove(self._visuals.pop(body))

    def update_walker_visuals(self) -> None:
        """Move the walkers' meshes to the poses of their bodies."""
        for body in self.walkers:
            self.scenery.place(
                self._visuals[body], *self._call("getBasePositionAndOrientation", body)
            )

    def _build_floor(self) -> None:
        """The floor around the drops, and the drops' treads, which stop the robot's fall."""
        pieces = [(piece, 0.0) for piece in floor_pieces(self.world)]
        pieces += [(t.rectangle, t.depth) for drop in self.world.drops for t in treads_of(drop)]
        for piece, depth in pieces:
            half = [piece.half_x, piece.half_y, 0.5 * _FLOOR_THICKNESS]
            shape = self._call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
            centre = [piece.x, piece.y, -depth - 0.5 * _FLOOR_THICKNESS]
            self._add_body(_FLOOR, centre, shape, group=FLOOR_GROUP)

    def _build_static(self, solids: list[Solid]) -> None:
        """Static solids: neighbours share a body."""
        order = sorted(solids, key=lambda s: (math.floor(s.shape.x / 1.5), s.shape.y))
        for i in range(0, len(order), _SHAPES_PER_BODY):
            group = order[i : i + _SHAPES_PER_BODY]
            body = self._add_body(group[0].name, [0.0, 0.0, 0.0], self._collision_of(group))
            self._shared[body] = group

    def _collision_of(self, solids: list[Solid]) -> int:
        """One collision shape for all of ``solids``, boxes and cylinders."""
        boxes = [s.shape if isinstance(s.shape, Rectangle) else None for s in solids]
        return int(
            self._call(
                "createCollisionShapeArray",
                shapeTypes=[bullet.GEOM_CYLINDER if b is None else bullet.GEOM_BOX for b in boxes],
                halfExtents=[
                    [0.0, 0.0, 0.0] if b is None else [b.half_x, b.half_y, 0.5 * s.height]
                    for b, s in zip(boxes, solids, strict=True)
                ],
                radii=[0.0 if isinstance(s.shape, Rectangle) else s.shape.radius for s in solids],
                lengths=[s.height for s in solids],
                collisionFramePositions=[s.centre for s in solids],
                collisionFrameOrientations=[quaternion(s.shape.yaw) for s in solids],
            )
        )

    def _build_mesh(self, mesh: MeshSpec) -> None:
        """A mesh as a body of its triangles: concave, as it never moves."""
        triangles = furniture_mesh(mesh.file, mesh.scale, mesh.up)
        collision = self._call(
            "createCollisionShape",
            bullet.GEOM_MESH,
            vertices=triangles.vertices.tolist(),
            indices=triangles.faces.ravel().tolist(),
            flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH,
        )
        self._add_body(mesh.name, [*mesh.at, mesh.base], collision, yaw=mesh.yaw)

    def _build_walker(self, walker: WalkerSpec) -> int:
        """Return a walker's body at the first point of its path; the simulation moves it."""
        size = {"radius": walker.radius, "height": walker.height}
        collision = self._call("createCollisionShape", bullet.GEOM_CYLINDER, **size)
        centre = [*walker.path[0], 0.5 * walker.height]
        body = self._add_body(walker.name, centre, collision)
        self._visuals[body] = self.scenery.add_walker(walker)
        return body

    def _add_body(
        self,
        name: str,
        position: Sequence[float],
        collision: int,
        yaw: float = 0.0,
        group: int = SOLID_GROUP,
    ) -> int:
        # with no visual shape PyBullet would draw the collision shape: one without area
        hidden = TexturedMesh.without_area().arguments
        visual = self._call("createVisualShape", bullet.GEOM_MESH, **hidden)
        turn = quaternion(yaw)
        body = int(self._call("createMultiBody", 0.0, collision, visual, position, turn))
        # without this mask walls are tested against each other: 100 us more in each step
        partners = WHEEL_GROUP if group == FLOOR_GROUP else BODY_GROUP
        self._call("setCollisionFilterGroupMask", body, -1, group, partners)
        self._call("changeDynamics", body, -1, lateralFriction=1.0, restitution=0.0)
        self._names[body] = name
        return body
