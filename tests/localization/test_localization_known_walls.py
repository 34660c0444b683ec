"""Walls of the floor plan around the robot, seen from where it believes itself to be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.localization import SURE_XY, SURE_YAW, KnownWalls
from navfw.robot import Footprint, RobotModel
from navfw.signals import Belief, Pose
from navfw.topomap import FREE, OCCUPIED, OccupancyMap

CELLS = np.full((100, 200), FREE, np.int8)
CELLS[40:46, 20:180] = OCCUPIED
PLAN = OccupancyMap(CELLS, 0.05, Pose(-2.0, 1.0, 0.0))
"""A wall 0.3 m thick from (-1, 3) to (7, 3.3)."""
SURE = Belief(0.0, Pose(1.0, 2.0, 0.5 * math.pi), np.diag([0.02, 0.02, 0.02]) ** 2)


def test_walls_are_where_the_robot_sees_them() -> None:
    odom = Pose(10.0, 0.0, 0.0)  # the wall, 1 m ahead, runs across
    points = KnownWalls(PLAN).around(SURE, odom)
    assert np.abs(points - (10.0, 0.0)).max() <= 2.0
    assert points[:, 0].min() == pytest.approx(11.0, abs=0.03)
    assert points[:, 0].max() == pytest.approx(11.3, abs=0.03)
    middle = points[np.abs(points[:, 1]) < 1.9]
    assert len(middle) == 2 * 76, "the surfaces alone, one point a cell"
    turned = KnownWalls(PLAN).around(SURE, Pose(10.0, 0.0, 0.5 * math.pi))
    assert np.allclose(turned, np.column_stack([10.0 - points[:, 1], points[:, 0] - 10.0]))


@pytest.mark.parametrize(
    "belief",
    [
        replace(SURE, lost=True),
        replace(SURE, covariance=np.diag([1.1 * SURE_XY, 0.0, 0.0]) ** 2),
        replace(SURE, covariance=np.diag([0.0, 0.0, 1.1 * SURE_YAW]) ** 2),
        replace(SURE, pose=Pose(50.0, 2.0, 0.0)),
    ],
    ids=["lost", "position unsure", "heading unsure", "far off"],
)
def test_no_walls_are_known_without_a_pose(belief: Belief) -> None:
    assert KnownWalls(PLAN).around(belief, Pose(0.0, 0.0, 0.0)).shape == (0, 2)


def test_only_bodies_that_are_not_round_need_them() -> None:
    cart = RobotModel(footprint=Footprint(front=0.5, rear=0.1, width=0.3), track=0.2)
    assert KnownWalls.of(PLAN, cart) is not None
    assert KnownWalls.of(None, cart) is None
    assert KnownWalls.of(PLAN, RobotModel()) is None


@given(*[st.floats(-5.0, 5.0)] * 5)
def test_points_and_poses_are_moved_alike(
    x: float, y: float, yaw: float, a: float, b: float
) -> None:
    pose, points = Pose(x, y, yaw), np.array([[a, b], [b, a]])
    local = pose.points_to_local(points)
    assert np.allclose(local, [pose.to_local(*point) for point in points.tolist()])
    assert np.allclose(pose.points_to_parent(local), points)
