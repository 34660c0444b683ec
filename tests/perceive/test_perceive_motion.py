"""Working images; motion between two: signs of the gyro, tracked points, scale."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.camera_geometry.rotations import rotation_matrix
from navfw.egomotion.flow_egomotion import Egomotion, MotionKind
from navfw.errors import InputError
from navfw.flow import grid_points
from navfw.flow.ideal import true_vectors
from navfw.numerics import Array, Image
from navfw.perceive.pair_motion import (
    PairMotion,
    PairMotionEstimator,
    ScaleEstimator,
    TrackImage,
    rotation_vector,
    track_points,
)
from navfw.perceive.perceiver_options import PerceiverOptions, WorkingSize
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

FREE_TURN = 0.15
DEVIATION = 3.0
RATE_DRIFT = 0.35

SIZE = WorkingSize.of(640, 480, 12, 16)
SIDES = st.integers(60, 4000)
CAMERA: CameraModel = SIZE.camera(math.radians(65.0), 0.9, 0.0, 10.0)


def turned_by(vector: Array) -> CameraMotion:
    """A rotation about base_link's x, y, z [rad], as camera motion."""
    base = CAMERA.base_from_camera
    return CameraMotion(base.T @ rotation_matrix(-vector) @ base, np.zeros(3), 0.1)


def picture(seed: int) -> Image:
    """A colour image (480, 640, 3) with corners."""
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (480, 640))
    smooth = cv2.GaussianBlur(noise, (0, 0), 4.0)
    grey = np.clip(128.0 + 50.0 * smooth / smooth.std(), 0, 255).astype(np.uint8)
    return np.asarray(np.repeat(grey[..., None], 3, axis=2), dtype=np.uint8)


def test_gyro_and_simulator_agree_on_signs() -> None:
    # turning left, the world moves to the right in the image; nose down, it moves up
    left = turned_by(np.array([0.0, 0.0, 0.05]))
    assert true_vectors(np.zeros((1, 2)), np.zeros(1), left, CAMERA.focal)[0, 0] > 1.0
    down = turned_by(np.array([0.0, 0.05, 0.0]))
    assert true_vectors(np.zeros((1, 2)), np.zeros(1), down, CAMERA.focal)[0, 1] < -1.0
    right_side_down = turned_by(np.array([0.05, 0.0, 0.0]))
    moved = true_vectors(np.array([[50.0, 0.0]]), np.zeros(1), right_side_down, CAMERA.focal)
    assert moved[0, 1] < -1.0


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.1), (0.0, -0.05, 0.02), (0.03, 0.0, 0.0)])
def test_the_rotation_vector_of_a_rotation(vector: tuple[float, float, float]) -> None:
    found = rotation_vector(turned_by(np.array(vector)).rotation, CAMERA)
    assert found == pytest.approx(np.array(vector), abs=1e-9)


def test_points_are_tracked_beyond_the_search_range_of_the_flow() -> None:
    past = picture(1)
    now = np.roll(past, (0, 40), axis=(0, 1))
    motion = track_points(TrackImage.of(past), TrackImage.of(now), SIZE)
    assert len(motion.points) > 100
    middle = motion.points[:, 0] > -50.0
    shift = np.median((motion.points - motion.past)[middle], axis=0)
    assert shift == pytest.approx([40.0 * SIZE.scale, 0.0], abs=0.05)


def test_images_without_corners_give_no_points() -> None:
    grey = TrackImage.of(np.full((480, 640, 3), 100, np.uint8))
    assert len(track_points(grey, grey, SIZE).points) == 0
    estimator = PairMotionEstimator(CAMERA, SIZE, None)
    assert estimator.estimate(grey, grey, 0.0, 0.1).egomotion.kind is MotionKind.UNKNOWN


def turned_view(image: Image, yaw: float) -> TrackImage:
    """What the camera sees of a distant ``image`` after a turn by ``yaw`` [rad]."""
    focal = CAMERA.focal / SIZE.scale
    camera = np.array([[focal, 0.0, 319.5], [0.0, focal, 239.5], [0.0, 0.0, 1.0]])
    turn = turned_by(np.array([0.0, 0.0, yaw])).rotation
    warp = camera @ turn @ np.linalg.inv(camera)
    now = cv2.warpPerspective(image, warp, (640, 480), borderMode=cv2.BORDER_REFLECT)
    return TrackImage.of(np.asarray(now, dtype=np.uint8))


def test_a_turn_is_told_from_a_translation() -> None:
    past = picture(2)
    estimator = PairMotionEstimator(CAMERA, SIZE, None)
    found = estimator.estimate(TrackImage.of(past), turned_view(past, 0.04), 0.0, 0.1)
    assert found.egomotion.kind is MotionKind.ROTATION
    assert not found.translates
    vector = rotation_vector(found.egomotion.rotation, CAMERA)
    assert vector == pytest.approx([0.0, 0.0, 0.04], abs=0.001)


def test_a_steady_turn_is_expected_to_go_on() -> None:
    wide, blank = picture(3), TrackImage.of(np.full((480, 640, 3), 100, np.uint8))
    estimator = PairMotionEstimator(CAMERA, SIZE, None)
    views = [turned_view(wide, 0.02 * k) for k in range(5)]
    for k in range(4):
        turned = estimator.estimate(views[k], views[k + 1], 0.1 * k, 0.1 * (k + 1)).egomotion
    rate = rotation_vector(turned.rotation, CAMERA)[2]
    assert rate == pytest.approx(0.02, abs=0.001)
    # nothing is seen for twice as long
    found = estimator.estimate(blank, blank, 0.4, 0.6).egomotion
    assert rotation_vector(found.rotation, CAMERA)[2] == pytest.approx(2.0 * rate, rel=0.01)
    assert math.sqrt(found.covariance[1, 1]) == pytest.approx(RATE_DRIFT * 0.2)
    estimator.interrupt()
    found = estimator.estimate(blank, blank, 5.0, 5.2).egomotion
    assert rotation_vector(found.rotation, CAMERA) == pytest.approx(np.zeros(3))
    assert math.sqrt(found.covariance[1, 1]) == pytest.approx(FREE_TURN)


def test_alternatives_are_the_flow_of_motions_that_are_as_far_off_as_the_covariance_says() -> None:
    ahead, sigma = np.array([0.0, 0.0, 1.0]), 0.002
    covariance = np.diag([0.0, sigma**2, 0.0, 0.0, 0.0])  # about the camera's y axis alone
    motion = PairMotion(
        Egomotion(MotionKind.FORWARD, np.eye(3), ahead, covariance, 0.0), 0.1, "flow", ()
    )
    points = grid_points(CAMERA, 12, 16)
    moved = motion.camera_motion(0.2)
    nearness = np.full((12, 16), 0.5)
    vectors = true_vectors(points, nearness, moved, CAMERA.focal)
    ones = np.ones((12, 16))
    flow = FlowField(0.1, points, vectors, ones, ones, moved, derotated=True)
    shifts = [
        float((other.vectors - vectors)[6, 8, 0])
        for other in motion.alternatives(flow, CAMERA.focal)
    ]
    expected = DEVIATION * sigma * CAMERA.focal
    assert sorted(shifts) == pytest.approx([-expected, *[0.0] * 8, expected], rel=0.05, abs=1e-9)
    for other in motion.alternatives(flow, CAMERA.focal):
        assert other.motion.baseline == pytest.approx(moved.baseline)


def test_scale_from_what_is_known() -> None:
    assert ScaleEstimator(0.5, 1.2).update(0.9).source == "speed"
    assert ScaleEstimator(0.5, 1.2).update(0.9).height == 1.2
    from_speed = ScaleEstimator(0.5, None)
    assert not from_speed.update(None).floor
    assert from_speed.update(0.4).height == pytest.approx(1.25)
    assert from_speed.update(None).height == pytest.approx(1.25)  # remembered
    from_height = ScaleEstimator(None, 1.2).update(0.5)
    assert from_height.source == "height"
    assert from_height.speed == pytest.approx(0.6)
    nothing = ScaleEstimator(None, None).update(None)
    assert not nothing.metric
    assert not nothing.floor


@given(SIDES, SIDES, st.sampled_from([(12, 16), (10, 15), (24, 32), (6, 8)]))
def test_any_size_becomes_one_that_the_grid_divides(
    width: int, height: int, grid: tuple[int, int]
) -> None:
    if not 0.3 < width / height < 3.0:
        return
    rows, cols = grid
    size = WorkingSize.of(width, height, rows, cols)
    assert size.cut_width % cols == 0
    assert size.cut_height % rows == 0
    # nothing beyond the image is used, and most of it is
    assert size.cut_width <= size.scale * width + 1e-6
    assert size.cut_height <= size.scale * height + 1e-6
    assert size.cut_width * size.cut_height > 0.75 * size.scale**2 * width * height
    assert 0.25 <= size.cut_width * size.cut_height / (160 * 120) <= 4.0


@given(SIDES, SIDES, st.floats(0.4, 2.4))
def test_focal_length_follows_scale_and_cut(width: int, height: int, hfov: float) -> None:
    if not 0.4 < width / height < 2.5:
        return
    size = WorkingSize.of(width, height, 12, 16)
    camera = size.camera(hfov, 1.0, 0.0, 10.0)
    whole = 0.5 * width / math.tan(0.5 * hfov)
    assert camera.focal == pytest.approx(size.scale * whole, rel=1e-9)


@pytest.mark.parametrize("size", [(160, 120), (640, 480), (1080, 1920), (3024, 4032), (500, 500)])
def test_cells_are_about_square_and_nothing_is_cut(size: tuple[int, int]) -> None:
    rows, cols = PerceiverOptions().grid_for(*size)
    working = WorkingSize.of(*size, rows, cols)
    assert 0.7 < (working.cut_width / cols) / (working.cut_height / rows) < 1.45
    kept = working.cut_width * working.cut_height / working.scale**2
    assert kept == pytest.approx(size[0] * size[1], rel=1e-6)
    assert PerceiverOptions(grid=(6, 8)).grid_for(*size) == (6, 8)


def test_points_come_back_to_the_image() -> None:
    assert SIZE.to_image(np.array([0.0, 0.0])) == pytest.approx([320.0, 240.0])
    assert SIZE.to_image(np.array([-80.0, 60.0])) == pytest.approx([0.0, 480.0])


@pytest.mark.parametrize("shape", [(480, 640), (500, 700)])  # whole, and without its sides
def test_a_mark_stays_where_it_is(shape: tuple[int, int]) -> None:
    image = np.zeros((*shape, 3), np.uint8)
    image[100:104, 400:404] = 255
    size = WorkingSize.of(shape[1], shape[0], 12, 16)
    working = size.prepare(image)
    assert working.shape == (120, 160)
    places = np.average(np.indices(working.shape), axis=(1, 2), weights=np.stack([working] * 2))
    assert size.to_image(places[::-1] - (79.5, 59.5)) == pytest.approx([402.0, 102.0], abs=1.0)


@pytest.mark.parametrize("shape", [(10, 10), (23, 500), (20_000, 40)])
def test_images_that_show_nothing(shape: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="images of"):
        WorkingSize.of(*shape, 12, 16)
