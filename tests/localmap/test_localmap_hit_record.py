"""Scans of the local map: uncertain surfaces far away, edges, obstacles behind unseen floor."""

import math

import numpy as np
import pytest

from navfw.localmap.hit_record import HitRecord
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Pose

HERE = Pose(0.0, 0.0, 0.0)


RAYS = np.radians(np.arange(-9.0, 10.0))


def scanned(cells: dict[tuple[float, float], float], bearings: Array = RAYS) -> Array:
    """Ranges (n,) [m] with log-odds in the cells at these places [m], and free floor around."""
    grid = OccupancyGrid(RobotModel())
    grid.update(HERE, 0.0)
    grid.log_odds[:] = -1.0
    for (x, y), value in cells.items():
        grid.log_odds[grid.index(x, y)] = value
    return HitRecord(grid).scan(HERE, bearings, 2.5).ranges


@pytest.mark.parametrize(("distance", "seen"), [(1.0, False), (1.7, False), (2.3, True)])
def test_evidence_spread_over_depth_is_summed_far_away(distance: float, *, seen: bool) -> None:
    across = (-0.05, 0.0, 0.05)
    wall = {(distance + dx, y): 0.17 for dx in (-0.1, *across, 0.1) for y in across}
    ranges = scanned(wall, np.radians([-0.5, 0.0, 0.5]))
    assert math.isfinite(ranges[1]) is seen
    if seen:
        assert ranges[1] == pytest.approx(distance, abs=0.06)


def test_rays_that_may_pass_beside_an_obstacle_are_not_known() -> None:
    ranges = scanned({(0.5, y): 2.0 for y in (-0.05, 0.0, 0.05)})
    hits, unknown = np.isfinite(ranges), np.isnan(ranges)
    assert np.flatnonzero(hits).tolist() == list(range(5, 14))  # to 4 degrees
    assert np.flatnonzero(unknown).tolist() == [3, 4, 14, 15]


def test_an_obstacle_is_seen_behind_floor_that_was_not_observed() -> None:
    across = np.arange(-9, 10) / 20
    unseen = {(x, y): 0.0 for x in np.arange(12, 18) / 20 for y in across}
    wall = {(1.8, y): 2.0 for y in across[:10]}
    ranges = scanned(unseen | wall)
    assert ranges[:8] == pytest.approx(1.8, abs=0.06)
    assert np.isnan(ranges[-8:]).all()
