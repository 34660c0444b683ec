"""Free distance along arcs and all around, against geometry done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localmap_samples import ORIGIN, ROBOT, WALL_AHEAD, grid_with

from navfw.context import CommandGrid
from navfw.localmap.free_distance import Arcs, arcs_of, free_distance, ranges_around
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.signals import Pose, Twist

COMMANDS = CommandGrid(ROBOT)
STRAIGHT = COMMANDS.w.size // 2
FASTEST = COMMANDS.v.size - 1


def arcs(occupancy: OccupancyGrid, pose: Pose = ORIGIN, margin: float = 0.04) -> Arcs:
    return arcs_of(occupancy, pose, COMMANDS.v, COMMANDS.w, margin)


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


def test_free_distance_of_a_twist_is_that_of_its_arc() -> None:
    occupancy = grid_with(WALL_AHEAD)
    ahead = free_distance(occupancy, ORIGIN, Twist(0.3, 0.0))
    assert ahead.contact == pytest.approx(1.0 - ROBOT.radius, abs=0.06)
    assert ahead.unobserved > ahead.contact - 1e-9
    assert free_distance(occupancy, ORIGIN, Twist(-0.1, 0.0)) == (1.0, 1.0)
    assert free_distance(occupancy, ORIGIN, Twist(0.0, 1.0)) == (1.0, 1.0)
