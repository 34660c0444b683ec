"""The past image turned into current axes, and how much of the current image it covers."""

from __future__ import annotations

import numpy as np
from flow_scene import turn_about
from hypothesis import given
from hypothesis import strategies as st

from navfw.camera_geometry import rotate_points
from navfw.flow import align_past, visible_in_past
from navfw.robot import CameraModel

CAMERA = CameraModel()


def test_aligned_past_repeats_the_past_when_nothing_turned() -> None:
    image = np.random.default_rng(0).integers(0, 256, (120, 160)).astype(np.uint8)
    assert align_past(image, np.eye(3), CAMERA) is image
    assert visible_in_past(np.eye(3), CAMERA) == (0, 160, 0, 120)


@given(axis=st.integers(0, 1), angle=st.floats(-0.1, 0.1))
def test_visible_limits_are_those_of_the_past_image(axis: int, angle: float) -> None:
    rotation = turn_about(axis, angle)
    seen = np.full((120, 160), 200, np.uint8)
    left, right, top, bottom = visible_in_past(rotation, CAMERA)
    x = np.array([left, right]) - 80.0
    y = np.array([top, bottom]) - 60.0
    middle = np.array([[x[0], 0.0], [x[1], 0.0], [0.0, y[0]], [0.0, y[1]]])
    past = rotate_points(middle, rotation.T, CAMERA.focal)
    limits = (np.abs(past) <= np.array([80.0, 60.0]) + 0.5).all()
    assert limits
    # and not a pixel less: one further out lies outside the past image or the current one
    wider = middle + np.sign(middle) * 1.5
    outside = rotate_points(wider, rotation.T, CAMERA.focal)
    beyond = (np.abs(outside) > np.array([80.0, 60.0])) | (np.abs(wider) > np.array([80.0, 60.0]))
    assert beyond.any(axis=-1).all()
    assert align_past(seen, rotation, CAMERA).min() == 200
