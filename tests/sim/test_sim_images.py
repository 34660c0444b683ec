"""Images equal those of PyBullet's TinyRenderer bit for bit; only invisible parts are culled."""

import functools
import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from navfw_benchmarks.bench.reference_renderer import ReferenceRenderer
from sim_worlds import PERFECT, free_poses, world_of

from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim import Simulation, simulation
from navfw.sim.camera import DepthImage
from navfw.sim.raster import Raster, depth_buffer
from navfw.sim.scenery import Scenery
from navfw.sim.shapes import Rectangle
from navfw.sim.solids import solids_of
from navfw.sim.visibility import PartBounds, Visibility, field_of_view
from navfw.sim.worldspec import WalkerSpec
from navfw.worldgen.generation import FAMILIES

WALL = Rectangle(2.0, 0.0, 0.1, 1.0)
EYE = np.array([0.0, 0.0, 0.35])


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


LEFT, RIGHT = Rectangle(2.0, 1.0, 0.1, 1.0), Rectangle(3.0, -1.0, 0.1, 1.05)
FAR = [(5.0, -1.0), (5.2, 1.0)]


@pytest.mark.parametrize(
    ("points", "walls", "half", "expected"),
    [
        ([(3.0, -0.5), (4.0, 0.5)], [WALL], math.pi, False),
        ([(1.0, -0.5), (1.5, 0.5)], [WALL], math.pi, True),
        ([(3.0, -0.5), (4.0, 2.5)], [WALL], math.pi, True),
        ([(1.5, -0.5), (4.0, 0.5)], [WALL], math.pi, True),  # part of it is in front
        ([(-3.0, -0.5), (-4.0, 0.5)], [WALL], math.pi, True),
        # a wall's own faces
        ([(1.9, -1.0), (1.9, 1.0)], [WALL], math.pi, True),
        ([(2.1, -1.0), (2.1, 1.0)], [WALL], math.pi, False),
        # two walls together; with a gap between them
        (FAR, [LEFT], math.pi, True),
        (FAR, [RIGHT], math.pi, True),
        (FAR, [LEFT, RIGHT], math.pi, False),
        (FAR, [LEFT, Rectangle(3.0, -1.1, 0.1, 1.05)], math.pi, True),
        # the field of view
        ([(-1.0, -0.5), (-2.0, 0.5)], [], 0.8, False),
        ([(0.5, 2.0), (1.0, 3.0)], [], 0.8, False),
        ([(0.5, 2.0), (3.0, 3.0)], [], 0.8, True),
        ([(-1.0, -1.0), (1.0, 1.0)], [], 0.8, True),  # the eye is inside the bounds
    ],
)
def test_parts_behind_walls_and_outside_the_field_of_view_are_invisible(
    points: list[tuple[float, float]], walls: list[Rectangle], half: float, expected: bool
) -> None:
    bounds = PartBounds.around(np.array(points))
    assert Visibility(walls, 2.0, [bounds]).visible(EYE, 0.0, half)[0] == expected


def test_wall_below_the_eye_does_not_occlude() -> None:
    bounds = PartBounds.around(np.array([(3.0, -0.5), (4.0, 0.5)]))
    assert Visibility([WALL], 0.3, [bounds]).visible(EYE, 0.0, math.pi)[0]


def test_one_sided_parts_are_invisible_from_behind() -> None:
    points = np.array([(3.0, -1.0), (3.0, 1.0)])
    for towards, expected in ((-1.0, True), (1.0, False)):
        bounds = PartBounds.around(points, math.pi / 2, (towards, 0.0, 0.0, towards * 3.0))
        assert Visibility([], 2.0, [bounds]).visible(EYE, 0.0, math.pi)[0] == expected


@given(st.floats(-math.pi, math.pi), st.floats(-0.6, 0.6), st.floats(-0.3, 0.3), st.data())
def test_field_of_view_contains_every_ray(
    yaw: float, pitch: float, roll: float, data: st.DataObject
) -> None:
    def about(axis: int, angle: float) -> Array:
        c, s = math.cos(angle), math.sin(angle)
        turn = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
        return turn

    axes = about(2, yaw) @ about(1, pitch) @ about(0, roll) @ CameraModel().base_from_camera
    middle, half = field_of_view(axes, 1.0, 0.75)
    x = data.draw(st.floats(-1.0, 1.0))
    y = data.draw(st.floats(-0.75, 0.75))
    ray = axes @ np.array([x, y, 1.0])
    off = math.remainder(math.atan2(ray[1], ray[0]) - middle, 2.0 * math.pi)
    assert abs(off) <= half


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["office", "empty", *FAMILIES])
@pytest.mark.parametrize("pitch", [0.0, 0.3])
def test_images_and_depth_are_the_same_as_without_culling(
    name: str, pitch: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = world_of(name, 3)
    robot = RobotModel(camera=CameraModel(pitch=pitch))
    poses = free_poses(world, 8, round(10 * pitch))

    def views() -> list[tuple[Image, DepthImage]]:
        with Simulation(world, robot, poses[0], 0, PERFECT) as sim:
            sim.advance(0.5)  # movers have left their start
            return [sim.render_from(pose) for pose in poses]

    culled = views()
    monkeypatch.setattr(simulation, "Scenery", functools.partial(Scenery, cull=False))
    for (image, depth), (whole, whole_depth) in zip(culled, views(), strict=True):
        np.testing.assert_array_equal(image, whole)
        np.testing.assert_array_equal(depth, whole_depth)
