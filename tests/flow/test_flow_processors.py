"""What every honest flow processor must do, on synthetic motion with known truth."""

from __future__ import annotations

import numpy as np
import pytest
from flow_scene import cell_truth, room, turn_about, wall

from navfw.flow import SIGMA_UNKNOWN, BlockMatching, Dis, Farneback, LucasKanade, Registered
from navfw.interfaces import FlowProcessor
from navfw.numerics import Image
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame, FramePair

ROBOT = RobotModel()
CAMERA = ROBOT.camera
STILL = CameraMotion(np.eye(3), np.zeros(3), 0.1)
AHEAD = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.06]), 0.2)
PROCESSORS = [
    BlockMatching(ROBOT),
    BlockMatching(ROBOT, BlockMatching.Params(subpixel="peak")),
    BlockMatching(ROBOT, BlockMatching.Params(stride=2, weight_width=5.0)),
    LucasKanade(ROBOT),
    LucasKanade(ROBOT, LucasKanade.Params(points=2)),
    Dis(ROBOT),
    Registered(ROBOT),
    Farneback(ROBOT),
]
every_processor = pytest.mark.parametrize("processor", PROCESSORS, ids=lambda p: p.name)


def pair_of(past: Image, now: Image, motion: CameraMotion = STILL) -> FramePair:
    return FramePair(Frame(0.0, past), Frame(0.2, now), motion)


def test_all_that_ship_are_here() -> None:
    assert {p.name for p in PROCESSORS} | {"ideal"} == set(default_registry().names("flow"))


@every_processor
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("angle", [0.06, -0.06])
def test_rotation_about_every_axis(processor: FlowProcessor, axis: int, angle: float) -> None:
    pair, truth = room(CAMERA).pair(CameraMotion(turn_about(axis, angle), np.zeros(3), 0.1), 2.0)
    flow = processor.compute(pair)
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    trusted = flow.confidence > 0.5
    assert trusted.mean() > 0.65
    assert np.median(error[trusted]) < 0.08
    assert np.percentile(error[trusted], 95) < 0.4


@every_processor
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("way", [0.05, -0.05])
def test_translation_along_every_axis(processor: FlowProcessor, axis: int, way: float) -> None:
    pair, truth = wall(CAMERA).pair(CameraMotion(np.eye(3), way * np.eye(3)[axis], 0.1), 2.0)
    flow = processor.compute(pair)
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    trusted = flow.confidence > 0.5
    assert trusted.mean() > 0.7
    assert np.median(error[trusted]) < 0.1
    assert np.percentile(error[trusted], 95) < 0.3


@every_processor
def test_sigma_tells_the_size_of_the_error(processor: FlowProcessor) -> None:
    motion = CameraMotion(turn_about(1, 0.03), np.array([0.003, 0.0, 0.06]), 0.2)
    pair, truth = room(CAMERA).pair(motion, noise=3.0)
    flow = processor.compute(pair)
    error = np.abs(flow.vectors - cell_truth(truth, flow.points, CAMERA))
    trusted = flow.confidence > 0.5
    ratio = error[trusted] / flow.sigma[trusted][:, None]
    assert (ratio < 2.0).mean() > 0.85
    assert (ratio < 0.05).mean() < 0.5  # sigma must not be far too large either
    # larger sigma means larger errors
    sigma, off = flow.sigma[trusted], error[trusted].max(axis=-1)
    middle = np.median(sigma)
    assert off[sigma > middle].mean() > off[sigma < middle].mean()


def half_saturated() -> Image:
    image = np.full((120, 160), 255, np.uint8)
    image[:, :80] = 0
    return image


@every_processor
@pytest.mark.parametrize("grey", [0, 1, 128, 254, 255])
def test_images_of_one_grey_say_nothing(processor: FlowProcessor, grey: int) -> None:
    rng = np.random.default_rng(grey)
    flat = np.full((120, 160), grey, np.uint8)
    for past, now in (
        (flat, flat),
        # a little noise is no texture either
        [flat + np.minimum(rng.integers(0, 3, flat.shape, np.uint8), 255 - flat) for _ in range(2)],
    ):
        flow = processor.compute(pair_of(past, now, AHEAD))
        assert not flow.confidence.any()
        assert (flow.sigma == SIGMA_UNKNOWN).all()
        assert np.isfinite(flow.vectors).all()


@every_processor
def test_an_edge_between_black_and_saturated_is_no_point(processor: FlowProcessor) -> None:
    """Along the edge anything may move: no cell may be sure of both components."""
    now = half_saturated()
    flow = processor.compute(pair_of(np.roll(now, 1, axis=1), now))
    assert flow.confidence.max() < 0.3


@every_processor
def test_a_frozen_camera_says_nothing(processor: FlowProcessor) -> None:
    pair, _ = room(CAMERA).pair(AHEAD)
    frozen = processor.compute(pair_of(pair.now.image, pair.now.image, AHEAD))
    assert not frozen.confidence.any()
    turned = CameraMotion(turn_about(1, 0.05), np.zeros(3), 0.1)
    assert not processor.compute(pair_of(pair.now.image, pair.now.image, turned)).confidence.any()
    # but a robot that stands still may see the same twice
    still = processor.compute(pair_of(pair.now.image, pair.now.image))
    assert (still.confidence > 0.5).mean() > 0.8
    assert np.percentile(np.abs(still.vectors[still.confidence > 0.5]), 95) < 0.1


@every_processor
def test_images_that_have_nothing_in_common_are_not_trusted(processor: FlowProcessor) -> None:
    one, _ = room(CAMERA, seed=1).pair(AHEAD)
    other, _ = room(CAMERA, seed=9).pair(AHEAD)
    confidence = processor.compute(FramePair(one.past, other.now, AHEAD)).confidence
    assert (confidence > 0.5).mean() < 0.05


@every_processor
def test_a_brighter_image_is_still_the_same_scene(processor: FlowProcessor) -> None:
    pair, truth = room(CAMERA).pair(AHEAD)
    brighter = np.clip(0.85 * pair.now.image.astype(np.float64) + 10, 0, 255).astype(np.uint8)
    flow = processor.compute(pair_of(pair.past.image, brighter, AHEAD))
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    trusted = flow.confidence > 0.5
    assert trusted.mean() > 0.3
    assert np.median(error[trusted]) < 0.5


@every_processor
def test_the_same_frames_give_the_same_field(processor: FlowProcessor) -> None:
    pair, _ = room(CAMERA).pair(AHEAD, noise=2.0)
    first, second = processor.compute(pair), processor.compute(pair)
    for key in ("points", "vectors", "confidence", "sigma"):
        np.testing.assert_array_equal(getattr(first, key), getattr(second, key))
    assert first.time == pair.now.time
    assert first.motion is pair.motion
    assert not first.derotated
