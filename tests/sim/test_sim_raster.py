"""The raster's images are equal to those of PyBullet's TinyRenderer, bit for bit."""

from __future__ import annotations

import math
import zlib

import cv2
import numpy as np
import pytest

from navfw.config import find
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim import (
    Raster,
    ReferenceRenderer,
    SceneGeometry,
    SensorParams,
    Simulation,
    WalkerSpec,
    WorldSpec,
    depth_buffer,
    load_world,
    solids_of,
)
from navfw.worldgen import FAMILIES, generate


def agree(reference: ReferenceRenderer, pose: Pose) -> None:
    """Assert that the raster and PyBullet render the same image and depth from ``pose``."""
    request = reference.request(pose)
    rendered = reference.scenery.raster.draw(request)
    rgb, raw, _ = reference.draw(request)
    np.testing.assert_array_equal(rendered.rgb, rgb)
    np.testing.assert_array_equal(depth_buffer(rendered.depth, request.projection), raw)


def without_culling(
    world: WorldSpec, camera: CameraModel | None = None, supersample: int = 1
) -> ReferenceRenderer:
    """A reference renderer that draws invisible bodies as well."""
    return ReferenceRenderer(world, camera or CameraModel(), supersample, cull=False)


def world_of(name: str) -> WorldSpec:
    return generate(name, 5, 0.6).world if name in FAMILIES else load_world(find("world", name))


def free_poses(world: WorldSpec, count: int) -> list[Pose]:
    rng = np.random.default_rng(zlib.crc32(world.name.encode()))
    plan = SceneGeometry.from_world(world, 0.4)
    x0, y0, x1, y1 = plan.bounds
    poses: list[Pose] = []
    while len(poses) < count:
        x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
        if plan.clearance(x, y) > 0.2:
            poses.append(Pose(x, y, rng.uniform(-math.pi, math.pi)))
    return poses


@pytest.mark.parametrize("name", ["office", "empty", *FAMILIES])
def test_images_equal_tiny_renderer(name: str) -> None:
    world = world_of(name)
    with without_culling(world) as drawn:
        for pose in free_poses(world, 6):
            agree(drawn, pose)


@pytest.mark.parametrize("name", ["office", "moving"])
def test_images_equal_tiny_renderer_with_culling(name: str) -> None:
    world = world_of(name)
    with ReferenceRenderer(world, CameraModel()) as drawn:
        hidden = []
        for pose in free_poses(world, 6):
            agree(drawn, pose)
            hidden.append(set(drawn.scenery.hidden_bodies))
        assert min(map(len, hidden)) > 0
        assert len(set(map(frozenset, hidden))) > 1


@pytest.mark.parametrize("pitch", [-0.4, 0.3, 0.9])
def test_images_equal_tiny_renderer_for_pitched_cameras(pitch: float) -> None:
    world = world_of("clutter")
    with without_culling(world, CameraModel(pitch=pitch, hfov=1.9), supersample=2) as drawn:
        for pose in free_poses(world, 3):
            agree(drawn, pose)


def test_images_equal_tiny_renderer_when_the_light_changes() -> None:
    world = world_of("rooms")
    with without_culling(world) as drawn:
        for light in (0.0, 0.37, 3.0):
            drawn.camera.set_optics(light, hfov_error=0.05)
            agree(drawn, free_poses(world, 1)[0])


def test_images_equal_tiny_renderer_when_bodies_are_added_moved_and_removed() -> None:
    world = world_of("office")
    box = next(s for s in solids_of(world) if s.kind == "box")
    pose = Pose(box.shape.x - 1.2, box.shape.y + 0.1, 0.1)
    with without_culling(world) as drawn:
        mover = drawn.scenery.add_walker("mover", 0.25, 1.7, world.walls[0].texture)
        for x, yaw in ((0.9, 0.3), (0.5, 2.1), (0.31, -1.9)):
            turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
            drawn.scenery.place(mover, (pose.x + x, pose.y + 0.2, 0.85), turn)
            agree(drawn, pose)
        drawn.scenery.remove(mover)
        cover = drawn.scenery.add_cover([box], 120.0)
        agree(drawn, pose)
        drawn.scenery.remove(cover)
        agree(drawn, pose)


def test_an_empty_raster_is_white() -> None:
    with without_culling(world_of("empty")) as drawn:
        request = drawn.request(Pose(0.0, 0.0, 0.0))
    rendered = Raster().draw(request)
    assert (rendered.rgb == 255).all()
    assert (depth_buffer(rendered.depth, request.projection) > 1.0 - 1e-6).all()


def test_reference_equals_the_images_of_a_simulation() -> None:
    world, robot = world_of("office"), RobotModel()
    doors = tuple(door.model_copy(update={"state": "closed"}) for door in world.doors)
    texture = world.walls[0].texture
    # a mover with heading 0 has the same orientation in both
    mover = WalkerSpec(name="anna", path=((2.8, 3.2), (4.2, 3.2)), texture=texture)
    world = world.model_copy(update={"doors": doors, "movers": (mover,)})
    pose = Pose(1.5, 3.0, 0.1)
    sensors = SensorParams.preset("perfect")
    with (
        Simulation(world, robot, pose, 0, sensors) as simulation,
        ReferenceRenderer(world, robot.camera, sensors.supersample) as reference,
    ):
        for _ in range(2):
            seen = [simulation.render_from(p)[0] for p in (pose, Pose(1.5, 3.0, 0.6))]
            reference.place_walkers([(mover.x, mover.y) for mover in simulation.walkers])
            for image, there in zip(seen, (pose, Pose(1.5, 3.0, 0.6)), strict=True):
                rgb, _, _ = reference.draw(reference.request(there))
                np.testing.assert_array_equal(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), image)
            simulation.advance(1.0)
