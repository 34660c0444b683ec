"""Drops: the remaining floor, their depth images, the robot's fall."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sim_worlds import drive

from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import (
    DropSpec,
    SceneGeometry,
    Simulation,
    WorldSpec,
    floor_pieces,
    treads_of,
)

PIT = {"name": "pit", "x": [3, 4], "y": [1, 2], "depth": 0.8}


def hall(**drop: Any) -> WorldSpec:
    """A walled hall of 6 x 3 m with one drop in its middle."""
    return WorldSpec.model_validate(
        {
            "name": "hall",
            "x": [0, 6],
            "y": [0, 3],
            "walls": [{"name": "wall", "points": [[0, 0], [6, 0], [6, 3], [0, 3], [0, 0]]}],
            "drops": [PIT | drop],
        }
    )


@pytest.mark.parametrize("down", ["east", "west", "north", "south"])
@pytest.mark.parametrize("steps", [0, 3])
def test_robot_that_drives_into_a_drop_falls(down: str, steps: int) -> None:
    world = hall(steps=steps, down=down)
    with Simulation(world, RobotModel(), Pose(2.0, 1.5, 0.0), 0) as simulation:
        drive(simulation, 8.0, 8.0, 8.0, until_contact=True)
        assert simulation.contacts == ("pit",)
        assert simulation.collision_cause == "robot"
        # wheels or a caster have just passed the rim
        assert 2.8 < simulation.true_pose().x < 3.15


def test_robot_that_drives_past_a_drop_does_not_fall() -> None:
    with Simulation(hall(), RobotModel(), Pose(2.0, 0.6, 0.0), 0) as simulation:
        drive(simulation, 8.0, 8.0, 8.0)
        assert simulation.contacts == ()
        assert simulation.true_pose().x == pytest.approx(5.2, abs=0.1)
        assert simulation.true_pose().y == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize(("steps", "down"), [(0, "east"), (4, "east"), (4, "west"), (3, "north")])
@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_depth_image_shows_the_treads_through_the_hole(steps: int, down: str, yaw: float) -> None:
    world = hall(steps=steps, down=down)
    robot = RobotModel()
    eye = Pose(2.0, 1.5 - 1.4 * math.sin(yaw), yaw)
    with Simulation(world, robot, Pose(1.0, 1.5, 0.0), seed=0) as simulation:
        _, depth = simulation.render_from(eye)
    camera = robot.camera
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    x, y = u + 0.5 - camera.width / 2, v + 0.5 - camera.height / 2
    ray = np.stack([x / camera.focal, y / camera.focal, np.ones_like(x)], -1)
    ray = ray @ camera.base_from_camera.T
    c, s = math.cos(yaw), math.sin(yaw)
    east, north = c * ray[..., 0] - s * ray[..., 1], s * ray[..., 0] + c * ray[..., 1]
    x0, y0 = eye.x + c * camera.mount_forward, eye.y + s * camera.mount_forward
    floor = camera.mount_height / np.maximum(-ray[..., 2], 1e-6)
    over_x, over_y = x0 + floor * east, y0 + floor * north
    rim = 0.06  # pixels at the rim may have either depth
    drop = world.drops[0]
    hole = (np.abs(over_x - 3.5) < 0.5 - rim) & (np.abs(over_y - 1.5) < 0.5 - rim)
    assert hole.sum() > 100
    # march along the rays that enter the hole until they meet a tread or a side
    far = np.linspace(0.3, 5.0, 1500)
    px = x0 + far * east[hole][:, None]
    py = y0 + far * north[hole][:, None]
    pz = camera.mount_height + far * ray[hole][:, 2][:, None]
    solid = pz < 0.0
    for tread in treads_of(drop):
        within = (px > tread.x[0]) & (px < tread.x[1]) & (py > tread.y[0]) & (py < tread.y[1])
        solid &= ~(within & (pz > -tread.depth))
    expected = far[np.argmax(solid, axis=1)]
    error = np.abs(depth[hole] - expected)
    assert np.median(error) < 0.01
    assert np.mean(error < 0.05) > 0.93
    beside = (floor > 0.6) & (over_x > 2.2) & (over_x < 2.9) & (np.abs(over_y - 1.5) < 0.8)
    assert np.allclose(depth[beside], floor[beside], atol=0.03)


@given(
    st.lists(st.floats(0.0, 10.0), min_size=4, max_size=4, unique=True),
    st.lists(st.floats(0.0, 8.0), min_size=4, max_size=4, unique=True),
)
def test_floor_and_drops_cover_the_world_once(xs: list[float], ys: list[float]) -> None:
    xs, ys = sorted(round(x, 2) for x in xs), sorted(round(y, 2) for y in ys)
    if len({*xs}) < 4 or len({*ys}) < 4:
        return
    drops = tuple(DropSpec(name=f"{i}", x=(xs[i], xs[i + 1]), y=(ys[i], ys[i + 1])) for i in (0, 2))
    world = WorldSpec(name="plain", x=(0.0, 10.0), y=(0.0, 8.0), drops=drops)
    rng = np.random.default_rng(0)
    points = rng.uniform((0, 0), (10, 8), (200, 2))
    inside = sum((piece.distance(points) < 0.0).astype(int) for piece in floor_pieces(world))
    for drop in drops:
        for tread in treads_of(drop):
            inside = inside + (tread.rectangle.distance(points) < 0.0)
    assert np.all(np.asarray(inside) == 1)


def test_shortest_path_leads_around_drops() -> None:
    free = SceneGeometry.from_world(hall().model_copy(update={"drops": ()}))
    plan = SceneGeometry.from_world(hall())
    assert plan.clearance(3.5, 1.5) == pytest.approx(-0.5)
    assert plan.clearance(2.7, 1.5) == pytest.approx(0.3)
    straight, _ = free.shortest_path((1.0, 1.5), (5.0, 1.5), 0.18)
    around, corners = plan.shortest_path((1.0, 1.5), (5.0, 1.5), 0.18)
    assert straight == pytest.approx(4.0)
    assert around > 4.2
    assert plan.clearances(corners).min() > 0.179
