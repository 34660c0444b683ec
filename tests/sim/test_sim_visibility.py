"""Visibility culling: only invisible parts are culled, images are the same without it."""

from __future__ import annotations

import functools
import math
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.config import find
from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose
from navfw.sim import (
    DepthImage,
    PartBounds,
    Rectangle,
    SceneGeometry,
    Scenery,
    SensorParams,
    Simulation,
    Visibility,
    WorldSpec,
    field_of_view,
    load_world,
    simulation,
)
from navfw.worldgen import FAMILIES, generate

ROBOT = RobotModel()
WALL = Rectangle(2.0, 0.0, 0.1, 1.0)
EYE = np.array([0.0, 0.0, 0.35])


def visible(points: list[tuple[float, float]], *walls: Rectangle, half: float = math.pi) -> bool:
    bounds = PartBounds.around(np.array(points))
    return bool(Visibility(walls, 2.0, [bounds]).visible(EYE, 0.0, half)[0])


def test_wall_occludes_parts_behind_it() -> None:
    assert not visible([(3.0, -0.5), (4.0, 0.5)], WALL)
    assert visible([(1.0, -0.5), (1.5, 0.5)], WALL)
    assert visible([(3.0, -0.5), (4.0, 2.5)], WALL)
    assert visible([(1.5, -0.5), (4.0, 0.5)], WALL), "part of it is in front"
    assert visible([(-3.0, -0.5), (-4.0, 0.5)], WALL)


def test_walls_occlude_together() -> None:
    part = [(5.0, -1.0), (5.2, 1.0)]
    left, right = Rectangle(2.0, 1.0, 0.1, 1.0), Rectangle(3.0, -1.0, 0.1, 1.05)
    assert visible(part, left)
    assert visible(part, right)
    assert not visible(part, left, right)
    assert visible(part, left, Rectangle(3.0, -1.1, 0.1, 1.05)), "there is a gap between them"


def test_wall_does_not_occlude_its_own_face() -> None:
    assert visible([(1.9, -1.0), (1.9, 1.0)], WALL)
    assert not visible([(2.1, -1.0), (2.1, 1.0)], WALL)


def test_wall_below_the_eye_does_not_occlude() -> None:
    bounds = PartBounds.around(np.array([(3.0, -0.5), (4.0, 0.5)]))
    assert Visibility([WALL], 0.3, [bounds]).visible(EYE, 0.0, math.pi)[0]


def test_parts_outside_the_field_of_view_are_invisible() -> None:
    assert not visible([(-1.0, -0.5), (-2.0, 0.5)], half=0.8)
    assert not visible([(0.5, 2.0), (1.0, 3.0)], half=0.8)
    assert visible([(0.5, 2.0), (3.0, 3.0)], half=0.8)
    assert visible([(-1.0, -1.0), (1.0, 1.0)], half=0.8), "the eye is inside the bounds"


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

    axes = about(2, yaw) @ about(1, pitch) @ about(0, roll) @ ROBOT.camera.base_from_camera
    middle, half = field_of_view(axes, 1.0, 0.75)
    x = data.draw(st.floats(-1.0, 1.0))
    y = data.draw(st.floats(-0.75, 0.75))
    ray = axes @ np.array([x, y, 1.0])
    off = math.remainder(math.atan2(ray[1], ray[0]) - middle, 2.0 * math.pi)
    assert abs(off) <= half


def world_of(name: str) -> WorldSpec:
    if name in FAMILIES:
        return generate(name, 3, 0.6).world
    return load_world(find("world", name))


def free_pose(plan: SceneGeometry, rng: np.random.Generator) -> Pose:
    x0, y0, x1, y1 = plan.bounds
    while True:
        x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
        if plan.clearance(x, y) > 0.25:
            return Pose(x, y, rng.uniform(-math.pi, math.pi))


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["office", "empty", *FAMILIES])
@pytest.mark.parametrize("pitch", [0.0, 0.3])
def test_images_and_depth_are_the_same_as_without_culling(
    name: str, pitch: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = world_of(name)
    robot = RobotModel(camera=CameraModel(pitch=pitch))
    rng = np.random.default_rng([zlib.crc32(name.encode()), round(10 * pitch)])
    plan = SceneGeometry.from_world(world, robot.height)
    poses = [free_pose(plan, rng) for _ in range(8)]

    def views() -> list[tuple[Image, DepthImage]]:
        with Simulation(world, robot, poses[0], 0, SensorParams.preset("perfect")) as sim:
            sim.advance(0.5)  # movers have left their start
            return [sim.render_from(pose) for pose in poses]

    culled = views()
    monkeypatch.setattr(simulation, "Scenery", functools.partial(Scenery, cull=False))
    for (image, depth), (whole, whole_depth) in zip(culled, views(), strict=True):
        np.testing.assert_array_equal(image, whole)
        np.testing.assert_array_equal(depth, whole_depth)
