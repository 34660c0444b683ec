"""Registration of windows, and registered flow: reach, sigma and its parts."""

import cv2
import numpy as np
import pytest
from flow_scene import STILL, blurred_noise, cell_truth, room, turn_about, wall
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.flow import registration
from navfw.flow.block_matching import BlockMatching
from navfw.flow.registration import Registered, Registration, grid_windows, register_windows
from navfw.numerics import Array, Image
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, FramePair

ROBOT = RobotModel()
CAMERA = ROBOT.camera
X = np.array([[20, 44], [60, 84], [100, 124]])
Y = np.array([[20, 44], [70, 94]])
WHOLE = (0, 160, 0, 120)
ALL = np.ones((2, 3), bool)


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


def register(now: Image, past: Image, start: Array, stride: int = 3) -> Registration:
    return register_windows(now, past, X, Y, start, ALL, WHOLE, stride, 0.6)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 99),
    shift=st.tuples(*[st.floats(-3, 3)] * 2),
    affine=st.tuples(*[st.floats(-0.06, 0.06)] * 4),
    off=st.tuples(*[st.floats(-0.7, 0.7)] * 2),
)
def test_affine_motions_are_found(
    seed: int, shift: tuple[float, ...], affine: tuple[float, ...], off: tuple[float, ...]
) -> None:
    past = blurred_noise(seed)
    matrix, by = np.array(affine).reshape(2, 2), np.array(shift)
    true = truth(matrix, by)
    found = register(moved(past, matrix, by), past, true + off)
    assert (found.score > 0.97).all()
    assert np.abs(found.vectors - true).max() < 0.15
    assert np.abs(found.vectors - true).mean() < 0.04


def test_brightness_may_differ_by_gain_and_offset() -> None:
    past, by = blurred_noise(1), np.array([0.6, -0.4])
    now = moved(past, np.zeros((2, 2)), by)
    darker = (0.7 * now.astype(np.float64) + 12).astype(np.uint8)
    found = register(darker, past, np.zeros((2, 3, 2)))
    np.testing.assert_allclose(found.vectors, np.broadcast_to(by, (2, 3, 2)), atol=0.08)


@pytest.mark.parametrize("stride", [1, 2, 3, 4])
def test_a_finer_stride_is_surer(stride: int) -> None:
    rng = np.random.default_rng(0)
    past = blurred_noise(2)
    now = moved(past, np.zeros((2, 2)), np.array([0.5, 0.3]))
    noisy = np.clip(now + rng.normal(0, 4, now.shape), 0, 255).astype(np.uint8)
    found = register(noisy, past, np.zeros((2, 3, 2)), stride=stride)
    off = np.abs(found.vectors - [0.5, 0.3])
    assert off.max() < 0.1 * (1 + stride)
    finer = register(noisy, past, np.zeros((2, 3, 2)), stride=1)
    assert (finer.sigma <= found.sigma * 1.2).all()


def test_what_is_left_out_keeps_its_start_and_samples_outside_are_counted() -> None:
    past = blurred_noise(3)
    active = ALL.copy()
    active[0, 1] = False
    start = np.full((2, 3, 2), 0.25)
    found = register_windows(past, past, X, Y, start, active, WHOLE)
    assert found.score[0, 1] == 0
    assert np.isinf(found.sigma[0, 1])
    np.testing.assert_array_equal(found.vectors[0, 1], [0.25, 0.25])
    assert found.score[active].min() > 0.99
    assert np.abs(found.vectors[active]).max() < 0.02
    found = register_windows(past, past, X, Y, np.zeros((2, 3, 2)), ALL, (30, 160, 0, 120))
    assert (found.share[:, 0] < 0.7).all()
    assert (found.share[:, 1:] == 1.0).all()


def test_windows_without_texture_and_unlike_windows_score_little() -> None:
    past, flat = blurred_noise(4), np.full((120, 160), 90, np.uint8)
    assert not register(flat, past, np.zeros((2, 3, 2))).score.any()
    assert register(past, flat, np.zeros((2, 3, 2))).score.max() < 0.1
    assert register(blurred_noise(5), past, np.zeros((2, 3, 2))).score.max() < 0.85


def test_a_steep_change_that_both_neighbours_follow_is_no_mixture() -> None:
    affine = np.array([[0.15, 0.0], [0.0, 0.1]])
    past = blurred_noise(9)
    columns = np.array([[k, k + 24] for k in range(38, 100, 10)])
    rows = np.array([[k, k + 24] for k in range(28, 70, 10)])
    cx, cy = (columns.sum(1) - 1) / 2 - 80, (rows.sum(1) - 1) / 2 - 60
    start = np.stack(np.meshgrid(cx, cy), axis=-1) @ affine.T
    active = np.ones(start.shape[:2], bool)
    now = moved(past, affine, np.zeros(2))
    found = register_windows(now, past, columns, rows, start, active, WHOLE)
    assert found.mixture[1:-1, 1:-1].max() < 0.3


EVERY = np.ones((12, 16), bool)


def test_sensitivity_is_sigma_for_a_residual_of_one_grey_level() -> None:
    x, y = grid_windows(160, 16, 20, 1), grid_windows(120, 12, 20, 1)
    start = np.zeros((12, 16, 2))
    found = []
    for noise in (2.0, 6.0):
        pair, _ = wall(CAMERA).pair(STILL, noise)
        images = pair.now.image, pair.past.image
        found.append(register_windows(*images, x, y, start, EVERY, WHOLE))
    low, high = found
    assert np.median(high.sigma / low.sigma) == pytest.approx(3.0, rel=0.1)
    assert np.median(high.sensitivity / low.sensitivity) == pytest.approx(1.0, rel=0.1)
    # smoothing leaves about a third of the noise of each image
    assert np.median(low.sigma / low.sensitivity) == pytest.approx(1.0, abs=0.4)


def within(flow: FlowField, truth: Array) -> tuple[float, float]:
    """Share of the trusted vectors within two sigmas of the truth, and their mean error [px]."""
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    trusted = flow.confidence >= 0.3
    assert trusted.mean() > 0.35
    return float((error < 2.0 * flow.sigma)[trusted].mean()), float(error[trusted].mean())


def shaken(noise: float, seed: int) -> tuple[FramePair, Array]:
    motion = CameraMotion(turn_about(1, 0.02), np.array([0.003, 0.0, 0.05]), 0.2)
    pair, truth = room(CAMERA, seed).pair(motion, noise)
    return FramePair(pair.past, pair.now, STILL), truth


@pytest.mark.parametrize("noise", [2.0, 5.0, 9.0])
def test_sigma_follows_the_noise_of_the_images(noise: float) -> None:
    shares, errors, sigmas = [], [], []
    for seed in range(2, 6):
        pair, truth = shaken(noise, seed)
        flow = Registered(ROBOT).compute(pair)
        share, error = within(flow, truth)
        shares.append(share)
        errors.append(error)
        sigmas.append(float(np.median(flow.sigma[flow.confidence >= 0.3])))
    assert 0.78 < np.mean(shares) < 0.97
    assert 0.4 < np.mean(sigmas) / np.mean(errors) < 1.2


def test_a_displacement_beyond_the_reach_of_block_matching() -> None:
    """Nothing is known about the turn, which moves the image by 9 px and more."""
    motion = CameraMotion(turn_about(1, 0.115), np.zeros(3), 0.2)
    pair, truth = room(CAMERA).pair(motion, noise=2.0)
    pair = FramePair(pair.past, pair.now, STILL)
    assert np.abs(truth[..., 0]).min() > 9.0
    share, error = within(Registered(ROBOT).compute(pair), truth)
    assert error < 0.3
    assert share > 0.8
    assert (BlockMatching(ROBOT).compute(pair).confidence >= 0.3).mean() < 0.2


def test_a_large_sigma_is_not_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    pair, _ = shaken(3.0, 2)
    found = []
    for full, most in ((5.0, 5.0), (0.05, 0.1)):
        monkeypatch.setattr(registration, "_FULL_SIGMA", full)
        monkeypatch.setattr(registration, "_MAX_SIGMA", most)
        found.append(Registered(ROBOT).compute(pair))
    loose, strict = found
    kept = strict.confidence > 0.0
    expected = loose.confidence * np.minimum(0.05 / strict.sigma, 1.0) ** 2
    np.testing.assert_allclose(strict.confidence[kept], expected[kept])
    assert 0.1 < kept.mean() < (loose.confidence > 0.0).mean()
    assert strict.sigma[kept].max() <= 0.1
    np.testing.assert_array_equal(strict.sigma[kept], loose.sigma[kept])
    # points are the centres of the windows
    assert loose.points[0, 0].tolist() == [-72.0, -52.0]  # pixels 1 to 15 of -80 to 80
    assert loose.points[5, 7].tolist() == [-5.0, -5.0]
    assert loose.points[-1, -1].tolist() == [72.0, 52.0]
