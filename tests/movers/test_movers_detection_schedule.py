"""The detection schedule: when a frame is searched for moving objects, and how thoroughly."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from navfw.movers import NEAR, QUIET_TIME, DetectionMode, DetectionSchedule
from navfw.signals import MovingObject

RATE = 10.0


def detection(distance: float) -> MovingObject:
    return MovingObject(0.0, 0.0, 0.1, distance, np.eye(2), np.zeros(2))


def modes(schedule: DetectionSchedule, first: int, last: int) -> list[DetectionMode]:
    """The mode of each frame from ``first`` up to ``last``; no search finds anything."""
    frames: list[DetectionMode] = []
    for k in range(first, last):
        frames.append(schedule.next_mode(k / RATE))
        if frames[-1] != "idle":
            schedule.update((), k / RATE)
    return frames


def test_while_nothing_moves_every_other_frame_is_searched_coarsely() -> None:
    frames = modes(DetectionSchedule(), 0, 40)
    assert frames.count("coarse") == frames.count("idle") == 20
    assert all("idle" in pair and "coarse" in pair for pair in itertools.pairwise(frames))


def test_after_a_detection_every_frame_is_searched_fully_for_a_while() -> None:
    schedule = DetectionSchedule()
    modes(schedule, 0, 10)
    schedule.update((detection(2.0),), 1.0)
    quiet = 11 + round(QUIET_TIME * RATE)
    assert set(modes(schedule, 11, quiet)) == {"full"}
    assert set(modes(schedule, quiet, quiet + 4)) == {"coarse", "idle"}


def test_with_always_full_every_frame_is_searched_fully() -> None:
    assert set(modes(DetectionSchedule(always_full=True), 0, 40)) == {"full"}


@pytest.mark.parametrize(("distance", "near"), [(0.9 * NEAR, True), (1.1 * NEAR, False)])
def test_near_is_the_distance_of_the_nearest_of_the_last_search(
    distance: float, near: bool
) -> None:
    schedule = DetectionSchedule()
    assert not schedule.near
    schedule.update((detection(3.0), detection(distance)), 0.0)
    assert schedule.near is near
    schedule.update((), 0.1)
    assert not schedule.near


def test_reset_drops_the_last_detections() -> None:
    schedule = DetectionSchedule()
    schedule.update((detection(0.5),), 5.0)
    schedule.reset()
    assert not schedule.near
    assert "full" not in modes(schedule, 51, 54)
