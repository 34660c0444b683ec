"""Images equal those of PyBullet's TinyRenderer bit for bit."""

import math

import cv2
import numpy as np
import pytest
from navfw_benchmarks.bench.reference_renderer import ReferenceRenderer
from sim_worlds import PERFECT, free_poses, world_of

from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim import Simulation
from navfw.sim.raster import Raster, depth_buffer
from navfw.sim.solids import solids_of
from navfw.sim.worldspec import WalkerSpec
from navfw.worldgen.generation import FAMILIES


def agree(reference: ReferenceRenderer, pose: Pose) -> None:
    """Assert that the raster and PyBullet render the same image and depth from ``pose``."""
    request = reference.request(pose)
    drawn, depth = reference.scenery.raster.draw(request)
    rgb, raw, _ = reference.draw(request)
    np.testing.assert_array_equal(drawn, rgb)
    np.testing.assert_array_equal(depth_buffer(depth, request.projection), raw)


PITCHED = [("clutter", 3, CameraModel(pitch=pitch, hfov=1.9), 2) for pitch in (-0.4, 0.3, 0.9)]


@pytest.mark.parametrize(
    ("name", "views", "camera", "supersample"),
    [*((name, 6, CameraModel(), 1) for name in ("office", "empty", *FAMILIES)), *PITCHED],
)
def test_images_equal_tiny_renderer(
    name: str, views: int, camera: CameraModel, supersample: int
) -> None:
    world = world_of(name, 5)
    with ReferenceRenderer(world, camera, supersample) as drawn:
        for pose in free_poses(world, views):
            agree(drawn, pose)


def test_images_equal_tiny_renderer_when_the_light_changes() -> None:
    world = world_of("rooms", 5)
    with ReferenceRenderer(world, CameraModel()) as drawn:
        for light in (0.0, 0.37, 3.0):
            drawn.camera.set_optics(light, hfov_error=0.05)
            agree(drawn, free_poses(world, 1)[0])


def test_images_equal_tiny_renderer_when_bodies_are_added_moved_and_removed() -> None:
    world = world_of("office", 5)
    box = next(s for s in solids_of(world) if s.kind == "box")
    pose = Pose(box.shape.x - 1.2, box.shape.y + 0.1, 0.1)
    with ReferenceRenderer(world, CameraModel()) as drawn:
        walker = WalkerSpec(name="mover", path=((0, 0), (1, 1)), texture=world.walls[0].texture)
        mover = drawn.scenery.add_walker(walker)
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
    with ReferenceRenderer(world_of("empty", 5), CameraModel()) as drawn:
        request = drawn.request(Pose(0.0, 0.0, 0.0))
    rgb, depth = Raster().draw(request)
    assert (rgb == 255).all()
    assert (depth_buffer(depth, request.projection) > 1.0 - 1e-6).all()


def test_reference_equals_the_images_of_a_simulation() -> None:
    world, robot = world_of("office", 5), RobotModel()
    doors = tuple(door.model_copy(update={"state": "closed"}) for door in world.doors)
    texture = world.walls[0].texture
    # a mover with heading 0 has the same orientation in both
    mover = WalkerSpec(name="anna", path=((2.8, 3.2), (4.2, 3.2)), texture=texture)
    world = world.model_copy(update={"doors": doors, "movers": (mover,)})
    pose = Pose(1.5, 3.0, 0.1)
    with (
        Simulation(world, robot, pose, 0, PERFECT) as simulation,
        ReferenceRenderer(world, robot.camera) as reference,
    ):
        for _ in range(2):
            seen = [simulation.render_from(p)[0] for p in (pose, Pose(1.5, 3.0, 0.6))]
            reference.place_walkers([(mover.x, mover.y) for mover in simulation.walkers])
            for image, at in zip(seen, (pose, Pose(1.5, 3.0, 0.6)), strict=True):
                rgb, _, _ = reference.draw(reference.request(at))
                np.testing.assert_array_equal(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), image)
            simulation.advance(1.0)
