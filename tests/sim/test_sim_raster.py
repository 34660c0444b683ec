"""The raster draws what PyBullet's TinyRenderer draws, to the last bit."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from navfw.config.lookup import find
from navfw.robot import CameraModel
from navfw.signals import Pose
from navfw.sim.camera import Camera
from navfw.sim.display import Display
from navfw.sim.engine import bullet
from navfw.sim.floorplan import FloorPlan
from navfw.sim.layout import solids_of
from navfw.sim.raster import Picture, Raster, depth_buffer
from navfw.sim.scenery import Scenery
from navfw.sim.worldfile import WorldSpec, load_world
from navfw.worldgen import FAMILIES, generate


class Both:
    """One scenery, drawn by the raster and by PyBullet."""

    def __init__(self, world: WorldSpec, camera: CameraModel, client: int, scale: int = 1) -> None:
        self.client = client
        self.scale = scale
        # what is hidden or out of sight is drawn by PyBullet all the same
        self.scenery = Scenery(world, Display(client))
        rng = np.random.default_rng(0)
        self.camera = Camera(camera, world.light, self.scenery, rng, supersample=scale)
        self.asked: list[tuple[np.ndarray, np.ndarray]] = []
        self.pictures: list[Picture] = []
        draw = self.scenery.raster.draw

        def watched(view, projection, eye, size, light):  # type: ignore[no-untyped-def]
            picture = draw(view, projection, eye, size, light)
            self.asked.append((view, projection))
            self.light = light
            self.pictures.append(picture)
            return picture

        self.scenery.raster.draw = watched  # type: ignore[method-assign]

    def agree(self, pose: Pose) -> None:
        """Assert that both show the same from ``pose``."""
        turn = (0.0, 0.0, math.sin(0.5 * pose.yaw), math.cos(0.5 * pose.yaw))
        self.camera.render((pose.x, pose.y, 0.0), turn)
        (view, projection), picture = self.asked[-1], self.pictures[-1]
        height, width = picture.depth.shape
        _, _, rgba, raw, _ = bullet.getCameraImage(
            width,
            height,
            view.T.ravel().tolist(),
            projection.T.ravel().tolist(),
            lightDirection=self.light.direction,
            lightAmbientCoeff=self.light.ambient,
            lightDiffuseCoeff=self.light.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        theirs = np.asarray(rgba, np.uint8).reshape(height, width, 4)[..., :3]
        np.testing.assert_array_equal(picture.rgb, theirs)
        depth = depth_buffer(picture.depth, projection)
        np.testing.assert_array_equal(depth, np.asarray(raw, np.float32).reshape(height, width))


@contextmanager
def both(world: WorldSpec, camera: CameraModel | None = None, scale: int = 1) -> Iterator[Both]:
    client = bullet.connect(bullet.DIRECT)
    try:
        yield Both(world, camera or CameraModel(), client, scale)
    finally:
        bullet.disconnect(physicsClientId=client)


def world_of(name: str) -> WorldSpec:
    return generate(name, 5, 0.6).world if name in FAMILIES else load_world(find("world", name))


def free_poses(world: WorldSpec, count: int) -> list[Pose]:
    rng = np.random.default_rng(zlib.crc32(world.name.encode()))
    plan = FloorPlan.from_world(world, 0.4)
    x0, y0, x1, y1 = plan.bounds
    poses: list[Pose] = []
    while len(poses) < count:
        x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
        if plan.clearance(x, y) > 0.2:
            poses.append(Pose(x, y, rng.uniform(-math.pi, math.pi)))
    return poses


@pytest.mark.parametrize("name", ["office", "empty", *FAMILIES])
def test_pictures_are_those_of_tiny_renderer(name: str) -> None:
    world = world_of(name)
    with both(world) as drawn:
        for pose in free_poses(world, 6):
            drawn.agree(pose)


@pytest.mark.parametrize("pitch", [-0.4, 0.3, 0.9])
def test_they_are_for_cameras_that_look_up_or_down(pitch: float) -> None:
    world = world_of("clutter")
    with both(world, CameraModel(pitch=pitch, hfov=1.9), scale=2) as drawn:
        for pose in free_poses(world, 3):
            drawn.agree(pose)


def test_they_are_when_the_light_changes() -> None:
    world = world_of("rooms")
    with both(world) as drawn:
        for light in (0.0, 0.37, 3.0):
            drawn.camera.adjust(light, hfov_error=0.05)
            drawn.agree(free_poses(world, 1)[0])


def test_they_are_when_things_come_move_and_go() -> None:
    world = world_of("office")
    thing = next(s for s in solids_of(world) if s.kind == "box")
    pose = Pose(thing.shape.x - 1.2, thing.shape.y + 0.1, 0.1)
    with both(world) as drawn:
        walker = drawn.scenery.show_walker("walker", 0.25, 1.7, world.walls[0].texture)
        for x, yaw in ((0.9, 0.3), (0.5, 2.1), (0.31, -1.9)):
            turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
            drawn.scenery.place(walker, (pose.x + x, pose.y + 0.2, 0.85), turn)
            drawn.agree(pose)
        drawn.scenery.remove(walker)
        skin = drawn.scenery.cover([thing], 120.0)
        drawn.agree(pose)
        drawn.scenery.remove(skin)
        drawn.agree(pose)


def test_an_empty_raster_is_white() -> None:
    camera = CameraModel()
    raster = Raster()
    with both(world_of("empty"), camera) as drawn:
        drawn.agree(Pose(0.0, 0.0, 0.0))
        picture = raster.draw(
            *drawn.asked[-1], np.zeros(3), (camera.width, camera.height), drawn.light
        )
    assert (picture.rgb == 255).all()
    assert (depth_buffer(picture.depth, drawn.asked[-1][1]) > 1.0 - 1e-6).all()
