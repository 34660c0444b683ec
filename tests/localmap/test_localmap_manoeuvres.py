"""Manoeuvres of bodies that cannot turn where they stand: driven in a grid, kept, and refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localmap_samples import ORIGIN, grid_with

from navfw.localmap import LocalGoal, OccupancyGrid
from navfw.localmap.local_planner import LocalPlanner
from navfw.localmap.ray_kernels import body_room
from navfw.robot import Footprint, RobotModel
from navfw.signals import Pose

LONG = RobotModel(footprint=Footprint(front=0.7, rear=0.3, width=0.7), track=0.6)
CORRIDOR = ((-3.0, 3.0, 0.75, 0.85), (-3.0, 3.0, -0.85, -0.75))
"""Walls of a corridor 1.5 m wide; the turning circle of LONG has a diameter of 1.57 m."""


def room_of(occupancy: OccupancyGrid, pose: Pose) -> float:
    """Distance [m] from the body's discs at ``pose`` to what is occupied."""
    cell = occupancy.params.cell
    ground = occupancy.clearance, occupancy.observed, *occupancy.origin, cell
    return body_room(ground, pose.x, pose.y, pose.yaw, np.array(occupancy.robot.discs), 0.0)


def drive(
    occupancy: OccupancyGrid, goal: tuple[float, float], most: int = 2000
) -> list[int | None]:
    """Drive without errors from the origin to 0.2 m from ``goal``, 5 ms a step; the gears used."""
    planner, pose = LocalPlanner(), ORIGIN
    gears: list[int | None] = []
    for _ in range(most):
        if math.dist((pose.x, pose.y), goal) < 0.2:
            return gears
        point = planner.plan(occupancy, pose, *goal)
        gears.append(point.gear)
        pose = moved(pose, point)
        assert room_of(occupancy, pose) > 0.0, pose
    raise AssertionError(f"not there, but at {pose}")


def moved(pose: Pose, point: LocalGoal) -> Pose:
    """``pose`` a step nearer to ``point``: a turn on the spot, or an arc of its gear."""
    if point.gear == 0:
        return Pose(pose.x, pose.y, pose.yaw + math.copysign(0.03, point.bearing))
    way = 0.02 * (point.gear or 1)
    turn = 2.0 * way * point.y / point.distance**2
    middle = pose.yaw + 0.5 * turn
    return Pose(pose.x + way * math.cos(middle), pose.y + way * math.sin(middle), pose.yaw + turn)


def test_a_turn_in_three_points_where_the_corridor_is_narrower_than_the_turning_circle() -> None:
    gears = drive(grid_with(*CORRIDOR, robot=LONG), (-1.5, 0.0))
    assert {-1, 1} <= set(gears) or set(gears) == {-1}


@pytest.mark.parametrize("width", [0.9, 1.0])
def test_out_of_a_door_into_a_corridor(width: float) -> None:
    side = 0.5 * width
    wall = (0.8, 0.9)
    occupancy = grid_with(
        (*wall, side, 3.0), (*wall, -3.0, -side), (2.4, 2.5, -3.0, 3.0), robot=LONG
    )
    assert drive(occupancy, (1.65, 2.0))


@settings(max_examples=20, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_no_pose_of_a_way_touches(x: float, y: float, box_x: float, box_y: float) -> None:
    box = box_x, box_x + 0.3, box_y, box_y + 0.3
    occupancy = grid_with(box, robot=LONG)
    if room_of(occupancy, ORIGIN) < 0.05:
        return
    planner = LocalPlanner()
    planner.plan(occupancy, ORIGIN, x, y)
    for a, b, yaw, _ in planner._manoeuvres._way:
        assert room_of(occupancy, Pose(a, b, yaw)) >= 0.03


def test_no_way_back_over_floor_that_was_not_observed() -> None:
    occupancy = grid_with(*CORRIDOR, robot=LONG)
    occupancy.log_odds[occupancy.log_odds < 0.0] = 0.0
    occupancy.update(ORIGIN, 0.0)
    point = LocalPlanner().plan(occupancy, ORIGIN, -1.5, 0.0)
    assert point.gear is None


def test_a_way_is_kept_until_it_is_barred() -> None:
    occupancy = grid_with(*CORRIDOR, robot=LONG)
    planner = LocalPlanner()
    planner.plan(occupancy, ORIGIN, -1.5, 0.0)
    way = planner._manoeuvres._way
    planner.plan(occupancy, ORIGIN, -1.5, 0.01)
    assert np.shares_memory(planner._manoeuvres._way, way)
    row, column = occupancy.index(-0.6, 0.0)
    occupancy.log_odds[row - 2 : row + 3, column - 2 : column + 3] = 3.0
    occupancy._forget_derived()
    planner.plan(occupancy, ORIGIN, -1.5, 0.0)
    assert not np.shares_memory(planner._manoeuvres._way, way)


def test_round_bodies_make_none() -> None:
    point = LocalPlanner().plan(grid_with(*CORRIDOR), ORIGIN, -1.5, 0.0)
    assert point.gear is None
