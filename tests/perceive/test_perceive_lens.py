"""Lens and focal length estimated from tracked points; the model of the lens."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from perceive_images import save, texture, wall_at

from navfw.camera_geometry import (
    ARCTAN,
    FISHEYE,
    CameraCalibration,
    LensShape,
    distort,
    focal_for,
    rotation_matrix,
    straighten,
)
from navfw.numerics import Array
from navfw.perceive import (
    ImageSource,
    LensEstimate,
    LensFit,
    TrackedPair,
    Undistortion,
    estimate_lens,
    estimate_line,
    lens_estimate,
    lens_pairs,
    load_calibration,
    open_source,
    open_with_lens,
)

WIDTH, HEIGHT = 320, 240
HALF = 0.5 * WIDTH
FISH = LensShape(150.0, 1.0)
PINHOLE = LensShape(260.0, 0.0)


def shown(shape: LensShape, points: Array) -> Array:
    """Where a lens shows ``points`` (n, 3) in its axes [px from the centre]."""
    return distort(points[:, :2] / points[:, 2:], shape.curvature) * shape.focal


def drive(shape: LensShape, turn: float, count: int = 16, seed: int = 0) -> list[TrackedPair]:
    """Tracks of a camera that goes ahead and turns by ``turn`` [rad] at most between two images."""
    rng = np.random.default_rng(seed)
    pairs = []
    for k in range(count):
        rays = rng.uniform(-1.0, 1.0, (80, 2)) * [0.95 * HALF, 0.47 * HEIGHT]
        flat = straighten(rays / shape.focal, shape.curvature)
        now = np.column_stack([flat, np.ones(80)]) * rng.uniform(1.0, 6.0, (80, 1))
        vector = np.array([0.1 * turn * rng.normal(), turn * math.sin(0.7 * k + 0.5), 0.0])
        past = (now + np.array([0.02, 0.0, 0.15])) @ rotation_matrix(vector)
        moved = shown(shape, past) + rng.normal(0.0, 0.15, (80, 2))
        pairs.append(TrackedPair(shown(shape, now), moved))
    return pairs


def estimated(
    monkeypatch: pytest.MonkeyPatch, pairs: list[TrackedPair], hfov: float | None = None
) -> LensEstimate:
    """The estimate by ``pairs`` in place of tracked images."""
    monkeypatch.setattr(lens_estimate, "lens_pairs", lambda *_: (pairs, (WIDTH, HEIGHT)))
    return estimate_lens(ImageSource(10.0, 0, (), None), hfov)


@pytest.mark.parametrize("curvature", [-0.5, -1e-8, 0.0, 1e-4, 0.3, 1.0, 1.5])
def test_straighten_undoes_distort(curvature: float) -> None:
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (50, 2))
    assert straighten(distort(points, curvature), curvature) == pytest.approx(points, abs=1e-9)
    middle = distort(np.array([1e-4, 0.0]), curvature)
    assert middle == pytest.approx([1e-4, 0.0], abs=1e-9)


def test_curvature_1_is_the_equidistant_fisheye() -> None:
    matrix = np.array([[150.0, 0.0, 159.5], [0.0, 150.0, 119.5], [0.0, 0.0, 1.0]])
    grey = texture()[:HEIGHT, :WIDTH, None]
    image = np.asarray(np.repeat(grey, 3, axis=2), dtype=np.uint8)
    views = []
    for model, coefficients in ((FISHEYE, np.zeros(4)), (ARCTAN, np.ones(1))):
        camera = CameraCalibration("file", matrix, coefficients, model, (WIDTH, HEIGHT))
        straight = Undistortion(camera, WIDTH, HEIGHT)
        views.append((straight.hfov, straight.apply(image).astype(np.int16)))
    assert views[0][0] == pytest.approx(views[1][0], abs=1e-6)
    assert np.abs(views[0][1] - views[1][1]).max() <= 2
    assert focal_for(HALF, HALF / 150.0, 1.0) == pytest.approx(150.0)


def test_a_calibration_file_may_have_the_lens(tmp_path: Path) -> None:
    file = tmp_path / "lens.yaml"
    file.write_text(
        "image_width: 320\nimage_height: 240\ndistortion_model: arctan\n"
        "camera_matrix: [150, 0, 159.5, 0, 150, 119.5, 0, 0, 1]\ndistortion_coefficients: [0.9]\n"
    )
    found = load_calibration(file)
    assert (found.model, found.coefficients.tolist()) == (ARCTAN, [0.9])


def test_the_fit_finds_focal_length_and_curvature() -> None:
    shape = LensShape(200.0, 0.45)
    fit = LensFit(drive(shape, 0.08), HALF)
    found = fit.refined(fit.start())
    assert found.focal == pytest.approx(shape.focal, rel=0.03)
    assert found.curvature == pytest.approx(shape.curvature, abs=0.05)
    assert fit.bend(found) == pytest.approx(0.057 * HALF**2 / shape.focal, rel=0.2)
    numbers = (found.focal, found.curvature, fit.bend(found))
    assert numbers == pytest.approx((198.510298, 0.451028591, 6.57172482), rel=1e-5)


def test_wrong_tracks_do_not_move_the_fit() -> None:
    shape, rng = LensShape(200.0, 0.45), np.random.default_rng(3)
    pairs = drive(shape, 0.08)
    for pair in pairs:  # an eighth of the tracks follows something else
        pair.past[::8] = pair.now[::8] + rng.normal([6.0, -4.0], 3.0, (10, 2))
    fit = LensFit(pairs, HALF)
    fitted = fit.refined(fit.start())
    assert fitted.focal == pytest.approx(shape.focal, rel=0.05)
    assert fitted.curvature == pytest.approx(shape.curvature, abs=0.08)


def test_a_fisheye_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    found = estimated(monkeypatch, drive(FISH, 0.08))
    assert found.calibration is not None
    assert found.calibration.model == ARCTAN
    data = found.as_data()
    assert data["curvature"] == 1.0
    assert data["focal_px"] == pytest.approx(150.0, rel=0.03)
    assert data["hfov_deg"] == pytest.approx(math.degrees(WIDTH / 150.0), abs=4.0)
    assert "distortion arctan 1.0 +- 0.0" in estimate_line(found)
    assert (data["focal_px"], data["focal_sigma_px"]) == (149.47, 7.49)
    assert (data["hfov_deg"], data["curvature_sigma"]) == (122.7, 0.052)


def test_a_lens_without_distortion_gets_none(monkeypatch: pytest.MonkeyPatch) -> None:
    found = estimated(monkeypatch, drive(PINHOLE, 0.08))
    assert found.calibration is None
    assert found.shape is not None
    assert found.shape.curvature == 0.0
    data = found.as_data()
    assert (data["focal_px"], data["focal_sigma_px"]) == (259.01, 13.03)
    assert (data["hfov_deg"], data["curvature_sigma"]) == (63.4, 0.051)
    assert "no distortion" in estimate_line(found)


def test_without_turns_no_focal_length_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    found = estimated(monkeypatch, drive(PINHOLE, 0.001))
    assert found.shape is None
    assert found.as_data()["focal_px"] is None
    assert estimate_line(found).startswith("estimated: nothing about the lens, by 16 pairs")


@pytest.mark.parametrize(("bend", "known"), [(0.01, False), (0.02, True)])
def test_a_focal_length_needs_a_bent_flow(
    monkeypatch: pytest.MonkeyPatch, bend: float, known: bool
) -> None:
    monkeypatch.setattr(lens_estimate, "_jackknife", lambda *_: (PINHOLE, [0.0, 0.0, 0.0]))
    monkeypatch.setattr(LensFit, "start", lambda _: PINHOLE)
    monkeypatch.setattr(LensFit, "refined", lambda *_: PINHOLE)
    monkeypatch.setattr(LensFit, "bend", lambda *_: bend * WIDTH)
    assert (estimated(monkeypatch, drive(PINHOLE, 0.0)).shape == PINHOLE) == known


def test_a_known_view_leaves_the_curvature(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = LensShape(focal_for(HALF, math.radians(50.0), 0.5), 0.5)
    found = estimated(monkeypatch, drive(shape, 0.03), hfov=100.0)
    assert found.hfov == pytest.approx(100.0)
    data = found.as_data()
    assert (data["focal_px"], data["hfov_deg"]) == (None, None)
    assert (data["curvature"], data["curvature_sigma"]) == (0.506, 0.056)


def test_few_pairs_tell_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert estimated(monkeypatch, drive(FISH, 0.08, count=14)).shape is None
    assert estimated(monkeypatch, []).as_data()["pairs"] == 0


def test_images_are_paired_until_one_is_bad(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = texture()
    folder = save(tmp_path, [wall_at(2.0 - 0.06 * k, picture) for k in range(12)])
    pairs, size = lens_pairs(open_source([folder], 10.0), lambda: None)
    assert size == (WIDTH, HEIGHT)
    assert 4 < len(pairs) < 12
    assert min(len(pair.now) for pair in pairs) >= 60
    with monkeypatch.context() as patch:  # images are read until six are exceeded
        patch.setattr(lens_estimate, "MAX_PIXELS", 6 * WIDTH * HEIGHT)
        ticks: list[int] = []
        part, _ = lens_pairs(open_source([folder], 10.0), lambda: ticks.append(1))
        assert len(ticks) == 7
        assert 0 < len(part) < len(pairs)
    assert cv2.imwrite(str(folder / "image_7.png"), np.zeros((90, 90, 3), np.uint8))
    fewer, _ = lens_pairs(open_source([folder], 10.0), lambda: None)
    assert 0 < len(fewer) < len(pairs)
    images, hfov, lens = open_with_lens(lambda camera: open_source([folder], 10.0, camera), 65.0)
    assert (hfov, lens.shape, images.hfov) == (65.0, None, None)
