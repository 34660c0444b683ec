"""Dense flow of the lower image after alignment of the floor."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from flow_scene import board_image

from navfw.camera_geometry import derotate
from navfw.egomotion import camera_motion
from navfw.errors import ConfigError
from navfw.flow import FloorAlignedFlow
from navfw.flow.cell_kernels import match_cells
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame, FramePair, Pose

ROBOT = RobotModel()
CAMERA = ROBOT.camera
START = Pose(0.0, 0.0, 0.0)


def pair(now: Pose, camera: CameraModel = CAMERA) -> FramePair:
    robot = ROBOT.model_copy(update={"camera": camera})
    motion = camera_motion(robot, START, now, 0.2)
    before, after = (Frame(t, board_image(camera, pose)) for t, pose in ((0.0, START), (0.2, now)))
    return FramePair(before, after, motion)


def floor_flow(points: Array, motion: CameraMotion, camera: CameraModel) -> Array:
    """Derotated flow of the floor at ``points``, by METHOD 2.5 and 2.8."""
    down = -camera.base_from_camera[2]
    rays = np.concatenate([points / camera.focal, np.ones((*points.shape[:2], 1))], axis=-1)
    nearness = (rays @ down) / camera.mount_height
    s = motion.translation
    lever = points * s[2] - camera.focal * s[:2]
    return np.asarray(lever * (nearness / (1.0 + s[2] * nearness))[..., None])


@pytest.mark.parametrize(
    ("now", "pitch"),
    [
        (Pose(0.08, 0.0, 0.0), 0.0),
        (Pose(0.1, 0.01, 0.15), 0.0),
        (Pose(0.0, 0.0, -0.2), 0.0),
        (Pose(0.06, 0.0, 0.05), 0.2),
        (Pose(-0.03, 0.0, 0.0), -0.1),
    ],
)
@pytest.mark.parametrize("coarse", [False, True])
def test_flow_of_the_floor_is_what_geometry_says(now: Pose, pitch: float, coarse: bool) -> None:
    camera = CAMERA.model_copy(update={"pitch": pitch})
    robot = ROBOT.model_copy(update={"camera": camera})
    given = pair(now, camera)
    flow = derotate(FloorAlignedFlow(robot).compute(given, coarse), camera)
    expected = floor_flow(flow.points, given.motion, camera)
    down = flow.points[..., 1] > 14.0 - camera.focal * math.tan(pitch)
    good = (flow.confidence > 0.0) & down
    assert good.sum() > 0.5 * down.sum()
    error = np.hypot(*np.moveaxis(flow.vectors - expected, -1, 0))[good]
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 0.4


def test_noise_and_darkness_are_not_taken_for_flow() -> None:
    given = pair(Pose(0.08, 0.0, 0.0))
    dark = Frame(0.2, np.full_like(given.now.image, 7))
    unlit = FloorAlignedFlow(ROBOT).compute(FramePair(given.past, dark, given.motion))
    assert not unlit.confidence.any()
    noise = np.random.default_rng(1).integers(0, 255, given.now.image.shape, dtype=np.uint8)
    flow = FloorAlignedFlow(ROBOT).compute(FramePair(given.past, Frame(0.2, noise), given.motion))
    assert flow.confidence.mean() < 0.1


def test_a_camera_that_looks_up_sees_no_floor() -> None:
    up = ROBOT.model_copy(update={"camera": CAMERA.model_copy(update={"pitch": -0.62})})
    assert not FloorAlignedFlow(up).floor_visible
    assert FloorAlignedFlow(ROBOT).floor_visible


def test_a_frame_of_another_camera_is_refused() -> None:
    given = pair(Pose(0.08, 0.0, 0.0))
    small = Frame(0.2, given.now.image[:60])
    with pytest.raises(ConfigError, match="160 x 60"):
        FloorAlignedFlow(ROBOT).compute(FramePair(given.past, small, given.motion))


def test_cells_agree_as_pixel_by_pixel_operators_say() -> None:
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 256, (48, 64), dtype=np.uint8)
    now = np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.0), dtype=np.uint8)
    now[:, 40:] = now[:, 40:] // 8 + 100
    now[8:16] += rng.integers(0, 40, (8, 64), dtype=np.uint8)
    moved = np.clip(now.astype(int) + rng.integers(-14, 15, now.shape), 0, 255).astype(np.uint8)
    across, down = (
        cv2.Sobel(now, cv2.CV_32F, *order, scale=0.125).astype(float) for order in ((1, 0), (0, 1))
    )
    cells = (12, 4, 16, 4)
    off = cv2.absdiff(now, moved).reshape(cells).mean(axis=(1, 3))
    gradient = (across**2 + down**2).reshape(cells).mean(axis=(1, 3))
    good = np.empty((12, 16), dtype=np.bool_)
    match_cells(now, moved, 4, 7.0, 1.5, good)
    np.testing.assert_array_equal(good, (off < 7.0) & (gradient > 1.5**2))
    assert 0.2 < good.mean() < 0.8
