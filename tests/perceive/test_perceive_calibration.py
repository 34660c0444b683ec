"""Calibration files of OpenCV and ROS, and images without lens distortion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from navfw.camera_geometry import CameraCalibration
from navfw.errors import InputError
from navfw.numerics import Array, Image
from navfw.perceive import Undistortion, load_calibration

MATRIX = np.array([[210.0, 0.0, 155.0], [0.0, 205.0, 124.0], [0.0, 0.0, 1.0]])
PLUMB_BOB = np.array([-0.28, 0.07, 0.001, -0.002, 0.01])
RATIONAL = np.array([-0.2, 0.05, 0.001, 0.001, 0.01, 0.05, 0.01, 0.002])
FISHEYE = np.array([0.02, -0.01, 0.003, -0.001])
NO_LENS = np.zeros(0)

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


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    return path


def lens(
    coefficients: Array = PLUMB_BOB,
    model: str = "plumb_bob",
    size: tuple[int, int] | None = (320, 240),
) -> CameraCalibration:
    return CameraCalibration("camera.yaml", MATRIX, coefficients, model, size)


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
    entries = {"camera_matrix": MATRIX, "distortion_coefficients": FISHEYE}
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
        ("''", 5, "plumb_bob"),
        ("''", 8, "rational_polynomial"),
    ],
)
def test_camera_info_of_ros(tmp_path: Path, model: str, numbers: int, read_as: str) -> None:
    text = ROS.replace("plumb_bob", model)
    text = text.replace("[-0.28, 0.07, 0.001, -0.002, 0.01]", str([0.01] * numbers))
    read = load_calibration(written(tmp_path, text))
    assert (read.model, read.size) == (read_as, (320, 240))
    assert read.matrix.tolist() == MATRIX.tolist()
    assert read.coefficients.tolist() == [0.01] * numbers


def test_message_of_ros(tmp_path: Path) -> None:
    text = "width: 320\nheight: 240\nK: [210, 0, 155, 0, 205, 124, 0, 0, 1]\nD: []\n"
    for printed in (text, text + "---\n", text.replace("K:", "k:").replace("D:", "d:")):
        read = load_calibration(written(tmp_path, printed))
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
        ("155.0", "1550.0", r"the principal point \(1550, 124\) lies outside of images of 320 x"),
        ("-0.28, 0.07, ", "", r"camera\.yaml:12: .*expected 4 or 5 coefficients for plumb_bob, go"),
        ("plumb_bob", "plumb", r"unknown distortion model 'plumb': did you mean 'plumb_bob'"),
        ("320", "32000000", r"camera\.yaml:1: image_width: expected pixels, 1 to 20000"),
        ("image_height: 240\n", "", "image_width: has no counterpart 'image_height'"),
        (ROS, "<?xml version='1.0'?>", r"camera\.yaml: is XML; save the calibration as .yaml"),
        (ROS, "- 1\n", r"camera\.yaml: expected a calibration"),
        (ROS, "a: !!python/object/apply:os.system ['true']\n", "the tag .* is not supported"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in ROS
    with pytest.raises(InputError, match=message):
        load_calibration(written(tmp_path, ROS.replace(old, new, 1)))


def test_file_that_is_too_large(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the file is too large"):
        load_calibration(written(tmp_path, ROS + "#" * 1_000_000))


def pattern(rays: Array) -> Array:
    """A smooth picture of the world by the direction of its rays (..., 2)."""
    x, y = rays[..., 0], rays[..., 1]
    return np.asarray(127.0 + 60.0 * np.sin(9.0 * x + 1.0) + 60.0 * np.cos(7.0 * y + 2.0 * x))


def photograph(calibration: CameraCalibration, width: int, height: int) -> Image:
    """What the calibrated camera sees of ``pattern``: (height, width, 3)."""
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    undistort: Any = cv2.undistortPoints
    if calibration.model == "equidistant":
        undistort = cv2.fisheye.undistortPoints
    rays = undistort(
        pixels.reshape(-1, 1, 2).astype(np.float64), MATRIX, calibration.coefficients
    ).reshape(height, width, 2)
    return np.repeat(np.rint(pattern(rays))[..., None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize(
    "calibration",
    [
        lens(),
        lens(RATIONAL, "rational_polynomial"),
        lens(FISHEYE, "equidistant"),
        lens(np.array([0.15, -0.03, 0.0, 0.0]), "plumb_bob"),
    ],
    ids=["barrel", "rational", "fisheye", "pincushion"],
)
def test_result_is_that_of_a_pinhole_camera(calibration: CameraCalibration) -> None:
    straighten = Undistortion(calibration, 320, 240)
    result = straighten.apply(photograph(calibration, 320, 240))
    focal = 160.0 / math.tan(0.5 * straighten.hfov)
    x, y = np.meshgrid(np.arange(320) - 159.5, np.arange(240) - 119.5)
    expected = pattern(np.stack([x, y], axis=-1) / focal)
    error = np.abs(result[..., 0].astype(float) - expected)
    assert error.max() < 4.0
    assert 0.7 < straighten.hfov < 1.7
    # no wider view is without a margin that the lens does not show
    wider = Undistortion.__new__(Undistortion)
    wider.__dict__.update(straighten.__dict__)
    assert not wider._shown(0.99 * focal)


def test_lens_without_distortion_keeps_its_focal_length() -> None:
    matrix = np.array([[200.0, 0.0, 159.5], [0.0, 200.0, 119.5], [0.0, 0.0, 1.0]])
    calibration = CameraCalibration("camera.yaml", matrix, NO_LENS, "plumb_bob", (320, 240))
    straighten = Undistortion(calibration, 320, 240)
    assert straighten.hfov == pytest.approx(2.0 * math.atan(160.0 / 200.0), abs=1e-6)
    assert straighten.notes == ["calibration applied: images then show 77.3 degrees across"]


def test_very_wide_lens_is_cut_to_what_a_pinhole_image_shows() -> None:
    matrix = np.array([[100.0, 0.0, 159.5], [0.0, 100.0, 119.5], [0.0, 0.0, 1.0]])
    calibration = CameraCalibration("camera.yaml", matrix, FISHEYE, "equidistant", (320, 240))
    straighten = Undistortion(calibration, 320, 240)
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
    assert straighten.notes[0] == (
        "camera.yaml does not say its size of images: taken as 320 x 240"
    )
    with pytest.raises(InputError, match="far from the centre of images of 1280 x 960 px"):
        Undistortion(lens(size=None), 1280, 960)


def test_coefficients_that_nothing_can_invert() -> None:
    with pytest.raises(InputError, match=r"cannot be removed|gives a field of view"):
        Undistortion(lens(np.array([-5000.0, 0.0, 0.0, 0.0])), 320, 240)
    # a polynomial that turns back within the image: only the part before is shown
    narrow = Undistortion(lens(np.array([-2.0, 0.0, 0.0, 0.0])), 320, 240)
    # r (1 - 2 r^2) turns back at 0.41, which is the corner of the image at most
    assert math.tan(0.5 * narrow.hfov) < 0.8 * 0.41
