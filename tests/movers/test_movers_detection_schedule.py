"""How closely to look out for movers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from navfw.movers.detection_schedule import CALM, NEAR, DetectionSchedule
from navfw.signals import MovingObject

RATE = 10.0


def mover(distance: float) -> MovingObject:
    return MovingObject(0.0, 0.0, 0.1, distance, np.eye(2), np.zeros(2))


def searched(vigilance: DetectionSchedule, first: int, last: int) -> list[bool]:
    """Of each frame from ``first`` up to ``last``, whether it is searched, in vain."""
    frames = []
    for k in range(first, last):
        frames.append(vigilance.searches(k / RATE))
        if frames[-1]:
            vigilance.saw((), k / RATE)
    return frames


def test_while_nothing_moves_no_two_frames_are_spared_one_after_the_other() -> None:
    frames = searched(DetectionSchedule(), 0, 40)
    assert sum(frames) == 20
    assert all(a or b for a, b in itertools.pairwise(frames))


def test_while_something_has_moved_lately_every_frame_is_searched() -> None:
    vigilance = DetectionSchedule()
    searched(vigilance, 0, 10)
    vigilance.saw((mover(2.0),), 1.0)
    lately = round(CALM * RATE)
    assert not vigilance.calm(1.0 + CALM)
    assert all(searched(vigilance, 11, 11 + lately))
    assert vigilance.calm(1.1 + CALM)
    assert not all(searched(vigilance, 11 + lately, 15 + lately))


@pytest.mark.parametrize(("distance", "near"), [(0.9 * NEAR, True), (1.1 * NEAR, False)])
def test_near_is_what_the_last_search_found_near(distance: float, near: bool) -> None:
    vigilance = DetectionSchedule()
    assert not vigilance.near
    vigilance.saw((mover(3.0), mover(distance)), 0.0)
    assert vigilance.near is near
    vigilance.saw((), 0.1)
    assert not vigilance.near


def test_a_new_run_knows_nothing_of_the_last() -> None:
    vigilance = DetectionSchedule()
    vigilance.saw((mover(0.5),), 5.0)
    vigilance.reset()
    assert not vigilance.near
    assert not all(searched(vigilance, 51, 54))
