"""Arcs, ranges and the local aim, against geometry worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.cost_kernels import cost_to_go
from navfw.localmap.free_distance import look_around, sweep
from navfw.localmap.local_planner import LocalPlanner
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.mofis.command_grid import CommandGrid
from navfw.robot import RobotModel
from navfw.signals import Pose

ROBOT = RobotModel()
GRID = CommandGrid(ROBOT)
STRAIGHT = GRID.w.size // 2
FAST = GRID.v.size - 1


def world(*things: tuple[float, float, float, float], seen: bool = True) -> OccupancyGrid:
    """An ego map around the origin with boxes (x from, x to, y from, y to) standing in it."""
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(Pose(0, 0, 0), 0.0)
    if seen:
        occupancy.log_odds[:] = -1.0
    for x0, x1, y0, y1 in things:
        r0, c0 = occupancy.index(x0, y0)
        r1, c1 = occupancy.index(x1, y1)
        occupancy.log_odds[r0 : r1 + 1, c0 : c1 + 1] = 3.0
    return occupancy


WALL_AHEAD = (1.0, 1.2, -3.0, 3.0)


def test_free_length_toward_a_wall() -> None:
    arcs = sweep(world(WALL_AHEAD), Pose(0, 0, 0), GRID, margin=0.04)
    expected = 1.0 - ROBOT.radius - 0.04
    assert arcs.free[FAST, STRAIGHT] == pytest.approx(expected, abs=0.06)
    assert np.all(arcs.free[GRID.v == 0.0] == arcs.reach)
    assert arcs.free[0, STRAIGHT] == arcs.reach  # backwards, away from it


def test_tight_curves_stay_short_of_the_wall() -> None:
    arcs = sweep(world(WALL_AHEAD), Pose(0, 0, 0), GRID, margin=0.0)
    slow = int(np.searchsorted(GRID.v, 0.05))
    radius = GRID.v[slow] / GRID.w[-1]
    assert 2 * radius < 1.0 - ROBOT.radius
    assert arcs.free[slow, -1] == arcs.reach


def test_an_arc_that_leads_away_from_a_touch_is_free() -> None:
    occupancy = world((0.2, 0.3, -1.0, 1.0))
    arcs = sweep(occupancy, Pose(0, 0, 0), GRID, margin=0.04)
    assert arcs.free[FAST, STRAIGHT] < 0.05
    assert arcs.free[0, STRAIGHT] == arcs.reach


def test_the_unseen_ends_what_is_known() -> None:
    occupancy = world(seen=False)
    arcs = sweep(occupancy, Pose(0, 0, 0), GRID, margin=0.0)
    assert arcs.free[FAST, STRAIGHT] == arcs.reach
    # the robot knows no more than its own place, and wants 0.1 m known beside its middle
    assert arcs.observed[FAST, STRAIGHT] == pytest.approx(ROBOT.radius - 0.1, abs=0.08)


def test_backwards_only_where_it_has_been_seen() -> None:
    arcs = sweep(world(seen=False), Pose(0, 0, 0), GRID, margin=0.0)
    assert arcs.free[0, STRAIGHT] == pytest.approx(0.0, abs=0.06)
    occupancy = world(seen=False)
    for k in range(1, 60):  # the trail behind is known
        occupancy.update(Pose(0.01 * k, 0, 0), 0.1 * k)
    arcs = sweep(occupancy, Pose(0.59, 0, 0), GRID, margin=0.0)
    assert 0.4 < arcs.free[0, STRAIGHT] < 0.7


def test_mirrored_worlds_give_mirrored_arcs() -> None:
    left = sweep(world((0.5, 0.9, 0.2, 0.8)), Pose(0, 0, 0), GRID, margin=0.04)
    right = sweep(world((0.5, 0.9, -0.8, -0.2)), Pose(0, 0, 0), GRID, margin=0.04)
    assert np.allclose(left.free, right.free[:, ::-1], atol=0.06)


@settings(max_examples=20, deadline=None)
@given(st.floats(-math.pi, math.pi))
def test_ranges_turn_with_the_robot(yaw: float) -> None:
    ranges = look_around(world(WALL_AHEAD), Pose(0, 0, yaw))
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


def test_the_aim_goes_round_what_stands_between() -> None:
    box = (0.8, 1.1, -0.5, 0.9)
    aim = LocalPlanner().aim(world(box), Pose(0, 0, 0), 2.0, 0.0)
    assert aim.reachable
    assert aim.bearing < -0.2  # the right side is the shorter way
    assert 0.6 < aim.distance < 1.0
    assert aim.detour > 1.05


@pytest.mark.parametrize("yaw", [0.9, -0.9])
def test_of_two_equal_ways_the_one_that_the_robot_faces(yaw: float) -> None:
    box = (0.5, 0.9, -0.45, 0.45)
    aim = LocalPlanner().aim(world(box), Pose(0, 0, yaw), 2.0, 0.0)
    assert aim.reachable
    assert abs(aim.bearing) < 0.6
    # a little longer on that side is no reason to turn right round
    longer = (0.5, 0.9, -0.45 - 0.1 * (yaw < 0), 0.45 + 0.1 * (yaw > 0))
    assert abs(LocalPlanner().aim(world(longer), Pose(0, 0, yaw), 2.0, 0.0).bearing) < 0.6


def test_a_way_that_is_much_longer_is_not_taken_for_the_sake_of_a_turn() -> None:
    longer = (0.5, 0.9, -0.45, 2.5)
    aim = LocalPlanner().aim(world(longer), Pose(0, 0, 0.9), 2.0, 0.0)
    assert aim.bearing < -0.6


def test_the_aim_straight_ahead_in_the_open() -> None:
    aim = LocalPlanner().aim(world(), Pose(0, 0, 0.3), 30.0, 0.0)  # beyond the map's border
    assert aim.reachable
    assert aim.bearing == pytest.approx(-0.3, abs=0.12)


def test_walled_in_there_is_no_way() -> None:
    cage = [(-1, 1, 0.9, 1), (-1, 1, -1, -0.9), (0.9, 1, -1, 1), (-1, -0.9, -1, 1)]
    aim = LocalPlanner().aim(world(*cage), Pose(0, 0, 0), 2.0, 0.0)
    assert not aim.reachable
    assert aim.bearing == pytest.approx(0.0, abs=1e-6)
