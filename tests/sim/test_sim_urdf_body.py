"""Robots with a URDF in PyBullet: they drive as commanded, and their contacts are noticed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfw.config import find
from navfw.numerics import Array
from navfw.robot import load_robot
from navfw.signals import Pose, Twist
from navfw.sim import BoxSpec, SensorParams, Simulation, WorldSpec, load_world

EMPTY = load_world(find("world", "empty"))
START = Pose(0.5 * sum(EMPTY.x), 0.5 * sum(EMPTY.y), 0.4)


def drive(
    name: str, twist: Twist, seconds: float, world: WorldSpec = EMPTY, start: Pose = START
) -> tuple[Array, tuple[float, float], set[str]]:
    """True poses (n, 3) at 60 Hz, the wheels' way [m], and what was touched."""
    robot = load_robot(name)
    poses, touched = [], set()
    with Simulation(world, robot, start, 0, SensorParams.preset("perfect")) as simulation:
        begun = simulation.read().encoders
        for tick in range(round(seconds * 60)):
            ramp = min(1.0, tick / 20)
            simulation.drive(*(ramp * speed for speed in robot.wheel_speeds(twist)))
            simulation.advance(1.0 / 60.0)
            reading = simulation.read()
            pose = simulation.true_pose()
            poses.append((pose.x, pose.y, pose.yaw))
            touched |= set(simulation.contacts)
    per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
    left = (reading.encoders.left - begun.left) * per_tick
    right = (reading.encoders.right - begun.right) * per_tick
    return np.array(poses), (left, right), touched


@pytest.mark.parametrize("name", ["cart", "husky", "racecar"])
def test_it_drives_straight_and_its_encoders_measure_the_way(name: str) -> None:
    poses, (left, right), touched = drive(name, Twist(0.4, 0.0), 2.0)
    way = math.dist(poses[-1, :2], (START.x, START.y))
    assert way == pytest.approx(0.73, abs=0.04)
    assert left == pytest.approx(way, rel=0.03)
    assert right == pytest.approx(way, rel=0.03)
    assert poses[-1, 2] == pytest.approx(START.yaw, abs=0.02)
    assert not touched


@pytest.mark.parametrize(("name", "spread"), [("cart", 0.02), ("husky", 0.12), ("racecar", 0.08)])
def test_it_turns_on_the_spot_as_fast_as_commanded(name: str, spread: float) -> None:
    poses, _, touched = drive(name, Twist(0.0, 0.8), 4.0)
    late = poses[60:]
    turned = np.unwrap(late[:, 2])
    assert (turned[-1] - turned[0]) * 60 / (len(late) - 1) == pytest.approx(0.8, rel=spread)
    # base_link is where it turns: the turn of a skid steer does not carry it away
    assert np.hypot(*(late[:, :2] - late[0, :2]).T).max() < 0.08
    assert not touched


def test_a_contact_of_any_link_is_a_collision() -> None:
    ahead = START.to_parent(1.2, 0.0)
    box = BoxSpec(name="crate", at=ahead, size=(0.2, 0.2, 0.5), yaw=START.yaw)
    world = EMPTY.model_copy(update={"boxes": (box,)})
    _, _, touched = drive("husky", Twist(0.5, 0.0), 3.0, world)
    assert touched == {"crate"}


def test_the_same_commands_give_the_same_motion() -> None:
    first, second = (drive("husky", Twist(0.2, 0.6), 1.0)[0] for _ in range(2))
    assert np.array_equal(first, second)
