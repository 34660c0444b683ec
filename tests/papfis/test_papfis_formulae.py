"""Lines, views, paths and lengths on grids and legs: values worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from papfis_maps import belief, row

from navfw.numerics import Mask
from navfw.papfis.explorer import Explorer
from navfw.papfis.found_doors import FoundDoors
from navfw.papfis.frontier_kernels import unseen_in_view
from navfw.robot import RobotModel
from navfw.signals import Pose, Waypoint
from navfw.topomap import Place

SHAPE = 9, 41
"""Rows and columns of a grid that is not square."""
MIDDLE = np.array([[4, 20]])


def view(unseen: Mask, reach: float, wall: int | None = None) -> float:
    """Area [cells] of what is ``unseen`` in view from the middle, with a wall in a row."""
    occupied = np.zeros(SHAPE, dtype=np.bool_)
    if wall is not None:
        occupied[wall] = True
    return float(unseen_in_view(unseen, occupied, MIDDLE, reach, 0.1, 720)[0])


def test_the_view_is_a_disc_of_what_is_unseen() -> None:
    everything, corners = np.ones(SHAPE, dtype=np.bool_), np.zeros(SHAPE, dtype=np.bool_)
    assert view(everything, 3.0) == pytest.approx(9.0 * math.pi)
    assert view(everything, 12.0) == pytest.approx(144.0 * math.pi)  # the outside is unseen
    corners[np.ix_([0, 8], [16, 24])] = True
    assert view(corners, 4.4) == 0.0


@pytest.mark.parametrize(("wall", "rows"), [(3, 0.5), (5, 0.5), (2, 1.5), (7, 2.5)])
def test_a_wall_hides_what_is_beyond(wall: int, rows: float) -> None:
    beyond = 16.0 * math.acos(rows / 4.0) - rows * math.sqrt(16.0 - rows * rows)
    area = view(np.ones(SHAPE, dtype=np.bool_), 4.0, wall)
    assert area == pytest.approx(16.0 * math.pi - beyond, rel=0.01)


def test_without_a_grid_an_explorer_heads_a_metre_ahead() -> None:
    explorer = Explorer(RobotModel(), Explorer.Params())
    pose = Pose(2.0, 1.0, 0.5 * math.pi)
    waypoint = explorer.update(replace(belief(2.0, 1.0), pose=pose))
    assert waypoint is not None
    assert (waypoint.x, waypoint.y) == pytest.approx((2.0, 2.0))


@pytest.mark.parametrize(("x", "side"), [(1.1, "left"), (1.9, "right")])
def test_the_side_to_which_a_door_moved_is_as_the_robot_sees_it(x: float, side: str) -> None:
    """The robot drives along y, from below or from above."""
    for way, seen in ((1.0, side), (-1.0, "left" if side == "right" else "right")):
        ends = [Place(f"end{k}", 1.5, 0.5 + way * away) for k, away in enumerate((-4.0, 4.0))]
        doors = FoundDoors(row(ends[0], Place("door", 1.5, 0.5, "door"), ends[1], width=0.9))
        for _ in range(2):
            ahead = [Waypoint(1.5, 0.5, 0.2, "door", "door", final=False, width=0.9)]
            doors.slide(ahead, {(1.5, 0.5): (x, 0.5)}, (1.4, 0.5 - 2.0 * way))
        assert (ahead[0].x, ahead[0].y) == (x, 0.5)
        assert doors.notes == {"door": f"door is 0.4 m to the {seen} of the map's"}
