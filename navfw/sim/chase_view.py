"""A colour view of the robot from behind and above, for people, never for the stack.

It has its own scenery, without objects and doors that events change while the robot drives.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim.camera import Camera
from navfw.sim.engine import quaternion
from navfw.sim.scenery import Scenery
from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.solids import Solid, solids_of
from navfw.sim.worldspec import TextureSpec, WorldSpec

_BEHIND, _HEIGHT, _MIN_BEHIND = 1.7, 1.35, 0.5
"""Distances [m] of the camera behind the robot, above the floor, and behind it at least."""
_AHEAD = 1.5
"""Distance [m] ahead of the robot of the floor point in the middle of the picture."""
_FROM_WALL, _HFOV = 0.15, 1.25
"""Smallest distance [m] of the camera from walls; its horizontal field of view [rad]."""
_PAINTS = {
    "robot-body": TextureSpec(contrast=0.0, brightness=150.0, colour=(1.0, 0.62, 0.1)),
    "robot-parts": TextureSpec(contrast=0.0, brightness=45.0),
}


class ChaseView:
    """Draws ``robot`` in ``world`` as pictures of ``size`` (width, height) [px].

    ``fine`` times as many pixels are rendered in both directions, and averaged.
    """

    def __init__(
        self, world: WorldSpec, robot: RobotModel, size: tuple[int, int], fine: int = 1
    ) -> None:
        painted = world.model_copy(update={"textures": {**world.textures, **_PAINTS}})
        self._scenery = Scenery(painted)
        solids = solids_of(world)
        for door in (s for s in solids if s.kind == "door"):
            self._scenery.add_solid(door)
        self._tall = [solid.shape for solid in solids if solid.bottom < _HEIGHT < solid.top]
        self._walkers = [(self._scenery.add_walker(w), 0.5 * w.height) for w in world.movers]
        self._robot = [self._scenery.add_solid(part, moves=True) for part in _parts(robot)]
        model = CameraModel(width=fine * size[0], height=fine * size[1], hfov=_HFOV)
        rng = np.random.default_rng(0)  # without noise nothing is drawn
        self._camera = Camera(model, world.light, self._scenery, rng)
        self._size = size

    def draw(self, pose: Pose, movers: Sequence[tuple[float, float, float]] = ()) -> Image:
        """Draw the picture (height, width, 3), BGR, of the robot at ``pose`` in ``map``.

        ``movers`` are the discs x, y, radius [m] of the world's movers, in their order.
        """
        turn = quaternion(pose.yaw)
        for body in self._robot:
            self._scenery.place(body, (pose.x, pose.y, 0.0), turn)
        for (body, middle), (x, y, _) in zip(self._walkers, movers, strict=False):
            self._scenery.place(body, (x, y, middle), quaternion(0.0))
        eye = np.array([*pose.to_parent(-self._room_behind(pose), 0.0), _HEIGHT])
        ahead = np.array([*pose.to_parent(_AHEAD, 0.0), 0.0]) - eye
        ahead /= math.hypot(*ahead.tolist())
        right = np.array([math.sin(pose.yaw), -math.cos(pose.yaw), 0.0])
        axes = np.stack([right, np.cross(ahead, right), ahead], axis=1)
        rgb, _ = self._scenery.raster.draw(self._camera.request_at(eye, axes))
        bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
        return np.asarray(cv2.resize(bgr, self._size, interpolation=cv2.INTER_AREA), np.uint8)

    def _room_behind(self, pose: Pose) -> float:
        """Return the distance [m] behind the robot at which the camera is in front of walls."""
        along = np.arange(_MIN_BEHIND, _BEHIND, 0.05)
        points: Array = np.array([pose.to_parent(-back, 0.0) for back in along.tolist()])
        walls = np.min([along, *(shape.distance(points) for shape in self._tall)], axis=0)
        blocked = np.flatnonzero(walls < _FROM_WALL)
        return float(along[max(0, blocked[0] - 1)] if len(blocked) else along[-1])


def _parts(robot: RobotModel) -> Iterator[Solid]:
    """Yield the robot as solids around its origin: body, mast and camera."""
    lens, at, body = robot.camera.mount_height, robot.camera.mount_forward, robot.footprint
    shape: Circle | Rectangle = Circle(0.0, 0.0, robot.radius)
    if body is not None:
        half = 0.5 * (body.front + body.rear)
        shape = Rectangle(body.front - half, 0.0, half, robot.radius, 0.0)
    yield Solid("robot", "box", shape, 0.04, 0.5 * lens, "robot-body")
    for half, low in ((0.02, 0.5 * lens), (0.05, lens - 0.03)):
        mast = Rectangle(at, 0.0, 0.02, half, 0.0)
        yield Solid("robot", "box", mast, low, lens + 0.03, "robot-parts")
