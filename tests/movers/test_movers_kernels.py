"""Compiled loops of movers in plain Python, which checks the bounds of arrays, as compiled."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfw.movers import conflict_prediction, motion_segmentation, stixels
from navfw.numerics import Array
from navfw.robot import RobotModel

CAMERA = RobotModel().camera
ROWS, COLS = 7, 5


def field(seed: int) -> tuple[Array, Array, Array, Array, Array, float]:
    """Points, vectors, sigma, confidence, translation, focal length: floor, some of it moving."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-70.0, 70.0, COLS), np.linspace(-15.0, 55.0, ROWS))
    confidence = np.where(rng.random((ROWS, COLS)) < 0.2, 0.0, 1.0)
    translation = np.array([0.01, 0.0, 0.08])
    points = np.stack([x, y], axis=-1)
    lever = points * translation[2] - CAMERA.focal * translation[:2]
    vectors = lever * floor(points)[..., None]
    vectors += np.where(rng.random((ROWS, COLS, 1)) < 0.4, rng.normal(0.0, 6.0, vectors.shape), 0.0)
    return points, vectors, np.full((ROWS, COLS), 0.2), confidence, translation, CAMERA.focal


def floor(points: Array) -> Array:
    return np.asarray(np.maximum(CAMERA.fall_per_depth(points), 0.0) / CAMERA.mount_height)


@pytest.mark.parametrize("seed", range(3))
def test_motion_segmentation(seed: int) -> None:
    flow = field(seed)
    near = floor(flow[0])
    kernel = motion_segmentation._suspects
    for standing in (False, True):
        arguments = (*flow, near, standing, (0.01, 0.05, 0.05, 0.04))
        masks = kernel(*arguments)
        assert np.array_equal(kernel.py_func(*arguments), masks)
        for mask in masks[:1] if standing else masks:
            assert mask.any()
            assert not mask.all()
            assert not mask[flow[3] == 0.0].any()
        assert np.any(masks[1:]) != standing


@pytest.mark.parametrize("seed", range(3))
def test_stixels(seed: int) -> None:
    points, vectors, sigma, confidence, translation, focal = field(seed)
    confidence[2:, 0] = 0.0  # too few cells in this column
    arguments = (points, vectors, sigma, confidence, floor(points), np.ones((ROWS, COLS)))
    rest = (translation, focal, 0.01, stixels._NEARNESS)
    compiled = stixels._columns(*arguments, *rest)
    for plain, fast in zip(stixels._columns.py_func(*arguments, *rest), compiled, strict=True):
        np.testing.assert_allclose(plain, fast, rtol=1e-9, atol=1e-12)
    assert (compiled[0] > 0.0).tolist() == [False, True, True, True, True]


def test_conflict_prediction() -> None:
    moving = np.array([[1.0, 0.2, -0.4, 0.1, 0.25], [-0.5, 0.6, 0.1, -0.3, 0.3]])
    speeds, turns = np.array([-0.1, 0.0, 0.4]), np.array([-1.0, 0.0, 0.6])
    state = np.array([0.1, -0.2, 0.4, 0.2, 0.1])
    limits, ahead = np.array([0.8, 1.2, 3.0]), np.array([3.0, 1.0, 0.06, 0.35])
    compiled, plain = np.full((2, 3, 3, 3), math.nan)
    conflict_prediction._predict(moving, speeds, turns, state, limits, 0.18, ahead, *compiled)
    conflict_prediction._predict.py_func(moving, speeds, turns, state, limits, 0.18, ahead, *plain)
    np.testing.assert_allclose(plain, compiled, atol=1e-9)
    assert np.isfinite(compiled).all()
