"""The ego map: evidence for and against, memory, fading, and what is derived from it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localmap.occupancy_grid import OccupancyGrid, OccupancyParams
from navfw.robot import RobotModel
from navfw.signals import Label, Percept, Pose, Stixels

ROBOT = RobotModel()
CAMERA_AHEAD = ROBOT.camera.mount_forward


def see(
    bearing_px: float, depth: float, label: Label, row_px: float = 0.0, sigma: float = 0.02
) -> Percept:
    """A percept of one cell: a thing of ``label`` at ``depth`` [m] in one image column."""
    camera = ROBOT.camera
    height = camera.mount_height - row_px / camera.focal * depth
    one = np.ones((1, 1))
    return Percept(
        time=0.0,
        points=np.array([[[bearing_px, row_px]]]),
        nearness=one / depth,
        sigma=one * sigma,
        confidence=one,
        height=one * height,
        label=np.full((1, 1), label, np.int8),
        obstacles={},
        quadrants={},
        planes={},
        slopes={},
        situations={},
        floor_in_front=0.0,
        sentence="",
    )


def looked(
    percepts: list[Percept], pose: Pose, occupancy: OccupancyGrid | None = None
) -> OccupancyGrid:
    occupancy = occupancy or OccupancyGrid(ROBOT)
    for k, percept in enumerate(percepts):
        occupancy.update(pose, 0.1 * k)
        occupancy.integrate(percept, pose)
    return occupancy


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-3.1, 3.1),
    st.floats(-60, 60),
    st.floats(0.6, 2.5),
)
def test_a_thing_appears_where_it_stands(
    x: float, y: float, yaw: float, column: float, depth: float
) -> None:
    pose = Pose(x, y, yaw)
    occupancy = looked([see(column, depth, Label.OBSTACLE)] * 6, pose)
    ahead = CAMERA_AHEAD + depth
    left = -column / ROBOT.camera.focal * depth
    row, col = occupancy.index(*pose.to_parent(ahead, left))
    assert occupancy.occupied[row - 2 : row + 3, col - 2 : col + 3].any()
    r, c = occupancy.index(*pose.to_parent(CAMERA_AHEAD + 0.5 * depth, 0.5 * left))
    halfway = np.s_[r - 1 : r + 2, c - 1 : c + 2]  # the ray may pass on either side of a border
    assert not occupancy.occupied[halfway].any()
    assert occupancy.log_odds[halfway].min() < 0.0


def test_one_look_is_not_enough() -> None:
    once = looked([see(0.0, 1.0, Label.OBSTACLE)], Pose(0, 0, 0))
    assert not once.occupied.any()
    often = looked([see(0.0, 1.0, Label.OBSTACLE)] * 4, Pose(0, 0, 0))
    assert often.occupied.any()


def test_looking_through_clears_a_ghost() -> None:
    pose = Pose(0, 0, 0)
    occupancy = looked([see(0.0, 1.0, Label.OBSTACLE)] * 4, pose)
    ghost = occupancy.index(CAMERA_AHEAD + 1.0, 0.0)
    assert occupancy.occupied[ghost]
    row_px = 20.0  # this ray meets the floor at 1.4 m
    floor = see(0.0, ROBOT.camera.mount_height * ROBOT.camera.focal / row_px, Label.FLOOR, row_px)
    occupancy = looked([floor] * 12, pose, occupancy)
    assert not occupancy.occupied[ghost]


def test_a_look_over_a_low_thing_says_little_about_it() -> None:
    pose = Pose(0, 0, 0)
    low, over = (looked([see(0.0, 1.0, Label.OBSTACLE)] * 4, pose) for _ in range(2))
    low.enter(see(0.0, 1.6, Label.OBSTACLE, 12.0), pose)
    over.enter(see(0.0, 1.6, Label.OBSTACLE, -1.0), pose)
    cell = low.index(CAMERA_AHEAD + 1.0, 0.0)
    assert low.log_odds[cell] < over.log_odds[cell]


def test_a_point_of_unknown_height_bars_nothing_but_is_seen_through_to() -> None:
    occupancy = looked([see(0.0, 1.0, Label.UNKNOWN)] * 5, Pose(0, 0, 0))
    assert not occupancy.occupied.any()
    assert occupancy.log_odds[occupancy.index(CAMERA_AHEAD + 0.6, 0.0)] < 0.0
    assert occupancy.log_odds[occupancy.index(CAMERA_AHEAD + 1.3, 0.0)] == 0.0


def test_doubtful_points_leave_no_trace() -> None:
    doubtful = dataclasses.replace(see(0.0, 1.0, Label.OBSTACLE), confidence=np.full((1, 1), 0.05))
    occupancy = looked([doubtful] * 5, Pose(0, 0, 0))
    body = occupancy.log_odds == occupancy.params.least
    assert np.all(occupancy.log_odds[~body] == 0.0)


def test_uncertain_sightings_are_spread_and_weigh_less() -> None:
    pose = Pose(0, 0, 0)
    sharp = looked([see(0.0, 1.5, Label.OBSTACLE, sigma=0.01)], pose)
    vague = looked([see(0.0, 1.5, Label.OBSTACLE, sigma=0.08)], pose)
    assert 0.0 < vague.log_odds.max() < 0.6 * sharp.log_odds.max()
    assert (vague.log_odds > 0).sum() > (sharp.log_odds > 0).sum()


def test_a_reading_spread_over_many_cells_says_of_none_that_it_is_taken() -> None:
    vague = looked([see(0.0, 1.5, Label.OBSTACLE, sigma=0.4)] * 10, Pose(0, 0, 0))
    assert vague.log_odds.max() <= 0.0
    assert vague.log_odds[vague.index(CAMERA_AHEAD + 0.6, 0.0)] < 0.0  # nearer it would show


def test_memory_moves_with_the_robot_and_fades() -> None:
    occupancy = looked([see(0.0, 1.2, Label.OBSTACLE)] * 6, Pose(0, 0, 0))
    thing = (CAMERA_AHEAD + 1.2, 0.0)
    before = occupancy.log_odds[occupancy.index(*thing)]
    occupancy.update(Pose(0.7, 0.9, 1.0), 0.6)
    assert occupancy.log_odds[occupancy.index(*thing)] == pytest.approx(before, rel=0.01)
    occupancy.update(Pose(0.7, 0.9, 1.0), 0.6 + occupancy.params.fade)
    assert occupancy.log_odds[occupancy.index(*thing)] == pytest.approx(before / math.e, rel=0.02)


def test_what_leaves_the_square_is_forgotten() -> None:
    occupancy = OccupancyGrid(ROBOT, OccupancyParams(extent=4.0))
    occupancy = looked([see(0.0, 1.2, Label.OBSTACLE)] * 6, Pose(0, 0, 0), occupancy)
    occupancy.update(Pose(-10.0, 0, 0), 1.0)
    occupancy.update(Pose(0.0, 0, 0), 1.1)
    assert not occupancy.occupied.any()


def test_clearance_is_the_distance_to_the_nearest_thing() -> None:
    occupancy = looked([see(0.0, 1.2, Label.OBSTACLE, sigma=0.005)] * 6, Pose(0, 0, 0))
    spots = np.argwhere(occupancy.occupied)
    rows, columns = np.indices(occupancy.log_odds.shape)
    brute = (
        np.min([np.hypot(rows - r, columns - c) for r, c in spots], axis=0) * occupancy.params.cell
    )
    # OpenCV's 5x5 mask approximates the Euclidean distance to within 2 %
    assert np.allclose(occupancy.clearance, brute, rtol=0.025, atol=0.005)


def test_the_map_has_no_place_before_the_first_move() -> None:
    with pytest.raises(RuntimeError, match="move first"):
        OccupancyGrid(ROBOT).index(0.0, 0.0)


def test_free_floor_within_view_must_be_seen_again() -> None:
    pose = Pose(0, 0, 0)
    occupancy = looked([see(0.0, 2.5, Label.OBSTACLE)] * 8, pose)
    ahead, aside = occupancy.index(1.5, 0.0), occupancy.index(0.0, 1.5)
    occupancy.log_odds[aside] = -1.0  # seen before, out of view now
    was = float(occupancy.log_odds[ahead])
    assert was < occupancy.params.seen_free
    for k in range(1, 31):  # looks to another side of the view find nothing ahead
        occupancy.update(pose, 0.8 + 0.1 * k)
        occupancy.integrate(dataclasses.replace(see(70.0, 2.5, Label.OBSTACLE), time=0.1 * k), pose)
    assert occupancy.log_odds[ahead] > 0.2 * was
    assert occupancy.log_odds[aside] < -0.8


def test_familiar_is_what_has_known_floor_beside_it() -> None:
    occupancy = OccupancyGrid(ROBOT)
    occupancy.update(Pose(0, 0, 0), 0.0)
    occupancy.log_odds[:] = 0.0
    row, column = occupancy.index(1.0, 0.0)
    occupancy.log_odds[row - 6 : row + 7, column - 10 : column + 11] = -1.0
    occupancy.log_odds[row, column] = 0.0  # one gap between rays
    assert occupancy.observed[row, column] == 0
    assert occupancy.footprint_observed[row, column] == 1
    assert occupancy.observed[row + 6, column] == 1
    assert occupancy.footprint_observed[row + 6, column] == 0


@settings(max_examples=40, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1), st.floats(-0.8, 0.8))
def test_what_stands_in_a_small_column_appears_where_it_stands(
    x: float, y: float, yaw: float, slope: float
) -> None:
    pose, ahead = Pose(x, y, yaw), 0.8
    column = np.array([slope, slope])
    near = np.full(2, 1.0 / ahead)
    # the second column is nobody's word
    standing = Stixels(0.0, column, near, 0.08 * near, np.array([1.0, 0.0]))
    occupancy = OccupancyGrid(ROBOT)
    for k in range(6):
        occupancy.update(pose, 0.1 * k)
        occupancy.integrate_stixels(standing, pose)
    place = pose.to_parent(CAMERA_AHEAD + ahead, slope * ahead)
    row, column_index = occupancy.index(*place)
    assert occupancy.occupied[row - 1 : row + 2, column_index - 1 : column_index + 2].any()
    rows, columns = np.nonzero(occupancy.occupied)
    cell = occupancy.params.cell
    far = np.hypot(
        occupancy.origin[0] + cell * columns - place[0],
        occupancy.origin[1] + cell * rows - place[1],
    )
    assert (far < 0.2 * math.hypot(1.0, slope)).all()
    # it says nothing of what is free
    assert occupancy.observed.sum() == np.count_nonzero(_bare(pose).observed)


def _bare(pose: Pose) -> OccupancyGrid:
    occupancy = OccupancyGrid(ROBOT)
    for k in range(6):
        occupancy.update(pose, 0.1 * k)
    return occupancy
