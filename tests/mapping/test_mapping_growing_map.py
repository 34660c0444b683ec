"""The growing map: what was observed becomes free, occupied or unseen cells of one grid."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapping_scenes import (
    ROBOT,
    ROOM,
    ROUND,
    SIGHT,
    agreement,
    drive,
    inside,
    observe,
    poses_along,
)

from navfw.localmap import LocalMap
from navfw.mapping import GrowingMap
from navfw.mapping.evidence_grid import EvidenceGrid, KeyPose
from navfw.mapping.submaps import Submap
from navfw.signals import Belief, GrownGrid, OccupiedDisc, Odometry, Pose, Twist
from navfw.stack.map_growth import MapGrowth

STARTS = st.builds(Pose, st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))
STILL = Odometry(0.0, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), 0.0, still=True)


def seen_share(grid: GrownGrid, path: list[Pose]) -> float:
    """The share of cells within sight of the path that are not unseen."""
    rows, columns = np.indices(grid.log_odds.shape)
    x, y = grid.origin[0] + columns * grid.cell, grid.origin[1] + rows * grid.cell
    near = np.zeros(x.shape, dtype=np.bool_)
    for pose in path[::10]:
        near |= np.hypot(x - pose.x, y - pose.y) < SIGHT - 0.1
    return float((~grid.unseen[near]).mean())


def test_what_was_observed_on_the_way_is_free_or_occupied() -> None:
    growing = GrowingMap(ROBOT)
    path = list(poses_along(ROUND))
    drive(growing, ROOM, path)
    occupied, free = agreement(growing.grid, ROOM)
    assert occupied == free == 1.0
    assert seen_share(growing.grid, path) > 0.999
    assert growing.grid.unseen.any()
    assert len(growing.keys) > 10


@settings(max_examples=10)
@given(STARTS)
def test_the_map_lies_in_the_frame_of_the_start(start: Pose) -> None:
    growing = GrowingMap(ROBOT)
    growing.reset(start)
    path = list(poses_along(ROUND[:2]))
    drive(growing, ROOM, path)
    end = start.compose(path[-1])
    assert (growing.pose.x, growing.pose.y) == pytest.approx((end.x, end.y))
    grid = growing.grid
    solid = grid.centres(np.argwhere(grid.occupied))
    local = start.points_to_local(solid)
    near = inside([(a - 0.06, b + 0.06, c - 0.06, d + 0.06) for a, b, c, d in ROOM], *local.T)
    assert near.all()
    assert len(solid) > 200


def test_a_wall_that_has_gone_is_free_when_it_is_seen_again() -> None:
    path = list(poses_along(((0.0, 0.0), (1.4, 0.0), (0.0, 0.0))))
    growing = GrowingMap(ROBOT)
    drive(growing, (*ROOM, (2.0, 2.0, -0.5, 0.5)), path)
    cell = tuple(growing.grid.cells_at(np.array([[2.0, 0.0]]))[0])
    assert growing.grid.occupied[cell]
    drive(growing, ROOM, path, begin=100.0)
    assert growing.grid.free[cell]


@pytest.mark.parametrize("close_loops", [True, False])
def test_the_map_says_when_a_point_was_seen_last(close_loops: bool) -> None:
    growing = GrowingMap(ROBOT, close_loops=close_loops)
    assert growing.last_seen(2.0, 0.0) is None
    path = list(poses_along(((0.0, 0.0), (1.4, 0.0), (0.0, 0.0))))
    drive(growing, ROOM, path)
    first = growing.last_seen(2.0, 0.0)
    drive(growing, ROOM, path[-3:], begin=100.0)
    growing.finish()
    assert first is not None
    assert 0.0 < first < 100.0 < (growing.last_seen(2.0, 0.0) or 0.0)
    assert growing.last_seen(50.0, 0.0) is None
    assert bool(growing.keys) == close_loops  # a localiser's poses are not corrected later


@pytest.mark.parametrize("start", [Pose(0.0, 0.0, 0.0), None])
def test_poses_of_a_localiser_that_jumps_are_not_used(start: Pose | None) -> None:
    growth, local_map = MapGrowth(ROBOT, corrects=False), LocalMap(ROBOT)
    growth.reset(start)
    path = list(poses_along(((0.0, 0.0), (4.5, 0.0))))
    for k, pose in enumerate(path):
        odometry = replace(STILL, time=0.1 * k, pose=pose)
        off = 7.0 if 20 <= k < 60 else 0.1
        belief = Belief(odometry.time, Pose(pose.x, pose.y + off, 0.0), 1e-4 * np.eye(3))
        local_map.occupancy.update(pose, odometry.time)
        observe(local_map, ROOM, pose, pose)
        growth.update(odometry, local_map, (), None, pose, belief)
    growth.growing_map.finish()
    seen = growth.growing_map.last_seen
    assert (seen(-1.0, 0.1) is not None) == (start is not None)  # else all begins anew
    assert seen(3.0, 7.0) is None
    assert seen(5.0, 0.1) is not None


def test_what_stands_under_a_moving_obstacle_is_left_out() -> None:
    seen = []
    for moving in ((), (OccupiedDisc(1.0, 0.0, 0.3),)):
        growing, local_map = GrowingMap(ROBOT), LocalMap(ROBOT)
        local_map.occupancy.update(STILL.pose, 0.0)
        local_map.occupancy.log_odds[local_map.occupancy.index(1.0, 0.0)] = 3.0
        growing.update(STILL, local_map, moving)
        growing.finish()
        seen.append(bool(growing.grid.occupied.any()))
    assert seen == [True, False]


def test_nothing_is_known_before_the_first_frame() -> None:
    growing = GrowingMap(ROBOT)
    growing.finish()
    assert growing.keys == []
    assert growing.pose == Pose(0.0, 0.0, 0.0)
    with pytest.raises(RuntimeError, match="observed nothing yet"):
        _ = growing.grid


def test_decayed_evidence_is_not_observed_again() -> None:
    growing, local_map = GrowingMap(ROBOT), LocalMap(ROBOT)
    local_map.occupancy.update(STILL.pose, 0.0)
    local_map.occupancy.log_odds[:] = -1.5
    growing.update(STILL, local_map)
    growing.finish()
    later = Odometry(5.0, Pose(0.1, 0.0, 0.0), Twist(0.0, 0.0), 0.0, still=True)
    local_map.occupancy.update(later.pose, later.time)
    growing.update(later, local_map)
    growing.finish()
    first, second = (key.submap.evidence for key in growing.keys)
    assert np.count_nonzero(second) < 0.02 * np.count_nonzero(first)  # the footprint alone


@settings(max_examples=20)
@given(st.integers(0, 2**16), st.integers(1, 4))
def test_a_grid_renewed_in_part_equals_one_made_anew(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    keys = []
    for _ in range(6):
        evidence = rng.choice(np.array([-40, 0, 96], np.int8), (12, 9))
        x, y, yaw = rng.uniform(-3.0, 3.0, 3).tolist()
        corner = round(x / 0.05) * 0.05 - 0.2, round(y / 0.05) * 0.05 - 0.3
        submap = Submap(0.0, Pose(x, y, yaw), corner, evidence, np.empty((0, 2)))
        keys.append(KeyPose(submap, Pose(x, y, yaw)))
    grid = EvidenceGrid(0.05)
    for key in keys:
        grid.merge(key)
    moved = list(keys)
    for k in range(count):
        x, y, yaw = rng.uniform(-0.3, 0.3, 3).tolist()
        moved[k] = replace(keys[k], pose=keys[k].pose.compose(Pose(x, y, yaw)))
    grid.renew(moved, [*keys[:count], *moved[:count]])
    anew = EvidenceGrid(0.05)
    for key in (*keys, *moved):  # of the same extent
        anew.merge(key)
    anew.cells[:] = 0
    for key in moved:
        anew.merge(key)
    assert grid.origin == anew.origin
    assert np.array_equal(grid.cells, anew.cells)
