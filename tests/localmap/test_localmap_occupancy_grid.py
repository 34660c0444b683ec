"""The occupancy grid: evidence for and against, decay, and what is derived from it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localmap_samples import ORIGIN, ROBOT, grid_with, metric_percept

from navfw.localmap import OccupancyGrid
from navfw.localmap.occupancy_grid import OccupancyParams
from navfw.signals import Label, OccupiedDisc, Percept, Pose, Stixels

CLAMP_MIN = -1.5
OBSERVED_FREE = -0.25

CAMERA_AHEAD = ROBOT.camera.mount_forward
POSES = st.builds(Pose, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1))


def percept_of(
    column_px: float, depth: float, label: Label, row_px: float = 0.0, sigma: float = 0.02
) -> Percept:
    """A percept of one cell: a point of ``label`` at ``depth`` [m] in one image column."""
    height = ROBOT.camera.mount_height - row_px / ROBOT.camera.focal * depth
    point = np.array([[[column_px, row_px]]])
    return metric_percept(0.0, point, 1.0 / depth, sigma, label, height)


HIT = percept_of(0.0, 1.0, Label.OBSTACLE)


def integrated(
    percepts: list[Percept], pose: Pose = ORIGIN, occupancy: OccupancyGrid | None = None
) -> OccupancyGrid:
    """The grid after one of ``percepts`` every 0.1 s from ``pose``."""
    occupancy = occupancy or OccupancyGrid(ROBOT)
    for k, percept in enumerate(percepts):
        occupancy.update(pose, 0.1 * k)
        occupancy.integrate(percept, pose)
    return occupancy


@settings(max_examples=40, deadline=None)
@given(POSES, st.floats(-60, 60), st.floats(0.6, 2.5))
def test_an_obstacle_appears_where_it_stands(pose: Pose, column: float, depth: float) -> None:
    occupancy = integrated([percept_of(column, depth, Label.OBSTACLE)] * 6, pose)
    ahead = CAMERA_AHEAD + depth
    left = -column / ROBOT.camera.focal * depth
    row, col = occupancy.index(*pose.to_parent(ahead, left))
    assert occupancy.occupied[row - 2 : row + 3, col - 2 : col + 3].any()
    r, c = occupancy.index(*pose.to_parent(CAMERA_AHEAD + 0.5 * depth, 0.5 * left))
    halfway = np.s_[r - 1 : r + 2, c - 1 : c + 2]  # the ray may pass on either side of a border
    assert not occupancy.occupied[halfway].any()
    assert occupancy.log_odds[halfway].min() < 0.0


def test_one_observation_is_not_enough() -> None:
    assert not integrated([HIT]).occupied.any()
    assert integrated([HIT] * 4).occupied.any()


def test_rays_that_pass_clear_a_false_obstacle() -> None:
    occupancy = integrated([HIT] * 4)
    spot = occupancy.index(CAMERA_AHEAD + 1.0, 0.0)
    assert occupancy.occupied[spot]
    row_px = 20.0  # this ray meets the floor at 1.4 m
    depth = ROBOT.camera.mount_height * ROBOT.camera.focal / row_px
    floor = percept_of(0.0, depth, Label.FLOOR, row_px)
    occupancy = integrated([floor] * 12, occupancy=occupancy)
    assert not occupancy.occupied[spot]


def test_a_ray_above_a_low_obstacle_is_little_evidence() -> None:
    low, over = (integrated([HIT] * 4) for _ in range(2))
    low.integrate(percept_of(0.0, 1.6, Label.OBSTACLE, 12.0), ORIGIN)
    over.integrate(percept_of(0.0, 1.6, Label.OBSTACLE, -1.0), ORIGIN)
    cell = low.index(CAMERA_AHEAD + 1.0, 0.0)
    assert low.log_odds[cell] < over.log_odds[cell]


def test_a_point_of_unknown_height_is_no_hit_but_its_ray_is_free() -> None:
    occupancy = integrated([percept_of(0.0, 1.0, Label.UNKNOWN)] * 5)
    assert not occupancy.occupied.any()
    assert occupancy.log_odds[occupancy.index(CAMERA_AHEAD + 0.6, 0.0)] < 0.0
    assert occupancy.log_odds[occupancy.index(CAMERA_AHEAD + 1.3, 0.0)] == 0.0


def observed_weakly(occupancy: OccupancyGrid, label: Label, weak: bool = True) -> None:
    """Update ``occupancy`` by a percept of one point of ``label`` 1 m ahead."""
    occupancy.update(ORIGIN, 0.0)
    occupancy.integrate(percept_of(0.0, 1.0, label), ORIGIN, weak=weak)


@pytest.mark.parametrize("label", list(Label))
def test_with_weak_sight_only_rays_to_floor_and_obstacles_are_free(label: Label) -> None:
    occupancy = OccupancyGrid(ROBOT)
    observed_weakly(occupancy, label)
    before = float(occupancy.log_odds[occupancy.index(CAMERA_AHEAD + 0.6, 0.0)])
    assert (before < 0.0) is (label in {Label.FLOOR, Label.OBSTACLE})


def test_with_weak_sight_little_evidence_makes_a_cell_occupied() -> None:
    occupancy = grid_with(observed=False)
    cell = occupancy.index(1.5, 0.0)
    for weak, evidence, occupied in ((False, 0.6, False), (True, 0.6, True), (True, 0.2, False)):
        observed_weakly(occupancy, Label.FLOOR, weak)
        occupancy.log_odds[cell] = evidence
        assert occupancy.occupied[cell] == occupied


@pytest.mark.parametrize("aside", [0.1, 0.15, 0.2])
def test_with_weak_sight_the_floor_is_observed_under_the_whole_body(aside: float) -> None:
    """A stripe of floor along x, observed as far as ``aside`` [m] to either side."""
    occupancy = OccupancyGrid(ROBOT)
    for weak in (False, True):
        observed_weakly(occupancy, Label.FLOOR, weak)
        for x in np.arange(0.0, 2.0, 0.05):
            for y in np.arange(-aside, aside + 1e-9, 0.05):
                occupancy.log_odds[occupancy.index(float(x), float(y))] = -1.0
        observed = occupancy.footprint_observed[occupancy.index(1.0, 0.0)]
        assert observed == (aside > ROBOT.radius or not weak)


def test_points_of_low_confidence_are_no_evidence() -> None:
    occupancy = integrated([dataclasses.replace(HIT, confidence=np.full((1, 1), 0.05))] * 5)
    body = occupancy.log_odds == CLAMP_MIN
    assert np.all(occupancy.log_odds[~body] == 0.0)


def test_uncertain_observations_are_spread_and_weigh_less() -> None:
    sharp = integrated([percept_of(0.0, 1.5, Label.OBSTACLE, sigma=0.01)])
    vague = integrated([percept_of(0.0, 1.5, Label.OBSTACLE, sigma=0.08)])
    assert 0.0 < vague.log_odds.max() < 0.6 * sharp.log_odds.max()
    assert (vague.log_odds > 0).sum() > (sharp.log_odds > 0).sum()


def test_a_reading_spread_over_many_cells_is_a_hit_in_none() -> None:
    vague = integrated([percept_of(0.0, 1.5, Label.OBSTACLE, sigma=0.4)] * 10)
    assert vague.log_odds.max() <= 0.0
    assert vague.log_odds[vague.index(CAMERA_AHEAD + 0.6, 0.0)] < 0.0  # nearer it would have shown


def test_evidence_moves_with_the_robot_and_decays() -> None:
    occupancy = integrated([percept_of(0.0, 1.2, Label.OBSTACLE)] * 6)
    place = (CAMERA_AHEAD + 1.2, 0.0)
    before = occupancy.log_odds[occupancy.index(*place)]
    occupancy.update(Pose(0.7, 0.9, 1.0), 0.6)
    assert occupancy.log_odds[occupancy.index(*place)] == pytest.approx(before, rel=0.01)
    occupancy.update(Pose(0.7, 0.9, 1.0), 0.6 + occupancy.params.decay)
    assert occupancy.log_odds[occupancy.index(*place)] == pytest.approx(before / math.e, rel=0.02)


@settings(max_examples=40, deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5))
def test_all_evidence_keeps_its_place_when_the_grid_follows_the_robot(dx: float, dy: float) -> None:
    occupancy = OccupancyGrid(ROBOT, OccupancyParams(extent=4.0))
    occupancy.update(ORIGIN, 0.0)
    n, cell = occupancy.size, occupancy.params.cell
    evidence = np.arange(1.0, n * n + 1.0).reshape(n, n)
    occupancy.log_odds[:] = evidence
    old = occupancy.origin
    occupancy.update(Pose(dx, dy, 0.0), 0.0)
    new = occupancy.origin
    # the robot stays near the middle
    middle = np.array(new) + 0.5 * (n - 1) * cell
    assert np.abs(middle - (dx, dy)).max() <= 0.5 + cell
    columns, rows = (round((b - a) / cell) for a, b in zip(old, new, strict=True))
    kept = np.zeros((n, n))
    for row in range(max(0, -rows), min(n, n - rows)):
        for column in range(max(0, -columns), min(n, n - columns)):
            kept[row, column] = evidence[row + rows, column + columns]
    away = occupancy.log_odds != CLAMP_MIN  # but for the robot's footprint
    assert np.array_equal(occupancy.log_odds[away], kept[away])
    assert 0.9 * n * n < np.count_nonzero(away) < n * n


@pytest.mark.parametrize(("height", "counts"), [(1.4, True), (1.6, False)])
def test_points_high_above_the_floor_are_no_evidence(height: float, counts: bool) -> None:
    high = dataclasses.replace(HIT, height=np.full((1, 1), height))
    assert integrated([high] * 4).occupied.any() == counts


def test_clearance_is_the_distance_to_the_nearest_occupied_cell() -> None:
    occupancy = integrated([percept_of(0.0, 1.2, Label.OBSTACLE, sigma=0.005)] * 6)
    spots = np.argwhere(occupancy.occupied)
    rows, columns = np.indices(occupancy.log_odds.shape)
    cells = np.min([np.hypot(rows - r, columns - c) for r, c in spots], axis=0)
    brute = cells * occupancy.params.cell
    # OpenCV's 5x5 mask approximates the Euclidean distance to within 2 %
    assert np.allclose(occupancy.clearance, brute, rtol=0.025, atol=0.005)


def test_blind_clearance_is_kept_until_evidence_obstacles_or_walls_change() -> None:
    seen = [percept_of(0.0, 1.2, Label.OBSTACLE, sigma=0.005)]
    occupancy = integrated(seen * 6)
    hidden = occupancy.index(1.3, 0.1)  # not observed, behind what is seen of the wall
    assert not occupancy.occupied[hidden]
    assert occupancy.blind_clearance[hidden] == 0.0 < occupancy.clearance[hidden]
    assert occupancy.blind_clearance is occupancy.blind_clearance

    cell, disc = occupancy.index(-1.0, 0.5), OccupiedDisc(-1.0, 0.5, 0.1)
    before, clearance = occupancy.blind_clearance, occupancy.clearance
    occupancy.set_obstacles((disc,))
    assert occupancy.occupied[cell]
    assert occupancy.blind_clearance[cell] == occupancy.clearance[cell] == 0.0
    occupancy.set_obstacles(())
    assert occupancy.clearance_with((disc,))[cell] == 0.0
    assert occupancy.clearance_with(())[cell] == occupancy.clearance[cell] == clearance[cell]
    assert not occupancy.occupied[cell]
    assert np.array_equal(occupancy.blind_clearance, before)
    occupancy.set_walls(np.array([[-1.0, 0.5], [0.6, 0.0], [99.0, 0.0]]))
    assert occupancy.blind_clearance[cell] == 0.0 == occupancy.clearance[cell]
    assert not occupancy.occupied[cell], "the map is no evidence"
    assert occupancy.blind_clearance[occupancy.index(0.6, 0.0)] > 0.0, "it is observed free"
    occupancy.set_walls(np.empty((0, 2)))
    for _ in range(6):
        occupancy.integrate(percept_of(60.0, 1.0, Label.OBSTACLE, sigma=0.005), ORIGIN)
    integrated_more = occupancy.blind_clearance
    assert not np.array_equal(integrated_more, before)
    occupancy.update(ORIGIN, 60.0)  # the evidence decays
    assert not np.array_equal(occupancy.blind_clearance, integrated_more)
    occupancy.reset()
    occupancy.update(ORIGIN, 0.0)
    assert (occupancy.blind_clearance == occupancy.params.extent).all()


def test_the_grid_has_no_position_before_the_first_update() -> None:
    with pytest.raises(RuntimeError, match="call update first"):
        OccupancyGrid(ROBOT).index(0.0, 0.0)


def test_free_floor_within_view_has_to_be_observed_again() -> None:
    occupancy = integrated([percept_of(0.0, 2.5, Label.OBSTACLE)] * 8)
    ahead, aside = occupancy.index(1.5, 0.0), occupancy.index(0.0, 1.5)
    occupancy.log_odds[aside] = -1.0  # observed before, out of view now
    was = float(occupancy.log_odds[ahead])
    assert was < OBSERVED_FREE
    elsewhere = percept_of(70.0, 2.5, Label.OBSTACLE)
    for k in range(1, 31):  # observations elsewhere in the view show nothing ahead
        occupancy.update(ORIGIN, 0.8 + 0.1 * k)
        occupancy.integrate(dataclasses.replace(elsewhere, time=0.1 * k), ORIGIN)
    assert occupancy.log_odds[ahead] > 0.2 * was
    assert occupancy.log_odds[aside] < -0.8


@pytest.mark.parametrize("pose", [ORIGIN, Pose(0.3, -0.2, 2.0)])
def test_the_floor_in_view_is_in_doubt_until_it_is_observed_again(pose: Pose) -> None:
    occupancy = grid_with()
    occupancy.update(pose, 0.0)
    near, middle, far, aside, back = (
        occupancy.index(*pose.to_parent(x, y))
        for x, y in ((0.2, 0.0), (1.0, 0.0), (1.9, 0.0), (1.0, 1.4), (-1.0, 0.0))
    )
    occupancy.doubt_view(pose)
    seen = [bool(occupancy.occupied[at]) for at in (near, middle, far, aside, back)]
    assert seen == [False, True, False, False, False]
    assert occupancy.clearance[middle] == 0.0
    assert not occupancy.observed[middle]
    for k in range(4):  # rays that pass
        occupancy.integrate(percept_of(0.1 * k, 2.5, Label.OBSTACLE), pose)
    assert not occupancy.occupied[middle]
    occupancy.doubt_view(pose)
    later = Pose(pose.x + 0.6, pose.y, pose.yaw)
    occupancy.update(later, 1.0)
    assert occupancy.occupied[occupancy.index(*pose.to_parent(1.0, 0.0))], "it moves with the grid"
    occupancy.reset()
    occupancy.update(pose, 0.0)
    assert not occupancy.occupied.any()


def test_the_footprint_is_observed_where_the_floor_beside_it_is() -> None:
    occupancy = grid_with(observed=False)
    occupancy.log_odds[:] = 0.0
    row, column = occupancy.index(1.0, 0.0)
    occupancy.log_odds[row - 6 : row + 7, column - 10 : column + 11] = -1.0
    occupancy.log_odds[row, column] = 0.0  # one gap between rays
    assert occupancy.observed[row, column] == 0
    assert occupancy.footprint_observed[row, column] == 1
    assert occupancy.observed[row + 6, column] == 1
    assert occupancy.footprint_observed[row + 6, column] == 0


@settings(max_examples=40, deadline=None)
@given(POSES, st.floats(-0.8, 0.8))
def test_a_stixel_appears_where_it_stands(pose: Pose, slope: float) -> None:
    ahead = 0.8
    column = np.array([slope, slope])
    near = np.full(2, 1.0 / ahead)
    # the second column has no confidence
    stixels = Stixels(0.0, column, near, 0.08 * near, np.array([1.0, 0.0]))
    occupancy = OccupancyGrid(ROBOT)
    for k in range(6):
        occupancy.update(pose, 0.1 * k)
        occupancy.integrate_stixels(stixels, pose)
    place = pose.to_parent(CAMERA_AHEAD + ahead, slope * ahead)
    row, column_index = occupancy.index(*place)
    assert occupancy.occupied[row - 1 : row + 2, column_index - 1 : column_index + 2].any()
    rows, columns = np.nonzero(occupancy.occupied)
    cell = occupancy.params.cell
    dx, dy = np.array(occupancy.origin) - place
    assert (np.hypot(dx + cell * columns, dy + cell * rows) < 0.2 * math.hypot(1.0, slope)).all()
    # stixels are no evidence of free floor
    unseen = OccupancyGrid(ROBOT)
    unseen.update(pose, 0.5)
    assert np.array_equal(occupancy.observed, unseen.observed)
