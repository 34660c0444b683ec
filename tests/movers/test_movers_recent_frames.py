"""Pairs of frames in which moving objects show."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.movers import RecentFrames
from navfw.robot import RobotModel
from navfw.signals import Frame, Odometry, Pose, Twist

ROBOT = RobotModel()
IMAGE = np.zeros((ROBOT.camera.height, ROBOT.camera.width), dtype=np.uint8)


@pytest.mark.parametrize(("v", "w"), [(0.0, 0.0), (0.3, 0.5), (0.0, 1.2)])
@pytest.mark.parametrize(("near", "interval"), [(False, 0.2), (True, 0.1)])
def test_pairs_span_a_fixed_time_whatever_the_robot_does(
    v: float, w: float, near: bool, interval: float
) -> None:
    frames = RecentFrames(ROBOT)
    assert frames.pair() is None
    for i in range(8):
        t = 0.1 * i
        pose = Pose(v * t, 0.0, w * t)
        frames.add(Frame(t, IMAGE), Odometry(t, pose, Twist(v, w), 0.0, False))
    pair = frames.pair(near)
    assert pair is not None
    assert pair.now.time == pytest.approx(0.7)
    assert pair.now.time - pair.past.time == pytest.approx(interval)


def test_frames_far_apart_or_after_a_wide_turn_make_no_pair() -> None:
    for times, turns in (((0.0, 0.6), (0.0, 0.0)), ((0.0, 0.2), (0.0, 0.5))):
        frames = RecentFrames(ROBOT)
        for time, turn in zip(times, turns, strict=True):
            odometry = Odometry(time, Pose(0.0, 0.0, turn), Twist(0.0, 0.0), 0.0, False)
            frames.add(Frame(time, IMAGE), odometry)
        assert frames.pair() is None
