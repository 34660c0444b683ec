from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.flow import Registration, find_mixtures, register_windows
from navfw.numerics import Array, Image

X = np.array([[20, 44], [60, 84], [100, 124]])
Y = np.array([[20, 44], [70, 94]])
WHOLE = (0, 160, 0, 120)
ALL = np.ones((2, 3), bool)


def texture(seed: int) -> Image:
    noise = np.random.default_rng(seed).normal(size=(120, 160))
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.0)
    return np.asarray(np.clip(128 + 40 * smooth / smooth.std(), 0, 255), dtype=np.uint8)


def moved(past: Image, affine: Array, shift: Array) -> Image:
    """The image whose point p was at p - (shift + affine p) in ``past``."""
    y, x = np.mgrid[:120, :160].astype(np.float64)
    at = np.stack([x - 80, y - 60], axis=-1)
    flow = shift + at @ affine.T
    source = (np.stack([x, y], axis=-1) - flow).astype(np.float32)
    image = cv2.remap(past, source[..., 0], source[..., 1], cv2.INTER_CUBIC)
    return np.asarray(image, dtype=np.uint8)


def truth(affine: Array, shift: Array) -> Array:
    cx, cy = (X.sum(1) - 1) / 2 - 80, (Y.sum(1) - 1) / 2 - 60
    centres = np.stack(np.meshgrid(cx, cy), axis=-1)
    return np.asarray(shift + centres @ affine.T)


def register(
    now: Image, past: Image, start: Array, stride: int = 3, width: float = 0.6
) -> Registration:
    return register_windows(now, past, X, Y, start, ALL, WHOLE, stride, width)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 99),
    shift=st.tuples(*[st.floats(-3, 3)] * 2),
    affine=st.tuples(*[st.floats(-0.06, 0.06)] * 4),
    off=st.tuples(*[st.floats(-0.7, 0.7)] * 2),
)
def test_affine_motions_are_found(
    seed: int,
    shift: tuple[float, float],
    affine: tuple[float, ...],
    off: tuple[float, float],
) -> None:
    past = texture(seed)
    matrix, by = np.array(affine).reshape(2, 2), np.array(shift)
    true = truth(matrix, by)
    found = register(moved(past, matrix, by), past, true + off)
    assert (found.score > 0.97).all()
    assert np.abs(found.vectors - true).max() < 0.15
    assert np.abs(found.vectors - true).mean() < 0.04


def test_brightness_may_differ_by_gain_and_offset() -> None:
    past, by = texture(1), np.array([0.6, -0.4])
    now = moved(past, np.zeros((2, 2)), by)
    darker = (0.7 * now.astype(np.float64) + 12).astype(np.uint8)
    found = register(darker, past, np.zeros((2, 3, 2)))
    np.testing.assert_allclose(found.vectors, np.broadcast_to(by, (2, 3, 2)), atol=0.08)


@pytest.mark.parametrize("stride", [1, 2, 3, 4])
def test_a_finer_stride_is_surer(stride: int) -> None:
    rng = np.random.default_rng(0)
    past = texture(2)
    now = moved(past, np.zeros((2, 2)), np.array([0.5, 0.3]))
    noisy = np.clip(now + rng.normal(0, 4, now.shape), 0, 255).astype(np.uint8)
    found = register(noisy, past, np.zeros((2, 3, 2)), stride=stride)
    off = np.abs(found.vectors - [0.5, 0.3])
    assert off.max() < 0.1 * (1 + stride)
    finer = register(noisy, past, np.zeros((2, 3, 2)), stride=1)
    assert (finer.sigma <= found.sigma * 1.2).all()


def test_what_is_left_out_keeps_its_start_and_scores_nothing() -> None:
    past = texture(3)
    active = ALL.copy()
    active[0, 1] = False
    start = np.full((2, 3, 2), 0.25)
    found = register_windows(past, past, X, Y, start, active, WHOLE)
    assert found.score[0, 1] == 0
    assert np.isinf(found.sigma[0, 1])
    np.testing.assert_array_equal(found.vectors[0, 1], [0.25, 0.25])
    assert found.score[active].min() > 0.99
    assert np.abs(found.vectors[active]).max() < 0.02


def test_windows_without_texture_and_unlike_windows_score_little() -> None:
    past, flat = texture(4), np.full((120, 160), 90, np.uint8)
    assert not register(flat, past, np.zeros((2, 3, 2))).score.any()
    assert register(past, flat, np.zeros((2, 3, 2))).score.max() < 0.1
    assert register(texture(5), past, np.zeros((2, 3, 2))).score.max() < 0.85


def test_samples_outside_the_past_image_are_counted() -> None:
    past = texture(6)
    limits = (30, 160, 0, 120)
    found = register_windows(past, past, X, Y, np.zeros((2, 3, 2)), ALL, limits)
    assert (found.share[:, 0] < 0.7).all()
    assert (found.share[:, 1:] == 1.0).all()


def test_only_a_motion_that_neither_neighbour_has_is_a_mixture() -> None:
    places: Array = 10.0 * np.arange(5, dtype=np.float64)
    vectors, gradients = np.zeros((3, 5, 2)), np.zeros((3, 5, 4))
    vectors[:, 3:, 0] = 6.0  # a near surface on the right
    trusted = np.ones((3, 5), bool)
    assert not find_mixtures(vectors, gradients, trusted, places, places[:3]).any()
    # the window between them fits both by bending
    vectors[:, 2, 0], gradients[:, 2, 0] = 3.0, 0.5
    found = find_mixtures(vectors, gradients, trusted, places, places[:3])
    np.testing.assert_allclose(found[:, 2], 2.0)
    # beside the edge, the other neighbour agrees
    assert not found[:, [0, 1, 3, 4]].any()
    # without trust in the near surface no neighbour agrees either
    trusted[:, 3:] = False
    assert (find_mixtures(vectors, gradients, trusted, places, places[:3])[:, 2] >= 2.0).all()


def test_a_steep_change_that_both_neighbours_follow_is_no_mixture() -> None:
    affine = np.array([[0.15, 0.0], [0.0, 0.1]])
    past = texture(9)
    columns = np.array([[k, k + 24] for k in range(38, 100, 10)])
    rows = np.array([[k, k + 24] for k in range(28, 70, 10)])
    cx, cy = (columns.sum(1) - 1) / 2 - 80, (rows.sum(1) - 1) / 2 - 60
    start = np.stack(np.meshgrid(cx, cy), axis=-1) @ affine.T
    active = np.ones(start.shape[:2], bool)
    now = moved(past, affine, np.zeros(2))
    found = register_windows(now, past, columns, rows, start, active, WHOLE)
    assert found.mixture[1:-1, 1:-1].max() < 0.3
