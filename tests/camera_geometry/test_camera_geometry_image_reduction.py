"""Images of wide cameras, reduced to the size that flow and perception are made for."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.camera_geometry import reduce_frame
from navfw.robot import CameraModel, RobotModel, SideViews
from navfw.signals import Frame

RNG = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("width", "height", "factor"),
    [
        *((160, 120, 1), (96, 72, 1), (200, 150, 1), (320, 240, 2), (640, 480, 4)),
        *((480, 360, 3), (1280, 720, 5), (1920, 1080, 10), (752, 480, 1), (641, 480, 1)),
    ],
)
def test_the_factor_is_the_largest_that_keeps_160_columns(
    width: int, height: int, factor: int
) -> None:
    assert CameraModel(width=width, height=height).reduction == factor


def test_a_pixel_is_the_mean_of_those_in_its_place() -> None:
    image = RNG.integers(0, 256, (240, 320)).astype(np.uint8)
    frame = Frame(1.5, image, (image[:, :80], image[:, 80:160]))
    assert reduce_frame(frame, 1) is frame
    reduced = reduce_frame(frame, 2)
    mean = image.reshape(120, 2, 160, 2).mean(axis=(1, 3))
    assert np.abs(reduced.image - mean).max() <= 0.5
    assert [side.shape for side in reduced.sides] == [(120, 40), (120, 40)]
    assert reduced.time == frame.time


def test_the_reduced_camera_sees_the_same_rays() -> None:
    camera = CameraModel(width=640, height=480, hfov=1.1, pitch=0.1)
    robot = RobotModel(camera=camera, side_views=SideViews(width=160))
    reduced = robot.with_reduced_images()
    assert (reduced.camera.width, reduced.camera.height) == (160, 120)
    assert 4.0 * reduced.camera.focal == pytest.approx(camera.focal)
    assert reduced.side_views is not None
    assert reduced.side_views.width == 40
    assert reduced.camera.pitch == camera.pitch
    assert RobotModel().with_reduced_images() == RobotModel()
