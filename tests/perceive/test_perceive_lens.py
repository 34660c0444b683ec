"""The lens: calibration files, images without distortion, and its estimate by tracked points."""

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from cli_calls import put_file
from perceive_images import HEIGHT, WIDTH, texture

from navfw.camera_geometry.rotations import rotation_matrix
from navfw.egomotion.flow_egomotion import PointMotion
from navfw.errors import InputError
from navfw.lenses import (
    ARCTAN,
    CameraCalibration,
    LensShape,
    Undistortion,
    focal_for,
    load_calibration,
)
from navfw.lenses.lens_models import FISHEYE, distort, straighten
from navfw.numerics import Array, Image
from navfw.perceive import lens_estimate
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.lens_estimate import LensEstimate, estimate_lens, estimate_line
from navfw.perceive.lens_fit import LensFit

MATRIX = np.array([[210.0, 0.0, 155.0], [0.0, 205.0, 124.0], [0.0, 0.0, 1.0]])
PLUMB_BOB = np.array([-0.28, 0.07, 0.001, -0.002, 0.01])
RATIONAL = np.array([-0.2, 0.05, 0.001, 0.001, 0.01, 0.05, 0.01, 0.002])
EQUIDISTANT = np.array([0.02, -0.01, 0.003, -0.001])

ROS = """image_width: 320
image_height: 240
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [210.0, 0.0, 155.0, 0.0, 205.0, 124.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.28, 0.07, 0.001, -0.002, 0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


def loaded(folder: Path, text: str) -> CameraCalibration:
    return load_calibration(put_file(folder, "camera.yaml", text))


def lens(
    coefficients: Array = PLUMB_BOB,
    model: str = "plumb_bob",
    size: tuple[int, int] | None = (320, 240),
    focal: float | None = None,
) -> CameraCalibration:
    """A lens with ``MATRIX``, or with ``focal`` [px] in the middle of images of 320 x 240 px."""
    matrix = (
        MATRIX if focal is None else np.array([[focal, 0, 159.5], [0, focal, 119.5], [0, 0, 1]])
    )
    return CameraCalibration("camera.yaml", matrix, coefficients, model, size)


def opencv_file(tmp_path: Path, **entries: Any) -> Path:
    path = tmp_path / "camera.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in entries.items():
        storage.write(key, value)
    storage.release()
    return path


@pytest.mark.parametrize("directive", ["%YAML:1.0", "%YAML 1.2"], ids=["opencv4", "opencv5"])
@pytest.mark.parametrize("name", ["distortion_coefficients", "dist_coeffs"])
def test_file_written_by_opencv(tmp_path: Path, name: str, directive: str) -> None:
    entries = {"image_width": 320, "image_height": 240, "camera_matrix": MATRIX}
    path = opencv_file(tmp_path, **entries, **{name: PLUMB_BOB[:, None]})
    head, rest = path.read_text().split("\n", 1)
    assert head.startswith("%YAML")
    path.write_text(f"{directive}\n{rest}")
    read = load_calibration(path)
    assert read.matrix.tolist() == MATRIX.tolist()
    assert read.coefficients.tolist() == PLUMB_BOB.tolist()
    assert (read.model, read.size) == ("plumb_bob", (320, 240))


def test_fisheye_file_written_by_opencv(tmp_path: Path) -> None:
    entries = {"camera_matrix": MATRIX, "distortion_coefficients": EQUIDISTANT}
    assert load_calibration(opencv_file(tmp_path, **entries)).model == "plumb_bob"
    read = load_calibration(opencv_file(tmp_path, fisheye_model=1, **entries))
    assert (read.model, read.size) == ("equidistant", None)


@pytest.mark.parametrize(
    ("model", "numbers", "read_as"),
    [
        ("plumb_bob", 5, "plumb_bob"),
        ("rational_polynomial", 8, "rational_polynomial"),
        ("equidistant", 4, "equidistant"),
        ("fisheye", 4, "equidistant"),
        ("arctan", 1, "arctan"),
        ("''", 5, "plumb_bob"),
        ("''", 8, "rational_polynomial"),
    ],
)
def test_camera_info_of_ros(tmp_path: Path, model: str, numbers: int, read_as: str) -> None:
    text = ROS.replace("plumb_bob", model)
    text = text.replace("[-0.28, 0.07, 0.001, -0.002, 0.01]", str([0.01] * numbers))
    read = loaded(tmp_path, text)
    assert (read.model, read.size) == (read_as, (320, 240))
    assert read.matrix.tolist() == MATRIX.tolist()
    assert read.coefficients.tolist() == [0.01] * numbers


def test_message_of_ros(tmp_path: Path) -> None:
    text = "width: 320\nheight: 240\nK: [210, 0, 155, 0, 205, 124, 0, 0, 1]\nD: []\n"
    for printed in (text, text + "---\n", text.replace("K:", "k:").replace("D:", "d:")):
        read = loaded(tmp_path, printed)
        assert read.matrix.tolist() == MATRIX.tolist()
        assert read.coefficients.size == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("camera_matrix", "kamera_matrix", r"has no key 'camera_matrix'; did you mean 'kamera_ma"),
        ("distortion_coefficients", "dist", "has no key 'distortion_coefficients'"),
        ("[210.0, ", "[", r"camera\.yaml:7: camera_matrix\.data: expected 3 x 3 numbers, got 8"),
        ("[210.0", "[0.6", "expected focal lengths in pixels, got 0.6 and 205"),
        ("[210.0", "[.nan", "camera_matrix.data: nan is not a number"),
        ("[210.0", "[wide", "camera_matrix.data: 'wide' is not a number"),
        ("0.0, 0.0, 1.0]", "0.0, 0.0, 2.0]", "expected the rows fx 0 cx, 0 fy cy, 0 0 1"),
        ("155.0", "1550.0", "principal point 1550 is not near the middle of 320 px"),
        ("-0.28, 0.07, ", "", r"camera\.yaml:12: .*expected 4 or 5 coefficients for plumb_bob, go"),
        ("plumb_bob", "plumb", r"the model 'plumb' is not supported: did you mean 'plumb_bob'"),
        ("320", "32000000", r"camera\.yaml:1: image_width: expected pixels, 1 to 20000"),
        ("image_height: 240\n", "", "has no key 'image_height'"),
        (ROS, "<?xml version='1.0'?>", r"camera\.yaml:1: expected XML of OpenCV's FileStorage"),
        (ROS, "- 1\n", r"camera\.yaml: expected a calibration"),
        pytest.param("", "#" * 50_000_001, "the file is too large", id="too large"),
        (ROS, "a: !!python/object/apply:os.system ['true']\n", "the tag .* is not supported"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in ROS
    with pytest.raises(InputError, match=message):
        loaded(tmp_path, ROS.replace(old, new, 1))


def pattern(rays: Array) -> Array:
    """A smooth picture of the world by the direction of its rays (..., 2)."""
    x, y = rays[..., 0], rays[..., 1]
    return np.asarray(127.0 + 60.0 * np.sin(9.0 * x + 1.0) + 60.0 * np.cos(7.0 * y + 2.0 * x))


def photograph(calibration: CameraCalibration) -> Image:
    """What the calibrated camera sees of ``pattern``: (HEIGHT, WIDTH, 3)."""
    pixels = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1)
    opencv: Any = cv2.fisheye if calibration.model == "equidistant" else cv2
    rays = opencv.undistortPoints(pixels.reshape(-1, 1, 2) + 0.0, MATRIX, calibration.coefficients)
    rays = rays.reshape(HEIGHT, WIDTH, 2)
    return np.repeat(np.rint(pattern(rays))[..., None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize(
    "calibration",
    [
        lens(),
        lens(RATIONAL, "rational_polynomial"),
        lens(EQUIDISTANT, "equidistant"),
        lens(np.array([0.15, -0.03, 0.0, 0.0]), "plumb_bob"),
    ],
    ids=["barrel", "rational", "fisheye", "pincushion"],
)
def test_result_is_that_of_a_pinhole_camera(calibration: CameraCalibration) -> None:
    straighten = Undistortion(calibration, 320, 240)
    result = straighten.apply(photograph(calibration))
    focal = 160.0 / math.tan(0.5 * straighten.hfov)
    x, y = np.meshgrid(np.arange(320) - 159.5, np.arange(240) - 119.5)
    expected = pattern(np.stack([x, y], axis=-1) / focal)
    error = np.abs(result[..., 0].astype(float) - expected)
    assert error.max() < 4.0
    assert 0.7 < straighten.hfov < 1.7
    # no wider view is without a margin that the lens does not show
    assert not straighten._shown(0.99 * focal)


def test_lens_without_distortion_keeps_its_focal_length() -> None:
    straighten = Undistortion(lens(np.zeros(0), focal=200.0), 320, 240)
    assert straighten.hfov == pytest.approx(2.0 * math.atan(160.0 / 200.0), abs=1e-6)
    assert straighten.notes == [
        f"distortion removed by {straighten._lens.file}: images then show 77.3 degrees across"
    ]


def test_very_wide_lens_is_cut_to_what_a_pinhole_image_shows() -> None:
    straighten = Undistortion(lens(EQUIDISTANT, "equidistant", focal=100.0), 320, 240)
    assert math.degrees(straighten.hfov) <= 120.0 + 1e-6
    picture = straighten.apply(np.full((240, 320, 3), 200, np.uint8))
    assert picture.min() == 200


def test_images_of_another_size() -> None:
    whole = Undistortion(lens(), 320, 240)
    half = Undistortion(lens(), 160, 120)
    assert half.hfov == pytest.approx(whole.hfov, rel=5e-3)  # half a pixel of the border is lost
    assert "is for images of 320 x 240 px, not 160 x 120: scaled by 0.5" in half.notes[0]
    with pytest.raises(InputError, match=r"camera\.yaml: --calibration: is for images of 320 x 2"):
        Undistortion(lens(), 320, 180)
    with pytest.raises(InputError, match="not 240 x 320: turn the images"):
        Undistortion(lens(), 240, 320)


def test_file_without_a_size() -> None:
    straighten = Undistortion(lens(size=None), 320, 240)
    taken = "camera.yaml does not say its size of images: taken as 320 x 240"
    assert straighten.notes[0] == taken
    with pytest.raises(InputError, match="far from the centre of images of 1280 x 960 px"):
        Undistortion(lens(size=None), 1280, 960)


def test_coefficients_that_nothing_can_invert() -> None:
    with pytest.raises(InputError, match=r"cannot be removed|gives a field of view"):
        Undistortion(lens(np.array([-5000.0, 0.0, 0.0, 0.0])), 320, 240)
    # a polynomial that turns back within the image: only the part before is shown
    narrow = Undistortion(lens(np.array([-2.0, 0.0, 0.0, 0.0])), 320, 240)
    # r (1 - 2 r^2) turns back at 0.41, which is the corner of the image at most
    assert math.tan(0.5 * narrow.hfov) < 0.8 * 0.41


# --- lens and focal length estimated from tracked points ------------------------------------------

HALF = 0.5 * WIDTH
FISH = LensShape(150.0, 1.0)
BENT = LensShape(focal_for(HALF, math.radians(50.0), 0.5), 0.5)
PINHOLE = LensShape(260.0, 0.0)
FIGURES = ("focal_px", "focal_sigma_px", "hfov_deg", "curvature", "curvature_sigma")


def shown(shape: LensShape, points: Array) -> Array:
    """Where a lens shows ``points`` (n, 3) in its axes [px from the centre]."""
    return distort(points[:, :2] / points[:, 2:], shape.curvature) * shape.focal


def drive(shape: LensShape, turn: float, count: int = 16, seed: int = 0) -> list[PointMotion]:
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
        pairs.append(PointMotion(shown(shape, now), moved, np.ones(80), np.ones(80)))
    return pairs


def estimated(
    monkeypatch: pytest.MonkeyPatch, pairs: list[PointMotion], hfov: float | None = None
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
    grey = texture()[:HEIGHT, :WIDTH, None]
    image = np.asarray(np.repeat(grey, 3, axis=2), dtype=np.uint8)
    views = []
    for model, coefficients in ((FISHEYE, np.zeros(4)), (ARCTAN, np.ones(1))):
        straight = Undistortion(lens(coefficients, model, focal=150.0), WIDTH, HEIGHT)
        views.append((straight.hfov, straight.apply(image).astype(np.int16)))
    assert views[0][0] == pytest.approx(views[1][0], abs=1e-6)
    assert np.abs(views[0][1] - views[1][1]).max() <= 2
    assert focal_for(HALF, HALF / 150.0, 1.0) == pytest.approx(150.0)


def test_the_fit_finds_focal_length_and_curvature() -> None:
    fit = LensFit(drive(LensShape(200.0, 0.45), 0.08), HALF)
    fitted = fit.refined(fit.start())
    numbers = (fitted.focal, fitted.curvature, fit.bend(fitted))
    assert numbers == pytest.approx((198.510298, 0.451028591, 6.57172482), rel=1e-5)


def test_wrong_tracks_do_not_move_the_fit() -> None:
    shape, rng = LensShape(200.0, 0.45), np.random.default_rng(3)
    pairs = drive(shape, 0.08)
    for pair in pairs:  # an eighth of the tracks follows something else
        pair.past[::8] = pair.points[::8] + rng.normal([6.0, -4.0], 3.0, (10, 2))
    fit = LensFit(pairs, HALF)
    fitted = fit.refined(fit.start())
    assert fitted.focal == pytest.approx(shape.focal, rel=0.05)
    assert fitted.curvature == pytest.approx(shape.curvature, abs=0.08)


@pytest.mark.parametrize(
    ("drawn", "hfov", "figures", "line"),
    [
        ((FISH, 0.08), None, (149.47, 7.49, 122.7, 1.0, 0.052), "distortion arctan 1.0 +- 0.0"),
        ((PINHOLE, 0.08), None, (259.01, 13.03, 63.4, 0.0, 0.051), "no distortion"),
        ((BENT, 0.03), 100.0, (None, None, None, 0.506, 0.056), "distortion arctan 0.506 +- 0.0"),
        ((PINHOLE, 0.001), None, (None,) * 5, "nothing about the lens, by 16 pairs"),
    ],
    ids=["fisheye", "no distortion", "known view leaves the curvature", "no turns"],
)
def test_what_the_tracks_determine_is_told_and_used(
    monkeypatch: pytest.MonkeyPatch,
    drawn: tuple[LensShape, float],
    hfov: float | None,
    figures: tuple[float | None, ...],
    line: str,
) -> None:
    estimate = estimated(monkeypatch, drive(*drawn), hfov)
    assert estimate.as_data() == {"pairs": 16, **dict(zip(FIGURES, figures, strict=True))}
    assert estimate_line(estimate).startswith(f"estimated: {line}")
    assert (estimate.shape is None) == (figures[3] is None)
    assert estimate.calibration is None or estimate.calibration.model == ARCTAN
    assert hfov is None or estimate.hfov == pytest.approx(hfov)


def test_few_pairs_tell_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert estimated(monkeypatch, drive(FISH, 0.08, count=14)).shape is None
    assert estimated(monkeypatch, []).as_data()["pairs"] == 0
