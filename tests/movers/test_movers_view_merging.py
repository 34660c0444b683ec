"""Halves of one mover in two images that meet are one mover; others stay apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.movers.view_merging import merge_views
from navfw.robot import RobotModel, SideViews
from navfw.signals import MovingObject

ROBOT = RobotModel(side_views=SideViews())
CAMERAS = (ROBOT.camera, *ROBOT.side_cameras)
HALF = 0.5 * ROBOT.camera.hfov


def mover(right: float, left: float, distance: float = 1.0, ahead: float = 0.3) -> MovingObject:
    """Seen between two bearings [rad]; walks ``ahead`` [m/s]."""
    information = 100.0 * np.eye(2)
    evidence = information @ np.array([ahead, 0.0])
    return MovingObject(
        1.0, 0.5 * (left + right), 0.5 * (left - right), distance, information, evidence
    )


@given(
    middle=st.floats(HALF - 0.05, HALF + 0.05),
    width=st.floats(0.15, 0.3),
    distance=st.floats(0.3, 2.0),
    side=st.sampled_from([1, -1]),
)
def test_halves_at_a_seam_are_one(middle: float, width: float, distance: float, side: int) -> None:
    # flow ends a little before either image's border
    inner = mover(middle - width, HALF - 0.05, distance)
    outer = mover(HALF - 0.02, middle + width, 1.2 * distance)
    if side < 0:
        inner, outer = (
            mover(-m.bearing - m.width, -m.bearing + m.width, m.distance) for m in (inner, outer)
        )
    views = [[inner], [outer], []] if side > 0 else [[inner], [], [outer]]
    (joined,) = merge_views(views, CAMERAS)
    assert joined.bearing == pytest.approx(side * middle, abs=1e-9)
    assert joined.width == pytest.approx(width, abs=1e-9)
    assert distance <= joined.distance <= 1.2 * distance
    assert joined.velocity()[0] == pytest.approx(0.3, rel=0.1)
    assert np.allclose(joined.information, 200.0 * np.eye(2))


def test_one_across_all_three_images_is_one() -> None:
    views = [
        [mover(-HALF + 0.03, HALF - 0.03, 0.3)],
        [mover(HALF - 0.05, 1.0, 0.3)],
        [mover(-1.0, -HALF + 0.05, 0.3)],
    ]
    (joined,) = merge_views(views, CAMERAS)
    assert joined.width == pytest.approx(1.0)


def test_who_is_far_from_the_seam_stays_who_it_is() -> None:
    views = [[mover(0.1, 0.4)], [mover(0.7, 0.9), mover(1.2, 1.4)], [mover(-1.2, -1.0)]]
    joined = merge_views(views, CAMERAS)
    assert [round(m.bearing, 2) for m in joined] == [1.3, 0.8, 0.25, -1.1]


def test_halves_at_other_distances_are_of_two() -> None:
    views = [[mover(0.5, HALF - 0.05, 2.0)], [mover(HALF - 0.05, 1.0, 0.6)], []]
    assert len(merge_views(views, CAMERAS)) == 2


def test_one_image_alone_has_no_seams() -> None:
    ahead = [mover(0.5, HALF), mover(-0.2, 0.1)]
    assert merge_views([ahead], CAMERAS[:1]) == tuple(ahead)
    assert math.isclose(ahead[0].distance, 1.0)
