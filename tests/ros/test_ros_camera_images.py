"""Images of real lenses as the robot's pinhole camera takes them, by ``camera_info``."""

from typing import Any

import numpy as np
import pytest
from perceive_images import texture

from navfw.lenses import CameraCalibration, Undistortion
from navfw.numerics import Image
from navfw.recording import deserialize_cdr, ros_message
from navfw.recording.ros_messages import camera_message
from navfw.robot import CameraModel
from navfw.robot.camera_models import LensCalibration
from navfw.ros.camera_images import CameraImages

INFO = "sensor_msgs/msg/CameraInfo"
CAMERA = CameraModel(width=320, height=240, hfov=1.1)
MATRIX = np.array([[240.0, 0.0, 163.0], [0.0, 238.0, 116.0], [0.0, 0.0, 1.0]])
LENSES = {
    "plumb_bob": (-0.25, 0.05, 0.001, -0.001, 0.0),
    "rational_polynomial": (-0.2, 0.03, 0.001, -0.001, 0.0, 0.05, 0.01, 0.0),
    "equidistant": (-0.02, 0.004, 0.0, 0.0),
}


def info(model: str = "plumb_bob", d: Any = (), **fields: Any) -> Any:
    about = {"width": 320, "height": 240, "distortion_model": model, "d": np.array(d)}
    p = np.column_stack([np.diag([262.0, 262.0, 1.0]), np.zeros(3)])
    p[:2, 2] = 159.5, 119.5
    matrices = {"k": MATRIX.ravel(), "r": np.eye(3).ravel(), "p": p.ravel()}
    return deserialize_cdr(ros_message(INFO, {**about, **matrices, **fields}), INFO)


def of_lens(scene: Image, model: str, d: Any) -> Image:
    """The image that the lens shows of what a pinhole camera shows as ``scene``."""
    lens = CameraCalibration("lens", MATRIX, np.array(d), model, (320, 240))
    return Undistortion(lens, 320, 240, key=None, hfov=CAMERA.hfov).distort(scene)


def off(image: Image, scene: Image) -> float:
    """Mean difference in the middle, off the borders that the lens does not show."""
    inside = np.s_[20:-20, 25:-25]
    return float(np.abs(image.astype(float) - scene)[inside].mean())


@pytest.mark.parametrize("model", LENSES)
def test_the_distortion_of_camera_info_is_removed_and_said(model: str) -> None:
    scene = texture()[:240, :320]
    bent, notes = of_lens(scene, model, LENSES[model]), list[str]()
    images = CameraImages(CAMERA, "/camera/image_raw", notes.append)
    assert images.taken(bent) is bent
    images.describe("/camera/camera_info", info(model, LENSES[model]))
    assert off(images.taken(bent), scene) < 0.2 * off(bent, scene)
    assert notes == [
        "distortion removed by /camera/camera_info: images then show 63.0 degrees across"
    ]
    images.describe("/camera/camera_info", info(model, LENSES[model]))
    images.taken(bent)
    assert len(notes) == 1


def test_rectified_images_have_the_projection_matrix_alone() -> None:
    scene, notes = texture()[:240, :320], list[str]()
    images = CameraImages(CAMERA, "/camera/image_rect", notes.append)
    images.describe("/camera/camera_info", info("plumb_bob", LENSES["plumb_bob"]))
    assert images.taken(scene) is scene  # P is the robot file's camera
    assert not notes


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"width": 640, "height": 360}, "is for images of 640 x 360 px, not 320 x 240"),
        ({"k": np.zeros(9)}, "expected focal lengths in pixels, got 0 and 0"),
        ({"k": np.full(9, np.nan)}, "not a number"),
        ({"distortion_model": "omni"}, "'omni' is not supported"),
        ({"binning_x": 2, "binning_y": 2}, "images have 160 x 120 px, not 320 x 240"),
        (
            {"k": (MATRIX + np.diag([120, 120, 0])).ravel()},
            "the lens shows 48.1 degrees across, camera.hfov is 63.0: set it to 0.840",
        ),
    ],
)
def test_what_contradicts_its_images_is_not_used(fields: Any, said: str) -> None:
    notes, scene = list[str](), texture()[:240, :320]
    images = CameraImages(CAMERA, "/image", notes.append)
    images.describe("/camera_info", info("plumb_bob", LENSES["plumb_bob"], **fields))
    assert images.taken(scene) is scene
    assert notes[0].startswith("/camera_info is not used, the robot file's camera is: ")
    assert said in notes[0]


def test_the_simulated_camera_describes_its_lens_and_a_calibration_of_the_file_counts() -> None:
    lens = LensCalibration(
        file="lens.yaml",
        model="plumb_bob",
        matrix=tuple((MATRIX * [[2.0], [2.0], [1.0]]).ravel().tolist()),
        coefficients=LENSES["plumb_bob"],
        size=(640, 480),
    )
    camera = CameraModel(width=320, height=240, calibration=lens)
    sent = deserialize_cdr(camera_message(camera, (240, 320), 0), INFO)
    assert sent.k.reshape(3, 3)[:2] == pytest.approx(MATRIX[:2] - [[0.0, 0.0, 0.25]] * 2)
    assert sent.d.tolist() == list(LENSES["plumb_bob"])
    scene, notes = texture()[:240, :320], list[str]()
    images = CameraImages(camera, "/image", notes.append)
    images.describe("/camera_info", sent)
    assert images.taken(scene) is scene
    assert notes == ["the robot file's calibration is used, not /camera_info"]
