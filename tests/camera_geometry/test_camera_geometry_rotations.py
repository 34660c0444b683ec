"""Rotations against SciPy's, and image points turned by them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from navfw.camera_geometry import (
    rotate_points,
    rotation_matrix,
    rotation_vector,
    turn_point,
    turning_slope,
    undo_turn,
)

FOCAL = 80.0
ANGLE = st.floats(-1.7, 1.7)
VECTOR = st.tuples(ANGLE, ANGLE, ANGLE).map(np.array)
POINTS = np.random.default_rng(0).uniform(-70.0, 70.0, (5, 4, 2))


@given(VECTOR, st.sampled_from([1.0, 1e-4, 1e-9, 1e-13]))
def test_matrices_and_vectors_are_those_of_scipy(vector: np.ndarray, scale: float) -> None:
    vector = vector * scale
    matrix = rotation_matrix(vector)
    assert matrix == pytest.approx(Rotation.from_rotvec(vector).as_matrix(), abs=1e-15)
    assert rotation_vector(matrix) == pytest.approx(vector, abs=1e-12, rel=1e-7)


def test_a_quarter_turn_is_counter_clockwise() -> None:
    turn = rotation_matrix(np.array([0.0, 0.0, np.pi / 2]))
    assert turn @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


@given(VECTOR.map(lambda vector: 0.2 * vector))
def test_points_turn_as_by_opencv_in_any_layout(vector: np.ndarray) -> None:
    turn = rotation_matrix(vector)
    camera = np.diag([FOCAL, FOCAL, 1.0])
    expected = cv2.perspectiveTransform(POINTS, camera @ turn @ np.linalg.inv(camera))
    assert rotate_points(POINTS, turn, FOCAL) == pytest.approx(expected, abs=1e-9)
    rows = rotate_points(POINTS.transpose(1, 0, 2), np.asfortranarray(turn), FOCAL)
    assert rows == pytest.approx(expected.transpose(1, 0, 2), abs=1e-9)
    x, y = POINTS[1, 2].tolist()
    one = turn_point(x, y, turn, FOCAL)
    assert one == pytest.approx(expected[1, 2], abs=1e-9)


def test_rays_turned_behind_the_camera_have_no_image() -> None:
    turned = rotate_points(np.zeros((1, 2)), rotation_matrix(np.array([0.0, np.pi, 0.0])), FOCAL)
    assert np.isnan(turned).all()


@given(VECTOR.map(lambda vector: 0.05 * vector))
def test_flow_of_a_turn_alone_is_undone(vector: np.ndarray) -> None:
    turn, points = rotation_matrix(vector), POINTS.reshape(-1, 2)
    vectors = points - rotate_points(points, turn.T, FOCAL)
    assert undo_turn(points, vectors, turn, FOCAL) == pytest.approx(0.0, abs=1e-9)


@given(VECTOR, st.floats(-70.0, 70.0), st.floats(-70.0, 70.0))
def test_the_slope_is_the_derivative_of_the_turn(vector: np.ndarray, x: float, y: float) -> None:
    small = 1e-6
    ends = [turn_point(x, y, rotation_matrix(s * vector), FOCAL) for s in (-small, small)]
    slope = (np.array(ends[1]) - np.array(ends[0])) / (2.0 * small)
    assert turning_slope(x, y, vector, FOCAL) == pytest.approx(slope, abs=1e-3)
