"""Registered flow: reach, sigma and its parts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flow_scene import cell_truth, room, turn_about, wall

import navfw.flow.registered as module
from navfw.flow import (
    ROUGHNESS_POWER,
    ROUGHNESS_RANGE,
    SIGMA_UNKNOWN,
    UNKNOWN_ROUGHNESS,
    BlockMatching,
    Registered,
    grid_windows,
    register_windows,
    roughness,
)
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, FramePair

ROBOT = RobotModel()
CAMERA = ROBOT.camera
ALL = np.ones((12, 16), bool)


def plane() -> Array:
    """A flow field (12, 16, 2) that changes linearly."""
    x, y = np.meshgrid(np.arange(16.0), np.arange(12.0))
    return np.stack([0.3 * x - 0.1 * y, 0.2 * y + 1.0], axis=-1)


@pytest.mark.parametrize("sigma", [0.02, 0.2])
def test_roughness_is_error_in_units_of_sigma(sigma: float) -> None:
    assert roughness(plane(), np.full((12, 16), sigma**2), ALL, 10) < 1e-9
    noise = sigma * np.random.default_rng(1).standard_normal((12, 16, 2))
    # the median length of two normal components
    usual = math.sqrt(2.0 * math.log(2.0))
    for share in (1.0, 0.5):
        variance = np.full((12, 16), (share * sigma) ** 2)
        found = roughness(plane() + noise, variance, ALL, 10)
        assert found == pytest.approx(usual / share, rel=0.12)


def test_roughness_leaves_out_what_is_not_trusted() -> None:
    vectors, variance, trusted = plane(), np.full((12, 16), 0.01), ALL.copy()
    vectors[::2, 5::2] += 7.0
    vectors[1::2, 6::2] += 7.0
    trusted[:, 5:] = False
    assert roughness(vectors, variance, trusted, 10) < 1e-9
    assert roughness(vectors, variance, ALL, 10) > 10.0
    trusted[:, 3:] = False
    trusted[4:] = False
    # 3 columns of 4 rows: 4 triples along rows, 6 along columns
    assert roughness(vectors, variance, trusted, 10) < 1e-9
    assert math.isnan(roughness(vectors, variance, trusted, 11))


def test_sensitivity_is_sigma_for_a_residual_of_one_grey_level() -> None:
    x, y = grid_windows(160, 16, 20, 1), grid_windows(120, 12, 20, 1)
    start = np.zeros((12, 16, 2))
    found = []
    for noise in (2.0, 6.0):
        pair, _ = wall(CAMERA).pair(CameraMotion(np.eye(3), np.zeros(3), 0.1), noise)
        found.append(
            register_windows(pair.now.image, pair.past.image, x, y, start, ALL, (0, 160, 0, 120))
        )
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
    still = CameraMotion(np.eye(3), np.zeros(3), 0.2)
    return FramePair(pair.past, pair.now, still), truth


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
    still = CameraMotion(np.eye(3), np.zeros(3), 0.2)
    pair = FramePair(pair.past, pair.now, still)
    assert np.abs(truth[..., 0]).min() > 9.0
    share, error = within(Registered(ROBOT).compute(pair), truth)
    assert error < 0.3
    assert share > 0.8
    assert (BlockMatching(ROBOT).compute(pair).confidence >= 0.3).mean() < 0.2


@pytest.mark.parametrize(
    ("rough", "scale"),
    [
        (1.0, 1.0),
        (2.0, 2.0**ROUGHNESS_POWER),
        (0.01, ROUGHNESS_RANGE[0] ** ROUGHNESS_POWER),
        (50.0, ROUGHNESS_RANGE[1] ** ROUGHNESS_POWER),
        (math.nan, UNKNOWN_ROUGHNESS**ROUGHNESS_POWER),
    ],
)
def test_all_sigmas_grow_with_the_roughness(
    monkeypatch: pytest.MonkeyPatch, rough: float, scale: float
) -> None:
    pair, _ = shaken(3.0, 2)
    params = Registered.Params(sigma_max=10.0)
    sigmas = []
    for value in (1.0, rough):
        monkeypatch.setattr(module, "roughness", lambda *_, value=value: value)
        sigmas.append(Registered(ROBOT, params).compute(pair).sigma)
    usual, other = sigmas
    free = (usual < SIGMA_UNKNOWN) & (other < SIGMA_UNKNOWN)
    assert free.mean() > 0.5
    np.testing.assert_allclose(other[free], scale * usual[free])


def test_a_large_sigma_is_not_trusted() -> None:
    pair, _ = shaken(3.0, 2)
    loose = Registered(ROBOT, Registered.Params(sigma_full=5.0, sigma_max=5.0)).compute(pair)
    strict = Registered(ROBOT, Registered.Params(sigma_full=0.05, sigma_max=0.1)).compute(pair)
    kept = strict.confidence > 0.0
    expected = loose.confidence * np.minimum(0.05 / strict.sigma, 1.0) ** 2
    np.testing.assert_allclose(strict.confidence[kept], expected[kept])
    assert 0.1 < kept.mean() < (loose.confidence > 0.0).mean()
    assert strict.sigma[kept].max() <= 0.1
    np.testing.assert_array_equal(strict.sigma[kept], loose.sigma[kept])


def test_points_are_the_centres_of_the_windows() -> None:
    pair, _ = shaken(0.0, 2)
    flow = Registered(ROBOT).compute(pair)
    assert flow.points[0, 0].tolist() == [-72.0, -52.0]  # pixels 1 to 15 of -80 to 80
    assert flow.points[5, 7].tolist() == [-5.0, -5.0]
    assert flow.points[-1, -1].tolist() == [72.0, 52.0]
