from __future__ import annotations

import numpy as np
import pytest
from flow_scene import cell_truth, room, turn_about
from pydantic import ValidationError

from navfw.errors import ConfigError
from navfw.flow import BlockMatching, Dis, grid_points
from navfw.interfaces import FlowProcessor
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame, FramePair

ROBOT = RobotModel()
CAMERA = ROBOT.camera


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("angle", "way"), [(0.05, 0.0), (-0.05, 0.0), (0.0, 0.04), (0.0, -0.04)])
def test_motion_along_and_about_every_axis(axis: int, angle: float, way: float) -> None:
    motion = CameraMotion(turn_about(axis, angle), way * np.eye(3)[axis], 0.1)
    pair, truth = room(CAMERA).pair(motion, noise=2.0)
    flow = Dis(ROBOT).compute(pair)
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    trusted = flow.confidence > 0.5
    assert trusted.mean() > 0.7
    assert np.median(error[trusted]) < 0.06
    assert np.percentile(error[trusted], 95) < 0.4


def test_sigma_tells_the_size_of_the_error() -> None:
    motion = CameraMotion(turn_about(1, 0.03), np.array([0.003, 0.0, 0.06]), 0.2)
    pair, truth = room(CAMERA).pair(motion, noise=3.0)
    flow = Dis(ROBOT).compute(pair)
    error = flow.vectors - cell_truth(truth, flow.points, CAMERA)
    trusted = flow.confidence > 0.5
    ratio = np.abs(error[trusted]) / flow.sigma[trusted][:, None]
    assert (ratio < 2.0).mean() > 0.9
    assert (ratio < 0.05).mean() < 0.5


@pytest.mark.parametrize("preset", ["ultrafast", "fast", "medium"])
@pytest.mark.parametrize("grey", [0, 200, 255])
def test_images_without_texture_say_nothing(preset: str, grey: int) -> None:
    image = np.full((120, 160), grey, np.uint8)
    still = CameraMotion(np.eye(3), np.zeros(3), 0.1)
    processor = Dis(ROBOT, Dis.Params.model_validate({"preset": preset}))
    flow = processor.compute(FramePair(Frame(0.0, image), Frame(0.1, image), still))
    assert not flow.confidence.any()
    assert np.isfinite(flow.vectors).all()
    assert np.isfinite(flow.sigma).all()


def test_images_that_have_nothing_in_common_are_not_trusted() -> None:
    motion = CameraMotion(np.eye(3), np.zeros(3), 0.1)
    one, _ = room(CAMERA, seed=1).pair(motion)
    other, _ = room(CAMERA, seed=9).pair(motion)
    flow = Dis(ROBOT).compute(FramePair(one.past, other.now, motion))
    assert (flow.confidence > 0.5).mean() < 0.05


def test_what_the_past_camera_did_not_see_is_not_trusted() -> None:
    # turned left: the left of the current image is new
    motion = CameraMotion(turn_about(1, 0.1), np.zeros(3), 0.1)
    pair, _ = room(CAMERA).pair(motion)
    confidence = Dis(ROBOT).compute(pair).confidence
    assert not confidence[:, 0].any()
    assert (confidence[1:-1, 2:] > 0.5).mean() > 0.9


def test_points_are_the_grid() -> None:
    image = np.zeros((120, 160), np.uint8)
    still = CameraMotion(np.eye(3), np.zeros(3), 0.1)
    flow = Dis(ROBOT).compute(FramePair(Frame(0.0, image), Frame(0.1, image), still))
    np.testing.assert_array_equal(flow.points, grid_points(CAMERA, 12, 16))


def test_a_grid_that_does_not_divide_the_image_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"dis\.cols.*possible nearby: 8, 10, 16, 20"):
        Dis(ROBOT, Dis.Params(cols=15))


@pytest.mark.parametrize("processor", [Dis, BlockMatching])
def test_thresholds_in_the_wrong_order_are_refused(processor: type[FlowProcessor]) -> None:
    low = next(key for key in processor.Params.model_fields if key.endswith("_low"))
    with pytest.raises(ValidationError, match=f"{low} 0.99 is not below"):
        processor.Params.model_validate({low: 0.99, low.replace("low", "high"): 0.95})
