"""Loop closing: a robot that comes back corrects its path; one that does not is left alone."""

import math

import pytest
from mapping_scenes import ROBOT, ROOM, drifted, drive, poses_along

from navfw.mapping import GrowingMap
from navfw.signals import wrap_angle

TWICE = ((0.0, 0.0), (4.0, 0.0), (5.0, -1.0), (4.0, 0.0), (0.0, 0.0), (-1.0, 1.0), (0.0, 0.0)) * 2


def driven(close_loops: bool, turn: float) -> tuple[GrowingMap, float]:
    """The map of two rounds by an odometry that turns too far; error of its last heading."""
    growing = GrowingMap(ROBOT, close_loops=close_loops)
    truth = list(poses_along(TWICE))
    drive(growing, ROOM, truth, drifted(truth, turn))
    assert math.dist((growing.pose.x, growing.pose.y), (truth[-1].x, truth[-1].y)) < 0.1
    return growing, abs(wrap_angle(growing.pose.yaw - truth[-1].yaw))


@pytest.mark.thorough
@pytest.mark.parametrize("turn", [-0.0015, 0.0015])
def test_a_second_round_corrects_the_poses(turn: float) -> None:
    growing, error = driven(True, turn)
    plain, drift = driven(False, turn)
    assert growing.loops.closed > 0
    assert plain.loops.closed == 0
    assert error < 0.7 * drift
