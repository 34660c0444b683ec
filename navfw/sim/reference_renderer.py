"""A world as PyBullet draws it: what our own raster has to match, and what that costs there."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from types import TracebackType

import numpy as np
import numpy.typing as npt

from navfw.robot import CameraModel
from navfw.signals import Image, Pose
from navfw.sim.camera import Camera, RenderRequest
from navfw.sim.display import Display
from navfw.sim.engine import bullet
from navfw.sim.scenery import Scenery
from navfw.sim.solids import solids_of
from navfw.sim.worldspec import WorldSpec

__all__ = ["ReferenceRenderer"]


class ReferenceRenderer:
    """The scenery of a world in a PyBullet client of its own, drawn by its TinyRenderer.

    No shadows, no segmentation. What a simulation shows when its time begins is there: closed doors
    too, and walkers, where they are put. With ``cull`` bodies out of sight are hidden first, as the
    simulation leaves them out. Use as a context manager, or ``close()`` it.
    """

    def __init__(
        self, world: WorldSpec, camera: CameraModel, supersample: int = 1, cull: bool = True
    ) -> None:
        self._client = int(bullet.connect(bullet.DIRECT))
        try:
            self._display = Display(self._client)
            self.scenery = Scenery(world, self._display)
            for solid in solids_of(world):
                if solid.kind == "door":
                    self.scenery.show(solid)
            self._walkers = [
                (self.scenery.show_walker(m.name, m.radius, m.height, m.texture), 0.5 * m.height)
                for m in world.movers
            ]
        except BaseException:
            self.close()
            raise
        self.put_walkers(mover.path[0] for mover in world.movers)
        # it takes no noise, so nothing is drawn from the generator
        rng = np.random.default_rng(0)
        self.camera = Camera(camera, world.light, self.scenery, rng, supersample=supersample)
        self._cull = cull

    def put_walkers(self, points: Iterable[tuple[float, float]]) -> None:
        """Everyone who walks to their points (x, y) [m], in the order of the world file."""
        for (body, middle), (x, y) in zip(self._walkers, points, strict=True):
            self.scenery.place(body, (x, y, middle), (0.0, 0.0, 0.0, 1.0))

    def aim(self, pose: Pose) -> RenderRequest:
        """What the camera of a robot at ``pose`` is to take; what is out of sight is hidden."""
        turn = (0.0, 0.0, math.sin(0.5 * pose.yaw), math.cos(0.5 * pose.yaw))
        shot = self.camera.aim((pose.x, pose.y, 0.0), turn)
        if self._cull:
            self._display.hide(self.scenery.out_of_sight)
        return shot

    def draw(self, shot: RenderRequest) -> tuple[Image, npt.NDArray[np.float32], float]:
        """RGB (height, width, 3), depth buffer (height, width), and the wall time it took [s]."""
        width, height = shot.size
        view, projection = (matrix.T.ravel().tolist() for matrix in (shot.view, shot.projection))
        begun = time.perf_counter()
        _, _, rgba, raw, _ = bullet.getCameraImage(
            width,
            height,
            view,
            projection,
            lightDirection=shot.light.direction,
            lightAmbientCoeff=shot.light.ambient,
            lightDiffuseCoeff=shot.light.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            flags=bullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        spent = time.perf_counter() - begun
        colours = np.asarray(rgba, np.uint8).reshape(height, width, 4)[..., :3]
        return colours, np.asarray(raw, np.float32).reshape(height, width), spent

    def close(self) -> None:
        """Leave the physics server; doing it twice is no harm."""
        if self._client >= 0:
            bullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def __enter__(self) -> ReferenceRenderer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
