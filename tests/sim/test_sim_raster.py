"""The raster draws what PyBullet's TinyRenderer draws, to the last bit."""

from __future__ import annotations

import math
import zlib

import cv2
import numpy as np
import pytest

from navfw.config.lookup import find
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim.floorplan import FloorPlan
from navfw.sim.raster import Raster, depth_buffer
from navfw.sim.reference_renderer import ReferenceRenderer
from navfw.sim.sensor_models import SensorParams
from navfw.sim.simulation import Simulation
from navfw.sim.solids import solids_of
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import MoverSpec, WorldSpec
from navfw.worldgen import FAMILIES, generate


def agree(reference: ReferenceRenderer, pose: Pose) -> None:
    """Assert that the raster and PyBullet show the same from ``pose``."""
    shot = reference.aim(pose)
    picture = reference.scenery.raster.draw(*shot)
    rgb, raw, _ = reference.draw(shot)
    np.testing.assert_array_equal(picture.rgb, rgb)
    np.testing.assert_array_equal(depth_buffer(picture.depth, shot.projection), raw)


def everything(
    world: WorldSpec, camera: CameraModel | None = None, supersample: int = 1
) -> ReferenceRenderer:
    """What is hidden or out of sight is drawn by PyBullet all the same."""
    return ReferenceRenderer(world, camera or CameraModel(), supersample, cull=False)


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
    with everything(world) as drawn:
        for pose in free_poses(world, 6):
            agree(drawn, pose)


@pytest.mark.parametrize("name", ["office", "moving"])
def test_they_are_when_tiny_renderer_leaves_out_what_is_out_of_sight(name: str) -> None:
    world = world_of(name)
    with ReferenceRenderer(world, CameraModel()) as drawn:
        hidden = []
        for pose in free_poses(world, 6):
            agree(drawn, pose)
            hidden.append(set(drawn.scenery.out_of_sight))
        assert min(map(len, hidden)) > 0
        assert len(set(map(frozenset, hidden))) > 1


@pytest.mark.parametrize("pitch", [-0.4, 0.3, 0.9])
def test_they_are_for_cameras_that_look_up_or_down(pitch: float) -> None:
    world = world_of("clutter")
    with everything(world, CameraModel(pitch=pitch, hfov=1.9), supersample=2) as drawn:
        for pose in free_poses(world, 3):
            agree(drawn, pose)


def test_they_are_when_the_light_changes() -> None:
    world = world_of("rooms")
    with everything(world) as drawn:
        for light in (0.0, 0.37, 3.0):
            drawn.camera.adjust(light, hfov_error=0.05)
            agree(drawn, free_poses(world, 1)[0])


def test_they_are_when_things_come_move_and_go() -> None:
    world = world_of("office")
    thing = next(s for s in solids_of(world) if s.kind == "box")
    pose = Pose(thing.shape.x - 1.2, thing.shape.y + 0.1, 0.1)
    with everything(world) as drawn:
        walker = drawn.scenery.show_walker("walker", 0.25, 1.7, world.walls[0].texture)
        for x, yaw in ((0.9, 0.3), (0.5, 2.1), (0.31, -1.9)):
            turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
            drawn.scenery.place(walker, (pose.x + x, pose.y + 0.2, 0.85), turn)
            agree(drawn, pose)
        drawn.scenery.remove(walker)
        skin = drawn.scenery.cover([thing], 120.0)
        agree(drawn, pose)
        drawn.scenery.remove(skin)
        agree(drawn, pose)


def test_an_empty_raster_is_white() -> None:
    with everything(world_of("empty")) as drawn:
        shot = drawn.aim(Pose(0.0, 0.0, 0.0))
    picture = Raster().draw(*shot)
    assert (picture.rgb == 255).all()
    assert (depth_buffer(picture.depth, shot.projection) > 1.0 - 1e-6).all()


def test_the_reference_shows_what_a_simulation_shows() -> None:
    world, robot = world_of("office"), RobotModel()
    doors = tuple(door.model_copy(update={"state": "closed"}) for door in world.doors)
    texture = world.walls[0].texture
    # whoever walks along x shows the same side in both
    walker = MoverSpec(name="anna", path=((2.8, 3.2), (4.2, 3.2)), texture=texture)
    world = world.model_copy(update={"doors": doors, "movers": (walker,)})
    pose = Pose(1.5, 3.0, 0.1)
    sensors = SensorParams.preset("perfect")
    with (
        Simulation(world, robot, pose, 0, sensors) as simulation,
        ReferenceRenderer(world, robot.camera, sensors.supersample) as reference,
    ):
        for _ in range(2):
            seen = [simulation.render_from(p)[0] for p in (pose, Pose(1.5, 3.0, 0.6))]
            reference.put_walkers([(mover.x, mover.y) for mover in simulation.movers])
            for image, there in zip(seen, (pose, Pose(1.5, 3.0, 0.6)), strict=True):
                rgb, _, _ = reference.draw(reference.aim(there))
                np.testing.assert_array_equal(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), image)
            simulation.advance(1.0)
