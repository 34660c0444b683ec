"""View merging: parts of one object in adjacent views are joined, other detections are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.movers import merge_views
from navfw.robot import RobotModel, SideViews
from navfw.signals import MovingObject

ROBOT = RobotModel(side_views=SideViews())
CAMERAS = (ROBOT.camera, *ROBOT.side_cameras)
HALF = 0.5 * ROBOT.camera.hfov


def detection(right: float, left: float, distance: float = 1.0, ahead: float = 0.3) -> MovingObject:
    """A detection between two bearings [rad]; it moves by ``ahead`` [m/s]."""
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
def test_parts_at_the_border_of_two_views_are_one(
    middle: float, width: float, distance: float, side: int
) -> None:
    # flow ends a little before the border of either image
    inner = detection(middle - width, HALF - 0.05, distance)
    outer = detection(HALF - 0.02, middle + width, 1.2 * distance)
    if side < 0:
        inner, outer = (
            detection(-m.bearing - m.width, -m.bearing + m.width, m.distance)
            for m in (inner, outer)
        )
    views = [[inner], [outer], []] if side > 0 else [[inner], [], [outer]]
    (joined,) = merge_views(views, CAMERAS)
    assert joined.bearing == pytest.approx(side * middle, abs=1e-9)
    assert joined.width == pytest.approx(width, abs=1e-9)
    assert distance <= joined.distance <= 1.2 * distance
    assert joined.velocity()[0] == pytest.approx(0.3, rel=0.1)
    assert np.allclose(joined.information, 200.0 * np.eye(2))


def test_an_object_across_all_three_views_is_one() -> None:
    views = [
        [detection(-HALF + 0.03, HALF - 0.03, 0.3)],
        [detection(HALF - 0.05, 1.0, 0.3)],
        [detection(-1.0, -HALF + 0.05, 0.3)],
    ]
    (joined,) = merge_views(views, CAMERAS)
    assert joined.width == pytest.approx(1.0)


def test_detections_far_from_the_border_stay_apart() -> None:
    views = [
        [detection(0.1, 0.4)],
        [detection(0.7, 0.9), detection(1.2, 1.4)],
        [detection(-1.2, -1.0)],
    ]
    joined = merge_views(views, CAMERAS)
    assert [round(m.bearing, 2) for m in joined] == [1.3, 0.8, 0.25, -1.1]


def test_parts_at_different_distances_are_two_objects() -> None:
    views = [[detection(0.5, HALF - 0.05, 2.0)], [detection(HALF - 0.05, 1.0, 0.6)], []]
    assert len(merge_views(views, CAMERAS)) == 2


def test_a_single_view_is_left_as_it_is() -> None:
    ahead = [detection(0.5, HALF), detection(-0.2, 0.1)]
    assert merge_views([ahead], CAMERAS[:1]) == tuple(ahead)
    assert math.isclose(ahead[0].distance, 1.0)
