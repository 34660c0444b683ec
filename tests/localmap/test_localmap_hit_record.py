"""Scans of the local map: uncertain surfaces far away, and edges of near obstacles."""

import math

import numpy as np
import pytest

from navfw.localmap.hit_record import HitRecord
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Pose

HERE = Pose(0.0, 0.0, 0.0)


def scanned(cells: dict[tuple[float, float], float], bearings: Array) -> Array:
    """Ranges (n,) [m] with log-odds in the cells at these places [m], and free floor around."""
    grid = OccupancyGrid(RobotModel())
    grid.update(HERE, 0.0)
    grid.log_odds[:] = -1.0
    for (x, y), value in cells.items():
        grid.log_odds[grid.index(x, y)] = value
    return HitRecord(grid).scan(HERE, bearings, 2.5).ranges


@pytest.mark.parametrize(("distance", "seen"), [(1.0, False), (2.0, True)])
def test_evidence_spread_over_depth_is_summed_far_away(distance: float, *, seen: bool) -> None:
    across = (-0.05, 0.0, 0.05)
    wall = {(distance + dx, y): 0.3 for dx in (-0.1, *across, 0.1) for y in across}
    ranges = scanned(wall, np.zeros(1))
    assert math.isfinite(ranges[0]) is seen
    if seen:
        assert ranges[0] == pytest.approx(distance, abs=0.06)


def test_rays_beside_the_middle_of_a_cell_pass_it() -> None:
    offsets = np.array([-0.024, -0.005, 0.005, 0.024])
    ranges = scanned({(0.5, 0.0): 2.0}, np.arctan2(offsets, 0.5))
    assert np.isfinite(ranges).tolist() == [False, True, True, False]
