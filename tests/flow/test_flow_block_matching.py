"""Block matching, and the growth of the image in its flow."""

import cv2
import numpy as np
import pytest
from flow_scene import blurred_noise, cell_truth, pair_of, room, turn_about, wall
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import navfw.flow.block_matching as module
from navfw.errors import ConfigError
from navfw.flow.block_matching import BlockMatching
from navfw.flow.correlation_kernels import correlate, find_peaks
from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FramePair

ROBOT = RobotModel()
CAMERA = ROBOT.camera


def exhaustive_scores(
    past: Image, now: Image, x: Array, y: Array, search: int
) -> tuple[Array, tuple[int, int]]:
    """matchTemplate of one window, and the displacement (dx, dy) of its first score."""
    x0, x1 = max(0, x[0] - search), min(past.shape[1], x[1] + search)
    y0, y1 = max(0, y[0] - search), min(past.shape[0], y[1] + search)
    window = now[y[0] : y[1], x[0] : x[1]]
    scores = cv2.matchTemplate(past[y0:y1, x0:x1], window, cv2.TM_CCOEFF_NORMED)
    return np.asarray(scores, np.float64), (int(x[0] - x0), int(y[0] - y0))


@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    seed=st.integers(0, 1000),
    window=st.integers(8, 30),
    search=st.integers(2, 9),
    grid=st.sampled_from([(12, 16), (10, 20), (6, 8)]),
)
def test_scores_and_peaks_equal_exhaustive_match_template(
    seed: int, window: int, search: int, grid: tuple[int, int]
) -> None:
    rng = np.random.default_rng(seed)
    texture = blurred_noise(seed, 1.2, 45.0, (150, 190))
    dx, dy = rng.integers(-search - 1, search + 2, 2)
    past = texture[15:135, 15:175].copy()
    now = texture[15 - dy : 135 - dy, 15 - dx : 175 - dx].copy()
    now = np.clip(now + rng.normal(0, 3, now.shape), 0, 255).astype(np.uint8)
    params = BlockMatching.Params(rows=grid[0], cols=grid[1], window=window, search=search)
    matcher = BlockMatching(ROBOT, params)
    windows = matcher._x_windows, matcher._y_windows
    scores, _ = correlate(now, past, *windows, search, (0, 160, 0, 120))
    peaks = find_peaks(scores)[0]
    for r, y in enumerate(matcher._y_windows):
        for c, x in enumerate(matcher._x_windows):
            expected, (first_dx, first_dy) = exhaustive_scores(past, now, x, y, search)
            # matchTemplate goes forward in the past image, displacement is now - past
            ours = scores[r, c][::-1, ::-1]
            oy, ox = search - first_dy, search - first_dx
            part = ours[oy : oy + expected.shape[0], ox : ox + expected.shape[1]]
            np.testing.assert_allclose(part, expected, atol=2e-5)
            assert np.count_nonzero(scores[r, c] > -2.0) == expected.size
            _, _, _, (px, py) = cv2.minMaxLoc(expected)
            assert tuple(peaks[r, c]) == (first_dx - px, first_dy - py)


def test_noise_and_patterns_that_repeat_within_the_search_are_not_trusted() -> None:
    rng = np.random.default_rng(0)
    bright = [rng.integers(0, 256, (120, 160)).astype(np.uint8) for _ in range(2)]
    dark = [np.abs(rng.normal(0, 1.5, (120, 160))).astype(np.uint8) for _ in range(2)]
    wave = 50 * np.sin(2 * np.pi * np.arange(160) / 6.0)
    waves = np.clip(128 + wave[None, :] + wave[:120, None], 0, 255).astype(np.uint8)
    for past, now in (bright, dark, (waves, waves)):
        assert BlockMatching(ROBOT).compute(pair_of(past, now)).confidence.max() == 0.0


def faint_pair(contrast: float, noise: float) -> FramePair:
    """Two noisy images of one texture of that contrast [grey levels], moved by (3.4, -1.3) px."""
    rng = np.random.default_rng(1)
    texture = cv2.GaussianBlur(rng.normal(size=(160, 200)), (0, 0), 2.0)
    past = 128.0 + contrast * texture / texture.std()
    now = cv2.warpAffine(past, np.array([[1.0, 0.0, 3.4], [0.0, 1.0, -1.3]]), (200, 160))
    grey = [
        np.clip(image[20:140, 20:180] + noise * rng.normal(size=(120, 160)), 0, 255).round()
        for image in (past, now)
    ]
    return pair_of(grey[0].astype(np.uint8), grey[1].astype(np.uint8))


def test_texture_hardly_above_the_noise_is_matched_in_smoothed_images_noise_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pair = faint_pair(3.0, 2.0)
    flow = BlockMatching(ROBOT).compute(pair)
    trusted = flow.confidence > 0.3
    assert trusted.mean() > 0.8
    error = np.linalg.norm(flow.vectors - (3.4, -1.3), axis=-1)[trusted]
    assert np.median(error) < 0.2
    assert error.max() < 1.0
    for noise in (1.0, 2.0, 3.0, 5.0):  # without texture
        assert BlockMatching(ROBOT).compute(faint_pair(0.0, noise)).confidence.max() < 0.05
    monkeypatch.setattr(module, "_WEAK_SHARE", 1.0)
    assert (BlockMatching(ROBOT).compute(pair).confidence > 0.3).mean() < 0.2


def test_displacements_a_little_beyond_the_search_are_found_others_not_trusted() -> None:
    texture = blurred_noise(3, 2.0, 45.0, (120, 200))
    near, far = (
        BlockMatching(ROBOT).compute(pair_of(texture[:, :160], texture[:, dx : dx + 160]))
        for dx in (9, 14)
    )
    trusted = near.confidence > 0.3
    assert trusted[:, :-2].mean() > 0.9
    expected = np.tile([-9.0, 0.0], (trusted.sum(), 1))
    np.testing.assert_allclose(near.vectors[trusted], expected, atol=0.1)
    assert (far.confidence > 0.0).mean() < 0.05
    assert (far.confidence > 0.2).mean() < 0.01


@pytest.mark.parametrize("ahead", [0.06, 0.1, -0.06])
def test_a_growing_image_is_measured_as_well_as_a_shifting_one(ahead: float) -> None:
    pair, truth = room(CAMERA).pair(CameraMotion(np.eye(3), np.array([0, 0, ahead]), 0.2), 2.0)
    error = {}
    for subpixel in ("peak", "affine"):
        params = BlockMatching.Params.model_validate({"subpixel": subpixel})
        flow = BlockMatching(ROBOT, params).compute(pair)
        off = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
        error[subpixel] = np.percentile(off[flow.confidence > 0.3], [50, 95])
    assert error["affine"][0] < 0.08
    assert error["affine"][1] < 0.35
    # one displacement for a whole window suits no part of it
    assert (error["affine"] < 0.7 * error["peak"]).all()


def test_points_are_grid_points_except_at_the_border() -> None:
    matcher = BlockMatching(ROBOT)
    image = blurred_noise(0)
    points = matcher.compute(pair_of(image, image)).points
    np.testing.assert_allclose(points[5, 5], [-25.0, -5.0])
    assert np.abs(points[..., 0]).max() < 75.0
    assert (np.diff(points[0, :, 0]) > 0).all()
    assert (np.diff(points[:, 0, 1]) > 0).all()


def test_a_frame_of_another_size_is_refused() -> None:
    good = np.zeros((120, 160), np.uint8)
    with pytest.raises(ConfigError, match="80 x 60"):
        BlockMatching(ROBOT).compute(pair_of(good, np.zeros((60, 80), np.uint8)))
    with pytest.raises(ConfigError, match="float64"):
        BlockMatching(ROBOT).compute(pair_of(np.asarray(good, np.float64), good))


def test_other_sizes_grids_and_focal_lengths_work() -> None:
    robot = RobotModel(camera=CameraModel(width=96, height=72, hfov=1.2))
    motion = CameraMotion(turn_about(1, 0.02), np.array([0.0, 0.0, 0.04]), 0.1)
    pair, truth = wall(robot.camera).pair(motion)
    params = BlockMatching.Params(rows=8, cols=12, window=17, search=5, margin=1)
    flow = BlockMatching(robot, params).compute(pair)
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, robot.camera), axis=-1)
    assert flow.shape == (8, 12)
    assert np.median(error[flow.confidence > 0.5]) < 0.1
