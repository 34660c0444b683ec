"""Reference renderer: PyBullet's TinyRenderer, for the images and timing of our own raster."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from navfw.numerics import Image
from navfw.robot import CameraModel
from navfw.signals import Pose
from navfw.sim.camera import Camera
from navfw.sim.engine import BulletConnection, Display, bullet, quaternion
from navfw.sim.raster import RenderRequest
from navfw.sim.scenery import Scenery
from navfw.sim.solids import solids_of
from navfw.sim.worldspec import WorldSpec


class ReferenceRenderer(BulletConnection):
    """The scenery of a world in a separate PyBullet client, drawn by its TinyRenderer.

    No shadows, no segmentation. It shows the world as at the start of a simulation, closed doors
    and walkers included. Use as a context manager, or ``close()`` it.
    """

    def __init__(self, world: WorldSpec, camera: CameraModel, supersample: int = 1) -> None:
        super().__init__()
        try:
            self.scenery = Scenery(world, Display(self._client))
            for solid in solids_of(world):
                if solid.kind == "door":
                    self.scenery.add_solid(solid)
            add = self.scenery.add_walker
            self._walkers = [(add(walker), 0.5 * walker.height) for walker in world.movers]
        except BaseException:
            self.close()
            raise
        self.place_walkers(walker.path[0] for walker in world.movers)
        # without noise nothing is drawn from the generator
        rng = np.random.default_rng(0)
        self.camera = Camera(camera, world.light, self.scenery, rng, supersample=supersample)

    def place_walkers(self, points: Iterable[tuple[float, float]]) -> None:
        """Move the walkers to points (x, y) [m], in the order of the world file."""
        for (body, middle), (x, y) in zip(self._walkers, points, strict=True):
            self.scenery.place(body, (x, y, middle), (0.0, 0.0, 0.0, 1.0))

    def request(self, pose: Pose) -> RenderRequest:
        """The render request of a robot's camera at ``pose``."""
        return self.camera.request((pose.x, pose.y, 0.0), quaternion(pose.yaw))

    def draw(self, request: RenderRequest) -> tuple[Image, npt.NDArray[np.float32], float]:
        """RGB (height, width, 3), depth buffer (height, width), and the wall time spent [s]."""
        width, height = request.size
        view, projection = (m.T.ravel().tolist() for m in (request.view, request.projection))
        begun = time.perf_counter()
        _, _, rgba, raw, _ = self._call(
            "getCameraImage",
            width,
            height,
            view,
            projection,
            lightDirection=request.light.direction,
            lightAmbientCoeff=request.light.ambient,
            lightDiffuseCoeff=request.light.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            flags=bullet.ER_NO_SEGMENTATION_MASK,
        )
        spent = time.perf_counter() - begun
        colours = np.asarray(rgba, np.uint8).reshape(height, width, 4)[..., :3]
        return colours, np.asarray(raw, np.float32).reshape(height, width), spent
