"""Free distances of a body that is not round: its length counts, and turning needs room."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from localmap_samples import CART, ORIGIN, grid_with

from navfw.context import CommandGrid
from navfw.localmap import OccupancyGrid
from navfw.localmap.free_distances import arcs_of, free_distance, free_turn, ranges_around
from navfw.robot import Footprint, RobotModel
from navfw.signals import Pose, Twist

COMMANDS = CommandGrid(CART)
AHEAD = Twist(0.3, 0.0)
occupancy_with = partial(grid_with, robot=CART)


@given(st.floats(0.05, 1.0), st.floats(0.05, 1.0), st.floats(0.1, 1.0), st.floats(0, 1))
def test_the_discs_cover_the_rim(front: float, rear: float, width: float, share: float) -> None:
    robot = RobotModel(footprint=Footprint(front=front, rear=rear, width=width), track=0.05)
    across = -0.5 * width + share * width
    along = -rear + share * (front + rear)
    for point in ((front, across), (-rear, across), (along, 0.5 * width), (along, -0.5 * width)):
        assert min(math.hypot(point[0] - x, point[1] - y) - r for x, y, r in robot.discs) <= 1e-9
        assert math.hypot(*point) <= robot.reach + 1e-9
    beyond = [max(x + r - front, y + r - 0.5 * width) for x, y, r in robot.discs]
    assert max(beyond) <= 0.085 * robot.radius + 1e-9


def test_a_round_robot_is_one_disc() -> None:
    robot = RobotModel(radius=0.2)
    assert (robot.discs, robot.disc_radius, robot.reach) == (((0.0, 0.0, 0.2),), 0.2, 0.2)


def test_the_nose_ends_the_way_ahead() -> None:
    occupancy = occupancy_with((1.0, 1.2, -1.0, 1.0))
    assert free_distance(occupancy, ORIGIN, AHEAD).contact == pytest.approx(0.5, abs=0.07)
    away = Pose(0.0, 0.0, math.pi)
    assert free_distance(occupancy, away, Twist(-0.3, 0.0)).contact == pytest.approx(0.9, abs=0.07)


def test_a_passage_of_its_width_is_free_along_and_barred_across() -> None:
    occupancy = occupancy_with((0.2, 1.6, 0.26, 0.4), (0.2, 1.6, -0.4, -0.26))
    assert free_distance(occupancy, ORIGIN, AHEAD).contact == 1.0
    assert free_turn(occupancy, ORIGIN, 1.0) < 0.3
    assert free_turn(occupancy_with(), ORIGIN, 1.0) == math.inf


def test_only_the_turn_that_leads_to_the_wall_is_barred() -> None:
    occupancy = occupancy_with((-1.0, 1.5, 0.22, 0.4))
    assert free_turn(occupancy, ORIGIN, 1.0) < 0.2
    assert free_turn(occupancy, ORIGIN, -1.0) == math.inf
    arcs = arcs_of(occupancy, ORIGIN, COMMANDS.v, COMMANDS.w, 0.0)
    standing = arcs.free[COMMANDS.v == 0.0][0]
    assert standing[-1] < 0.5 * arcs.reach
    # the whole reach stands for half a radian
    expected = arcs.reach * free_turn(occupancy, ORIGIN, COMMANDS.w.max()) / 0.5
    assert standing[-1] == pytest.approx(expected, abs=0.1 * arcs.reach)
    assert standing[0] == arcs.reach


def test_a_turn_keeps_out_of_the_far_side_of_a_wall() -> None:
    occupancy = occupancy_with((-1.0, 1.0, 0.6, 0.6))
    slanting = Pose(0.0, 0.0, 1.0)
    assert free_turn(occupancy, slanting, 1.0) == math.inf
    ahead = free_distance(occupancy, slanting, AHEAD).contact
    (first, _), (last, _) = occupancy.index(0.0, 0.4), occupancy.index(0.0, 0.55)
    occupancy = occupancy_with((-1.0, 1.0, 0.6, 0.6))
    occupancy.log_odds[first : last + 1] = 0.0  # between the body and what is seen of the wall
    assert free_turn(occupancy, slanting, 1.0) < 0.4
    assert free_distance(occupancy, slanting, AHEAD).contact == pytest.approx(ahead)


def test_known_walls_count_where_the_camera_does_not_look() -> None:
    occupancy = occupancy_with()
    (first, _), (last, _) = occupancy.index(0.0, 0.2), occupancy.index(0.0, 0.6)
    occupancy.log_odds[first : last + 1] = 0.0  # beside the body nothing is observed
    assert free_turn(occupancy, ORIGIN, 1.0) == math.inf
    wall = np.column_stack([np.arange(-1.0, 1.5, 0.05), np.full(50, 0.3)])
    occupancy.set_walls(wall)
    assert free_turn(occupancy, ORIGIN, 1.0) < 0.4
    turning_back = Twist(-0.2, 1.0)
    assert free_distance(occupancy, ORIGIN, turning_back).contact < 0.4
    nearly_a_turn = Twist(0.1, 1.0)
    assert free_distance(occupancy, ORIGIN, nearly_a_turn).contact < 0.4
    assert free_distance(occupancy, ORIGIN, AHEAD).contact == 1.0
    swinging_out = Twist(0.2, 0.3)
    assert free_distance(occupancy, ORIGIN, swinging_out).contact < 0.6
    occupancy = occupancy_with()
    occupancy.set_walls(wall)
    assert free_turn(occupancy, ORIGIN, 1.0) == math.inf, "what is observed free is free"


@given(st.floats(-0.05, 0.05), st.floats(0.2, 0.23), st.floats(-math.pi, math.pi))
def test_a_body_too_near_a_wall_may_turn_away_alone(x: float, beside: float, yaw: float) -> None:
    """Wherever the wall's cells lie; and small turns to it do not add up."""
    occupancy, pose = occupancy_with(), Pose(x * math.cos(yaw), x * math.sin(yaw), yaw)
    for along in np.arange(-1.5, 1.5, 0.02):
        for left in np.linspace(beside, beside + 0.1, 5):
            occupancy.log_odds[occupancy.index(*pose.to_parent(along, left))] = 3.0
    assert free_turn(occupancy, pose, -1.0) == math.inf
    turned = 0.0
    while turned < 0.5 and free_turn(occupancy, Pose(pose.x, pose.y, yaw + turned), 1.0) > 0.03:
        turned += 0.01
    assert turned < 0.25


def test_observed_floor_counts_up_to_the_nose_in_every_direction() -> None:
    occupancy = occupancy_with(observed=False)
    (first, _), (last, _) = occupancy.index(0.0, -0.8), occupancy.index(0.0, 0.8)
    occupancy.log_odds[first : last + 1, first : last + 1] = -1.0
    ways = [free_distance(occupancy, Pose(0, 0, 0.5 * math.pi * k), AHEAD) for k in range(4)]
    assert ways[::2] == ways[1::2]
    assert ways[0].unobserved == pytest.approx(0.3, abs=0.06)


def test_the_border_of_the_grid_bars_the_nose_on_every_side() -> None:
    occupancy = occupancy_with()
    away = 0.5 * occupancy.params.extent - 0.9
    for k in range(4):
        out = 0.5 * math.pi * k
        pose = Pose(away * math.cos(out), away * math.sin(out), out)
        assert free_distance(occupancy, pose, AHEAD).contact == pytest.approx(0.4, abs=0.08)


def test_ranges_are_from_the_rim() -> None:
    ranges = ranges_around(occupancy_with((1.0, 1.2, -1.0, 1.0)), ORIGIN)
    ahead = int(np.abs(ranges.bearings).argmin())
    assert ranges.free[ahead] == pytest.approx(0.5, abs=0.06)


def test_the_ground_under_the_body_is_free() -> None:
    occupancy = occupancy_with(observed=False)
    free = occupancy.log_odds < 0.0
    assert free[occupancy.index(0.45, 0.1)]
    assert not free[occupancy.index(-0.3, 0.0)]
    assert not free[occupancy.index(0.3, 0.3)]
    turned = OccupancyGrid(CART)
    turned.update(Pose(0.0, 0.0, 0.5 * math.pi), 0.0)
    assert (turned.log_odds < 0.0)[turned.index(0.1, 0.45)]
