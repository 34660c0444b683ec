"""Free distance along arcs and all around, and the local goal, against geometry done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.context import CommandGrid
from navfw.localmap.cost_kernels import cost_to_go
from navfw.localmap.free_distance import Arcs, arcs_of, free_distance, ranges_around
from navfw.localmap.local_planner import LocalPlanner
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.robot import RobotModel
from navfw.signals import Pose, Twist

ROBOT = RobotModel()
COMMANDS = CommandGrid(ROBOT)
STRAIGHT = COMMANDS.w.size // 2
FASTEST = COMMANDS.v.size - 1
ORIGIN = Pose(0, 0, 0)


def grid_with(*boxes: tuple[float, float, float, float], observed: bool = True) -> OccupancyGrid:
    """A grid around the origin with occupied ``boxes`` (x from, x to, y from, y to) [m].

    All other cells are observed free, or unobserved but for the footprint of the robot.
    """
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(ORIGIN, 0.0)
    if observed:
        occupancy.log_odds[:] = -1.0
    for x0, x1, y0, y1 in boxes:
        r0, c0 = occupancy.index(x0, y0)
        r1, c1 = occupancy.index(x1, y1)
        occupancy.log_odds[r0 : r1 + 1, c0 : c1 + 1] = 3.0
    return occupancy


def arcs(occupancy: OccupancyGrid, pose: Pose = ORIGIN, margin: float = 0.04) -> Arcs:
    return arcs_of(occupancy, pose, COMMANDS.v, COMMANDS.w, margin)


WALL_AHEAD = (1.0, 1.2, -3.0, 3.0)


def test_free_length_toward_a_wall() -> None:
    toward = arcs(grid_with(WALL_AHEAD))
    expected = 1.0 - ROBOT.radius - 0.04
    assert toward.free[FASTEST, STRAIGHT] == pytest.approx(expected, abs=0.06)
    assert np.all(toward.free[COMMANDS.v == 0.0] == toward.reach)
    assert toward.free[0, STRAIGHT] == toward.reach  # backwards, away from the wall


def test_tight_curves_stay_short_of_the_wall() -> None:
    curves = arcs(grid_with(WALL_AHEAD), margin=0.0)
    slow = int(np.searchsorted(COMMANDS.v, 0.05))
    radius = COMMANDS.v[slow] / COMMANDS.w[-1]
    assert 2 * radius < 1.0 - ROBOT.radius
    assert curves.free[slow, -1] == curves.reach


def test_an_arc_that_leads_away_from_contact_is_free() -> None:
    touching = arcs(grid_with((0.2, 0.3, -1.0, 1.0)))
    assert touching.free[FASTEST, STRAIGHT] < 0.05
    assert touching.free[0, STRAIGHT] == touching.reach


def test_unobserved_cells_end_the_observed_length() -> None:
    unobserved = arcs(grid_with(observed=False), margin=0.0)
    assert unobserved.free[FASTEST, STRAIGHT] == unobserved.reach
    # only the footprint is observed, and 0.1 m beside the centre have to be
    expected = ROBOT.radius - 0.1
    assert unobserved.observed[FASTEST, STRAIGHT] == pytest.approx(expected, abs=0.08)


def test_backward_arcs_are_free_over_observed_floor_alone() -> None:
    occupancy = grid_with(observed=False)
    assert arcs(occupancy, margin=0.0).free[0, STRAIGHT] == pytest.approx(0.0, abs=0.06)
    for k in range(1, 60):  # the footprint leaves a trail of observed floor behind
        occupancy.update(Pose(0.01 * k, 0, 0), 0.1 * k)
    behind = arcs(occupancy, Pose(0.59, 0, 0), margin=0.0)
    assert 0.4 < behind.free[0, STRAIGHT] < 0.7


def test_mirrored_grids_give_mirrored_arcs() -> None:
    left = arcs(grid_with((0.5, 0.9, 0.2, 0.8)))
    right = arcs(grid_with((0.5, 0.9, -0.8, -0.2)))
    assert np.allclose(left.free, right.free[:, ::-1], atol=0.06)


@settings(max_examples=20, deadline=None)
@given(st.floats(-math.pi, math.pi))
def test_ranges_turn_with_the_robot(yaw: float) -> None:
    ranges = ranges_around(grid_with(WALL_AHEAD), Pose(0, 0, yaw))
    toward = int(np.argmin(np.abs(np.angle(np.exp(1j * (ranges.bearings + yaw))))))
    off = float(np.angle(np.exp(1j * (ranges.bearings[toward] + yaw))))
    expected = 1.0 / math.cos(off) - ROBOT.radius
    assert ranges.free[toward] == pytest.approx(expected, abs=0.08)
    assert ranges.limit - ROBOT.radius <= ranges.free.max() <= ranges.limit


def test_cost_to_go_in_the_open_is_the_distance() -> None:
    n = 61
    value = np.full((n, n), np.inf)
    value[30, 30] = 0.0
    cost_to_go(np.ones((n, n)), value, 24)
    rows, columns = np.indices((n, n))
    true = np.hypot(rows - 30, columns - 30)
    assert np.all(value >= true - 1e-6)
    # first order: the error at the source is of the order of a cell and does not grow much
    assert np.max(value - true) < 2.0


def test_cost_to_go_leads_round_a_wall() -> None:
    n = 41
    cost = np.ones((n, n))
    cost[20, 5:] = np.inf
    value = np.full((n, n), np.inf)
    value[30, 35] = 0.0
    cost_to_go(cost, value, 60)
    assert np.all(np.isinf(value[20, 5:]))
    # round the wall's end at column 4
    shortest = math.hypot(30 - 20, 35 - 4) + math.hypot(20 - 10, 35 - 4)
    assert value[10, 35] == pytest.approx(shortest, rel=0.08)


def test_the_local_goal_leads_round_an_obstacle() -> None:
    box = (0.8, 1.1, -0.5, 0.9)
    goal = LocalPlanner().plan(grid_with(box), ORIGIN, 2.0, 0.0)
    assert goal.reachable
    assert goal.bearing < -0.2  # the way on the right is shorter
    assert 0.6 < goal.distance < 1.0
    assert goal.detour > 1.05


@pytest.mark.parametrize("yaw", [0.9, -0.9])
def test_of_two_equal_ways_the_one_that_the_robot_faces(yaw: float) -> None:
    box = (0.5, 0.9, -0.45, 0.45)
    goal = LocalPlanner().plan(grid_with(box), Pose(0, 0, yaw), 2.0, 0.0)
    assert goal.reachable
    assert abs(goal.bearing) < 0.6
    # a slightly longer way on that side does not make the robot turn round
    longer = (0.5, 0.9, -0.45 - 0.1 * (yaw < 0), 0.45 + 0.1 * (yaw > 0))
    assert abs(LocalPlanner().plan(grid_with(longer), Pose(0, 0, yaw), 2.0, 0.0).bearing) < 0.6


def test_a_much_longer_way_does_not_save_a_turn() -> None:
    longer = (0.5, 0.9, -0.45, 2.5)
    goal = LocalPlanner().plan(grid_with(longer), Pose(0, 0, 0.9), 2.0, 0.0)
    assert goal.bearing < -0.6


def test_the_local_goal_is_straight_ahead_in_the_open() -> None:
    goal = LocalPlanner().plan(grid_with(), Pose(0, 0, 0.3), 30.0, 0.0)  # beyond the grid's border
    assert goal.reachable
    assert goal.bearing == pytest.approx(-0.3, abs=0.12)


def test_between_four_walls_no_way_is_reachable() -> None:
    cage = [(-1, 1, 0.9, 1), (-1, 1, -1, -0.9), (0.9, 1, -1, 1), (-1, -0.9, -1, 1)]
    goal = LocalPlanner().plan(grid_with(*cage), ORIGIN, 2.0, 0.0)
    assert not goal.reachable
    assert goal.bearing == pytest.approx(0.0, abs=1e-6)


def test_free_distance_of_a_twist_is_that_of_its_arc() -> None:
    occupancy = grid_with(WALL_AHEAD)
    ahead = free_distance(occupancy, ORIGIN, Twist(0.3, 0.0))
    assert ahead.contact == pytest.approx(1.0 - ROBOT.radius, abs=0.06)
    assert ahead.unobserved > ahead.contact - 1e-9
    assert free_distance(occupancy, ORIGIN, Twist(-0.1, 0.0)) == (1.0, 1.0)
    assert free_distance(occupancy, ORIGIN, Twist(0.0, 1.0)) == (1.0, 1.0)
