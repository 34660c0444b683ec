"""Loop closing: a robot that comes back corrects its path; one that does not is left alone."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mapping_scenes import ROBOT, ROOM, drifted, drive, poses_along

from navfw.mapping import GrowingMap
from navfw.mapping.sharpening import sharpened
from navfw.signals import wrap_angle
from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, Evidence

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


@given(st.integers(2, 5), st.integers(0, 3))
def test_a_band_of_evidence_becomes_a_surface_in_its_middle(half: int, shift: int) -> None:
    evidence: Evidence = np.zeros((40, 60), np.int8)
    evidence[:, :30] = -40
    middle = 30 + half
    for column in range(middle - half, middle + half + 1):
        evidence[:, column] = round(100 - 60 * abs(column - middle) / half)
    sharp = np.roll(sharpened(np.roll(evidence, shift, axis=0)), -shift, axis=0)
    surface = np.flatnonzero(sharp[20] >= OCCUPIED_FROM)
    assert surface.min() >= middle - 2
    assert surface.max() <= middle + 2
    assert (sharp[20, : surface.min()] <= FREE_BELOW).all()
    assert (sharp[20, surface.max() + 1 :] == 0).all()


def test_what_is_thin_stays_but_for_its_ends() -> None:
    evidence: Evidence = np.full((30, 30), -40, np.int8)
    evidence[10, 5:20] = 60
    evidence[20, 20] = 96
    sharp = sharpened(evidence) >= OCCUPIED_FROM
    assert sharp[20, 20]
    assert sharp[10, 7:18].all()
    assert sharp.sum() <= 16
