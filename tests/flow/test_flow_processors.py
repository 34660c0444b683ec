"""What every honest flow processor must do, on motion with known truth."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from flow_scene import STILL, Scene, cell_truth, pair_of, room, true_flow, turn_about, wall
from hypothesis import given
from hypothesis import strategies as st
from navfw_benchmarks.plugins.opencv_flow import Farneback, LucasKanade

from navfw.camera_geometry.rotations import rotate_points
from navfw.config import find
from navfw.egomotion.pairing import camera_motion
from navfw.errors import ConfigError
from navfw.flow import grid_points
from navfw.flow.block_matching import BlockMatching
from navfw.flow.grid_flow import SIGMA_UNKNOWN, align_past, visible_in_past
from navfw.flow.opencv_flow import Dis
from navfw.flow.registration import Registered
from navfw.interfaces import FlowProcessor
from navfw.numerics import Array
from navfw.plugins import default_registry
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, Frame, FramePair, Pose
from navfw.sim import Simulation, load_world

ROBOT = RobotModel()
CAMERA = ROBOT.camera
AHEAD = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.06]), 0.2)
BLOCK_MATCHING, DIS = BlockMatching(ROBOT), Dis(ROBOT)
PROCESSORS = [
    BLOCK_MATCHING,
    BlockMatching(ROBOT, BlockMatching.Params(subpixel="peak")),
    LucasKanade(ROBOT),
    DIS,
    Registered(ROBOT),
    Farneback(ROBOT),
]
every_processor = pytest.mark.parametrize("processor", PROCESSORS, ids=lambda p: p.name)


def test_all_that_ship_are_here() -> None:
    assert {p.name for p in PROCESSORS} | {"ideal"} == set(default_registry().names("flow"))


@pytest.mark.parametrize(
    ("processor", "scene", "angle", "way", "limits"),
    [
        *((processor, room, 0.06, 0.0, (0.65, 0.08, 0.4)) for processor in PROCESSORS),
        *((processor, wall, 0.0, 0.05, (0.7, 0.1, 0.3)) for processor in PROCESSORS),
        (BLOCK_MATCHING, room, 0.05, 0.0, (0.8, 0.05, 0.15)),
        (BLOCK_MATCHING, wall, 0.0, 0.04, (0.8, 0.06, 0.12)),
        (DIS, room, 0.05, 0.0, (0.7, 0.06, 0.4)),
        (DIS, room, 0.0, 0.04, (0.7, 0.06, 0.4)),
    ],
)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotation_about_and_translation_along_every_axis(
    processor: FlowProcessor,
    scene: Callable[[CameraModel], Scene],
    angle: float,
    way: float,
    limits: tuple[float, float, float],
    axis: int,
    sign: float,
) -> None:
    """``limits``: least share that is trusted, largest median and 95th percentile of errors."""
    rotation, translation = turn_about(axis, sign * angle), sign * way * np.eye(3)[axis]
    pair, truth = scene(CAMERA).pair(CameraMotion(rotation, translation, 0.1), 2.0)
    flow = processor.compute(pair)
    error = np.linalg.norm(flow.vectors - cell_truth(truth, flow.points, CAMERA), axis=-1)
    trusted = flow.confidence > 0.5
    assert trusted.mean() > limits[0]
    assert np.median(error[trusted]) < limits[1]
    assert np.percentile(error[trusted], 95) < limits[2]


@every_processor
def test_sigma_tells_the_size_of_the_error(processor: FlowProcessor) -> None:
    strict = processor in (BLOCK_MATCHING, DIS)
    motion = CameraMotion(turn_about(1, 0.03), np.array([0.003, 0.0, 0.06]), 0.2)
    pair, truth = room(CAMERA).pair(motion, noise=3.0)
    flow = processor.compute(pair)
    error = np.abs(flow.vectors - cell_truth(truth, flow.points, CAMERA))
    trusted = flow.confidence > 0.5
    ratio = error[trusted] / flow.sigma[trusted][:, None]
    assert (ratio < 2.0).mean() > (0.9 if strict else 0.85)
    # sigma must not be far too large either
    assert (ratio < (0.1 if processor is BLOCK_MATCHING else 0.05)).mean() < 0.5
    # larger sigma means larger errors
    sigma, off = flow.sigma[trusted], error[trusted].max(axis=-1)
    middle = np.median(sigma)
    assert off[sigma > middle].mean() > off[sigma < middle].mean()


@pytest.mark.parametrize(
    "processor",
    [*PROCESSORS, *(Dis(ROBOT, Dis.Params(preset=preset)) for preset in ("fast", "medium"))],
    ids=lambda p: p.name,
)
@pytest.mark.parametrize("grey", [0, 1, 128, 200, 254, 255])
def test_images_of_one_grey_say_nothing(processor: FlowProcessor, grey: int) -> None:
    rng = np.random.default_rng(grey)
    flat = np.full((120, 160), grey, np.uint8)
    # a little noise is no texture either
    noisy = [
        flat + np.minimum(rng.integers(0, 3, flat.shape, np.uint8), 255 - flat) for _ in range(2)
    ]
    # a standing camera does not count as a frozen one
    for past, now, motion in ((flat, flat, STILL), (flat, flat, AHEAD), (*noisy, AHEAD)):
        flow = processor.compute(pair_of(past, now, motion))
        assert not flow.confidence.any()
        assert (flow.sigma == SIGMA_UNKNOWN).all()
        assert np.isfinite(flow.vectors).all()


@every_processor
def test_an_edge_between_black_and_saturated_is_no_point(processor: FlowProcessor) -> None:
    """Along the edge anything may move: no cell may be sure of both components."""
    now = np.full((120, 160), 255, np.uint8)
    now[:, :80] = 0
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


def test_what_the_past_camera_did_not_see_is_not_trusted() -> None:
    # turned left: the left of the current image is new
    pair, _ = room(CAMERA).pair(CameraMotion(turn_about(1, 0.1), np.zeros(3), 0.1))
    flow = DIS.compute(pair)
    assert not flow.confidence[:, 0].any()
    assert (flow.confidence[1:-1, 2:] > 0.5).mean() > 0.9
    np.testing.assert_array_equal(flow.points, grid_points(CAMERA, 12, 16))


@pytest.mark.parametrize(
    ("processor", "params", "message"),
    [
        (BlockMatching, {"rows": 13}, r"block_matching\.rows.*cannot divide the image"),
        (BlockMatching, {"cols": 15}, r"block_matching\.cols.*cannot divide the image"),
        (Dis, {"cols": 15}, r"dis\.cols.*possible nearby: 8, 10, 16, 20"),
    ],
)
def test_a_grid_that_does_not_divide_the_image_is_refused(
    processor: type[FlowProcessor], params: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        processor(ROBOT, processor.Params.model_validate(params))


def test_aligned_past_repeats_the_past_when_nothing_turned() -> None:
    image = np.random.default_rng(0).integers(0, 256, (120, 160)).astype(np.uint8)
    assert align_past(image, np.eye(3), CAMERA) is image
    assert visible_in_past(np.eye(3), CAMERA) == (0, 160, 0, 120)


@given(axis=st.integers(0, 1), angle=st.floats(-0.1, 0.1))
def test_visible_limits_are_those_of_the_past_image(axis: int, angle: float) -> None:
    rotation = turn_about(axis, angle)
    seen = np.full((120, 160), 200, np.uint8)
    left, right, top, bottom = visible_in_past(rotation, CAMERA)
    x = np.array([left, right]) - 80.0
    y = np.array([top, bottom]) - 60.0
    middle = np.array([[x[0], 0.0], [x[1], 0.0], [0.0, y[0]], [0.0, y[1]]])
    past = rotate_points(middle, rotation.T, CAMERA.focal)
    assert (np.abs(past) <= np.array([80.0, 60.0]) + 0.5).all()
    # and not a pixel less: one further out lies outside the past image or the current one
    wider = middle + np.sign(middle) * 1.5
    outside = rotate_points(wider, rotation.T, CAMERA.focal)
    beyond = (np.abs(outside) > np.array([80.0, 60.0])) | (np.abs(wider) > np.array([80.0, 60.0]))
    assert beyond.any(axis=-1).all()
    assert align_past(seen, rotation, CAMERA).min() == 200


HERE = Pose(1.6, 1.4, 0.5)


@pytest.fixture(scope="module")
def office() -> Iterator[Simulation]:
    with Simulation(load_world(find("world", "office")), ROBOT, HERE, seed=1) as simulation:
        yield simulation


def rendered_pair(office: Simulation, step: Pose) -> tuple[FramePair, Array]:
    """Frames before and after ``step`` that ends at HERE, and the true flow."""
    past = HERE.compose(step.relative(Pose(0.0, 0.0, 0.0)))
    before, _ = office.render_from(past)
    after, depth = office.render_from(HERE)
    motion = camera_motion(ROBOT, past, HERE, 0.2)
    rays = Scene(CAMERA).rays() * CAMERA.focal
    far = np.where(np.isfinite(depth), depth, 50.0).astype(np.float64)
    flow = true_flow(rays, far, motion, CAMERA.focal)
    return FramePair(Frame(0.0, before), Frame(0.2, after), motion), flow


@pytest.mark.parametrize("processor", [BLOCK_MATCHING, DIS], ids=lambda p: p.name)
@pytest.mark.parametrize(
    ("step", "median"),
    [
        (Pose(0.0, 0.0, 0.06), 0.15),
        (Pose(0.0, 0.0, -0.06), 0.15),
        (Pose(0.05, 0.0, 0.0), 0.35),
        (Pose(-0.05, 0.0, 0.0), 0.35),
        (Pose(0.05, 0.001, 0.05), 0.35),
    ],
)
def test_flow_agrees_with_rendered_depth_and_true_motion(
    office: Simulation, processor: FlowProcessor, step: Pose, median: float
) -> None:
    pair, truth = rendered_pair(office, step)
    flow = processor.compute(pair)
    expected = cell_truth(truth, flow.points, CAMERA)
    trusted = flow.confidence > 0.3
    error = np.linalg.norm(flow.vectors - expected, axis=-1)[trusted]
    assert trusted.mean() > 0.4
    assert np.median(error) < median
    # the same vectors with the opposite sign would be far off
    assert np.median(np.linalg.norm(flow.vectors + expected, axis=-1)[trusted]) > 4 * median
