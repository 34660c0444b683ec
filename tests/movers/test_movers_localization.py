"""Moving objects and stixels in dense flow of the floor and upright boards."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.egomotion.pairing import camera_motion
from navfw.movers.localization import locate_moving_objects
from navfw.movers.motion_segmentation import crossing_cells, direction_sigma, segment_motion
from navfw.movers.stixels import find_stixels
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel, SideViews
from navfw.signals import CameraMotion, FlowField, Pose, Stixels

ROBOT = RobotModel()
CAMERA = ROBOT.camera
X, Y = np.meshgrid((np.arange(40) - 19.5) * 4.0, (np.arange(18) - 2.5) * 4.0)
POINTS = np.stack([X, Y], axis=-1)
DT = 0.2


def driven(way: float, robot: RobotModel = ROBOT) -> CameraMotion:
    return camera_motion(robot, Pose(0, 0, 0), Pose(way, 0, 0), DT)


def flow_of(
    nearness: Array,
    motion: CameraMotion,
    own: tuple[float, float] = (0.0, 0.0),
    camera: CameraModel = CAMERA,
    points: Array = POINTS,
) -> Array:
    """Exact derotated flow at ``points`` of surfaces of ``nearness``, moving by ``own`` [m/s].

    ``own`` is (ahead, left) in base_link.
    """
    s = motion.translation - camera.base_from_camera.T @ np.array([*own, 0.0]) * DT
    lever = points * s[2] - camera.focal * s[:2]
    return np.asarray(lever * (nearness / (1.0 + s[2] * nearness))[..., None])


def boards_on_floor(
    way: float,
    boards: list[tuple[float, float, float]],
    own: tuple[float, float] = (0.0, 0.0),
    noise: float = 0.0,
    robot: RobotModel = ROBOT,
    seed: int = 0,
) -> FlowField:
    """Flow of the floor and of upright ``boards`` (ahead, left, width) [m] after ``way`` [m].

    The boards move by ``own`` [m/s].
    """
    camera, motion = robot.camera, driven(way, robot)
    floor = np.maximum(camera.fall_per_depth(POINTS), 0.0) / camera.mount_height
    ahead = math.cos(camera.pitch) - Y / camera.focal * math.sin(camera.pitch)
    nearest, vectors = floor, flow_of(floor, motion, camera=camera)
    for distance, left, width in boards:
        depth = distance / ahead
        hit = (np.abs(X / camera.focal * depth + left) < 0.5 * width) & (nearest < 1.0 / depth)
        nearest = np.where(hit, 1.0 / depth, nearest)
        vectors[hit] = flow_of(1.0 / depth, motion, own, camera)[hit]
    vectors += noise * np.random.default_rng(seed).standard_normal(vectors.shape)
    known = np.ones(X.shape)
    return FlowField(1.0, POINTS, vectors, known, 0.2 * known, motion, derotated=True)


def scene(
    way: float,
    body: tuple[float, float, float],
    own: tuple[float, float],
    noise: float = 0.0,
    robot: RobotModel = ROBOT,
) -> FlowField:
    """One board, with the inconsistency of vectors that point across their epipolar lines."""
    flow = boards_on_floor(way, [body], own, noise, robot)
    motion, (u, v) = flow.motion, np.moveaxis(flow.vectors, -1, 0)
    lever = POINTS * motion.translation[2] - CAMERA.focal * motion.translation[:2]
    across = np.abs(u * lever[..., 1] - v * lever[..., 0])
    across /= np.maximum(np.hypot(lever[..., 0], lever[..., 1]), 1e-6)
    sigma = np.hypot(0.2, direction_sigma(motion) * np.hypot(u, v))
    odd = 1.0 * (across > 3.0 * np.hypot(sigma, 0.1))
    return dataclasses.replace(flow, inconsistency=odd)


@pytest.mark.parametrize("way", [0.0, 0.04, 0.1, -0.03])
@pytest.mark.parametrize("depth", [0.8, 1.5, 3.0])
def test_nothing_is_detected_in_a_static_scene(way: float, depth: float) -> None:
    for noise in (0.0, 0.15):
        flow = scene(way, (depth, 0.2, 0.5), (0.0, 0.0), noise)
        assert locate_moving_objects(flow, CAMERA) == ()


@pytest.mark.parametrize(("rows", "spread", "number"), [(6, 0.0, 1), (6, 4.0, 0), (2, 0.0, 0)])
def test_only_upright_bodies_of_one_motion_are_detected(
    rows: int, spread: float, number: int
) -> None:
    flow = scene(0.05, (1.5, 0.2, 0.0), (0.0, 0.0))
    odd = np.zeros(X.shape)
    odd[6 : 6 + rows, 15 : 15 + 12 // rows] = 1.0
    off = np.random.default_rng(0).normal((2.5, 0.0), spread, (*X.shape, 2))
    flow = dataclasses.replace(flow, vectors=flow.vectors + odd[..., None] * off, inconsistency=odd)
    assert len(locate_moving_objects(flow, CAMERA)) == number


@settings(max_examples=60, deadline=None)
@given(
    way=st.sampled_from([0.0, 0.03, 0.08]),
    depth=st.floats(0.9, 1.8),
    left=st.floats(-0.4, 0.4),
    speed=st.floats(0.3, 0.6),
    toward=st.sampled_from([1.0, -1.0]),
)
def test_a_crossing_object_is_located_with_its_velocity(
    way: float, depth: float, left: float, speed: float, toward: float
) -> None:
    flow = scene(way, (depth, left, 0.5), (0.0, toward * speed))
    (detection,) = locate_moving_objects(flow, CAMERA)
    assert detection.bearing == pytest.approx(math.atan2(left, depth), abs=0.12)
    assert detection.distance * math.cos(detection.bearing) == pytest.approx(depth, rel=0.15)
    assert detection.width == pytest.approx(math.atan2(0.25, depth), rel=0.3)
    ahead, aside = detection.velocity()
    assert aside == pytest.approx(toward * speed, rel=0.25)
    assert abs(ahead) < 0.2
    assert detection.time == 1.0


def test_mismatches_at_an_objects_outline_do_not_change_its_velocity() -> None:
    flow = scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4))
    spoiled = (Y > 6.0) & (X > 12.0) & (X < 18.0)  # a column of the body
    vectors = flow.vectors + spoiled[..., None] * np.array([-3.0, 2.0])
    (exact,) = locate_moving_objects(flow, CAMERA)
    (detection,) = locate_moving_objects(dataclasses.replace(flow, vectors=vectors), CAMERA)
    assert detection.velocity() == pytest.approx(exact.velocity(), abs=0.003)


def test_four_cells_with_errors_of_half_a_pixel_tell_as_much_as_one_of_half_a_pixel() -> None:
    flow = scene(0.03, (1.2, 0.1, 0.5), (0.0, 0.5))
    (detection,) = locate_moving_objects(flow, CAMERA)
    assert flow.inconsistency is not None
    cells = int((flow.inconsistency > 0.0).sum())
    depth = detection.distance * math.cos(detection.bearing)
    per_speed = CAMERA.focal * DT / depth  # [px / (m/s)]
    sigma = 0.5 / per_speed / math.sqrt(cells / 4.0)
    assert detection.information[1, 1] == pytest.approx(1.0 / sigma**2, rel=0.35)


def test_an_object_at_constant_bearing_is_detected_by_flow_below_the_floors() -> None:
    # straight ahead of the robot, faster than it: no flow across epipolar lines, none outward
    (detection,) = locate_moving_objects(scene(0.08, (1.2, 0.0, 0.5), (0.7, 0.0)), CAMERA)
    assert detection.velocity()[0] > 0.4


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("way", [0.0, 0.04])
def test_detections_of_a_side_view_are_in_the_frame_of_the_robot(side: int, way: float) -> None:
    camera = RobotModel(side_views=SideViews()).side_cameras[side]
    flow = scene(way, (1.2, 0.0, 0.5), (0.5, 0.0), robot=ROBOT.with_camera(camera))
    (detection,) = locate_moving_objects(flow, camera)
    assert detection.bearing == pytest.approx(camera.turn, abs=0.1)
    assert detection.distance == pytest.approx(1.2, rel=0.15)
    ahead, left = detection.velocity()
    assert ahead == pytest.approx(0.5, rel=0.35)
    assert abs(left) < 0.25


def test_small_floating_or_very_fast_regions_are_no_objects() -> None:
    flow = scene(0.08, (1.2, 0.0, 0.5), (0.0, 0.0))
    assert flow.inconsistency is not None
    for rows, cols in ((slice(5, 7), slice(10, 12)), (slice(0, 3), slice(5, 15))):
        odd = flow.inconsistency.copy()
        odd[rows, cols] = 1.0
        assert locate_moving_objects(dataclasses.replace(flow, inconsistency=odd), CAMERA) == ()
    assert locate_moving_objects(scene(0.08, (1.2, 0.0, 0.5), (0.0, 4.0)), CAMERA) == ()


def test_flow_with_rotation_is_refused() -> None:
    flow = dataclasses.replace(scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4)), derotated=False)
    for detect in (locate_moving_objects, find_stixels):
        with pytest.raises(ValueError, match="derotated"):
            detect(flow, CAMERA)


@pytest.mark.parametrize(("depth", "speed"), [(0.9, 0.33), (0.9, 0.5), (1.3, 0.5)])
def test_an_approaching_object_seems_nearer_than_its_foot(depth: float, speed: float) -> None:
    # about as fast as the robot, a little aside: no flow across epipolar lines, more outward
    flow = scene(0.09, (depth, 0.25, 0.5), (-speed, 0.0))
    gaps = np.ones(X.shape)
    gaps[::3, ::3] = 0.0
    for known in (flow.confidence, gaps):  # cells without a match
        (detection,) = locate_moving_objects(dataclasses.replace(flow, confidence=known), CAMERA)
        assert detection.distance == pytest.approx(depth, rel=0.3)
        assert detection.velocity()[0] < -0.1


@given(depth=st.floats(0.5, 3.0), left=st.floats(-0.8, 0.8), way=st.floats(0.03, 0.12))
@settings(max_examples=40, deadline=None)
def test_static_things_seem_no_nearer_than_their_foot(
    depth: float, left: float, way: float
) -> None:
    flow = scene(way, (depth, left, 0.5), (0.0, 0.0), noise=0.1)
    moving, _ = segment_motion(flow, CAMERA.fall_per_depth(flow.points), CAMERA)
    assert not moving.any()


def test_patches_keep_their_place() -> None:
    # every cell marked as moving is on the crossing object
    flow = scene(0.05, (1.2, 0.0, 0.5), (0.0, 0.4))
    moving, _ = segment_motion(flow, CAMERA.fall_per_depth(flow.points), CAMERA)
    body = (np.abs(X * 1.2 / CAMERA.focal) < 0.25) & (1.2 * CAMERA.focal > Y)
    assert moving.any()
    assert not (moving & ~body).any()


WINDOWS = np.stack(np.meshgrid(10.0 * (np.arange(16) - 7.5), 10.0 * (np.arange(12) - 5.5)), axis=-1)
"""Centres of the windows of the whole image [px]."""


def whole_image(
    way: float, body: tuple[float, float, float], own: tuple[float, float]
) -> FlowField:
    """Flow of the whole image with a tall body (ahead, left, width) that moves by ``own``."""
    motion = driven(way)
    x, y = np.moveaxis(WINDOWS, -1, 0) / CAMERA.focal
    depth, left, width = body
    behind = np.maximum(np.maximum(y, 0.0) / CAMERA.mount_height, 1.0 / 5.0)
    hit = (np.abs(x * depth + left) < 0.5 * width) & (y * depth < CAMERA.mount_height)
    static = flow_of(behind, motion, points=WINDOWS)
    moving = flow_of(np.full(x.shape, 1.0 / depth), motion, own, points=WINDOWS)
    vectors = np.where(hit[..., None], moving, static)
    vectors += np.random.default_rng(0).normal(0.0, 0.15, vectors.shape)
    known = np.ones(x.shape)
    return FlowField(1.0, WINDOWS, vectors, known, 0.2 * known, motion, derotated=True)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_approaches_on_a_constant_bearing_is_seen_above_the_horizon(side: float) -> None:
    # robot and person meet in 1.7 s; as often 2 m away, its lower part is not matched
    way, body = 0.14, (2.0, 0.8 * side, 0.5)
    own = -0.5, -0.48 * side
    dense, whole = scene(way, body, own, noise=0.1), whole_image(way, body, own)
    upright = (np.abs(X / CAMERA.focal * 2.0 + body[1]) < 0.3) & (CAMERA.focal * 0.35 / 2.0 > Y)
    dense = dataclasses.replace(dense, confidence=1.0 * ~upright, inconsistency=None)
    assert not locate_moving_objects(dense, CAMERA)
    (person,) = locate_moving_objects(dense, CAMERA, whole)
    assert person.bearing == pytest.approx(math.atan2(body[1], body[0]), abs=0.1)
    assert person.distance == pytest.approx(math.hypot(*body[:2]), rel=0.25)
    ahead, left = person.velocity()
    assert ahead < -0.1, "its foot is known to a cell"
    assert left == pytest.approx(own[1], abs=0.15)


@pytest.mark.parametrize("depth", [1.0, 2.0])
def test_nothing_static_crosses_however_near(depth: float) -> None:
    for left in (-0.6, 0.0, 0.4):
        assert not crossing_cells(whole_image(0.14, (depth, left, 0.5), (0.0, 0.0)), CAMERA)


@pytest.mark.parametrize("column", [2, 6, 13])
def test_mismatches_in_a_column_are_no_body_that_crosses(column: int) -> None:
    whole = whole_image(0.14, (2.0, 5.0, 0.5), (0.0, 0.0))  # the body is out of view
    vectors = whole.vectors.copy()
    vectors[:5, column, 0] += (9.0, 0.0, -1.0, 7.0, 0.0)
    assert not crossing_cells(dataclasses.replace(whole, vectors=vectors), CAMERA)
    vectors[:6, column, 0] = whole.vectors[:6, column, 0] + 2.0  # the same shift everywhere
    assert crossing_cells(dataclasses.replace(whole, vectors=vectors), CAMERA)


def located(depth: float) -> float:
    """Distance [m] along the camera's axis of an object that crosses at ``depth`` [m]."""
    (detection,) = locate_moving_objects(scene(0.0, (depth, 0.0, 0.3), (0.0, 0.4)), CAMERA)
    return detection.distance * math.cos(detection.bearing)


def test_an_object_with_its_foot_below_the_image_is_nearer_than_the_floor_in_view() -> None:
    lowest = (POINTS[-1, 0, 1] + 2.0) / CAMERA.focal  # at the lower border of the last cells
    in_view = CAMERA.mount_height / lowest
    for depth in (0.3, 0.38, 0.45):
        assert located(depth) == pytest.approx(0.8 * in_view, rel=0.01)


def test_three_millimetres_aside_make_the_direction_uncertain() -> None:
    assert direction_sigma(driven(0.0)) == 1.0
    assert direction_sigma(driven(0.1)) == pytest.approx(0.03 + math.atan2(0.003, 0.1), rel=1e-3)
    assert direction_sigma(driven(100.0)) == pytest.approx(0.03, rel=1e-2)


@pytest.mark.parametrize("turn", [-0.12, 0.12])
@pytest.mark.parametrize("farther", [-0.1, 0.0, 0.1])
def test_skidding_wheels_move_no_floor(turn: float, farther: float) -> None:
    """A turn on the spot about another point than base_link: the camera goes another way aside."""
    camera = ROBOT.camera.model_copy(update={"mount_forward": 0.5})
    robot = ROBOT.model_copy(update={"camera": camera})
    nearness = np.maximum(Y, 0.0) / CAMERA.focal / CAMERA.mount_height
    true = camera_motion(robot, Pose(0, 0, 0), Pose(0, -farther * turn, turn), DT)
    vectors = flow_of(nearness, true, camera=robot.camera)
    found = {}
    for skid in (0.0, 0.08):
        skidding = robot.model_copy(update={"skid": skid})
        believed = camera_motion(skidding, Pose(0, 0, 0), Pose(0, 0, turn), DT)
        flow = dataclasses.replace(
            scene(0.0, (2.0, 9.0, 0.1), (0.0, 0.0)),
            vectors=vectors,
            motion=believed,
            inconsistency=None,
        )
        found[skid], _ = segment_motion(flow, camera.fall_per_depth(POINTS), camera)
    assert not found[0.08].any()
    assert found[0.0].any() == (farther > 0.0)


def test_the_foot_point_counts_as_out_of_view_down_to_the_border_of_the_flow() -> None:
    # foot points above the lowest two rows of cells are in view; 9 px of border are two rows
    rows = POINTS[:, 0, 1]
    for row, factor in ((-5, 1.0), (-4, 1.0), (-3, 0.8), (-2, 0.8), (-1, 0.8)):
        foot = rows[row] + 2.0  # the body ends between this row and the next
        depth = CAMERA.mount_height * CAMERA.focal / foot
        assert located(depth) == pytest.approx(factor * depth, rel=0.01)


# --- stixels: one distance explains a whole column of cells above the foot point ---


def pitched(pitch: float) -> RobotModel:
    return RobotModel(camera=CameraModel(pitch=pitch))


def stixels_of(flow: FlowField, camera: CameraModel = CAMERA) -> Stixels:
    stixels = find_stixels(flow, camera)
    assert stixels is not None
    return stixels


@settings(max_examples=60, deadline=None)
@given(
    distance=st.floats(0.5, 0.9),
    aside=st.floats(-0.6, 0.6),
    way=st.sampled_from([0.08, 0.12, -0.08]),
    pitch=st.sampled_from([-0.05, 0.0, 0.1]),
)
def test_a_pole_is_located(distance: float, aside: float, way: float, pitch: float) -> None:
    boards = [(distance, aside * distance, 0.15)]
    stixels = stixels_of(boards_on_floor(way, boards, robot=pitched(pitch)), pitched(pitch).camera)
    sure = stixels.confidence > 0.5
    assert sure.any()
    assert stixels.nearness[sure] == pytest.approx(1.0 / distance, rel=0.06)
    # slopes to the left are positive, and no other columns than the pole's have confidence
    half = 0.5 * 0.15 / distance + 4.0 / CAMERA.focal
    assert (np.abs(stixels.slope[sure] - aside) < half).all()
    assert (stixels.sigma[sure] > 0.0).all()


def test_a_pole_straight_ahead_is_found_where_single_vectors_are_short() -> None:
    found, partly = 0, False
    for seed in range(20):
        stixels = stixels_of(boards_on_floor(0.08, [(0.9, 0.0, 0.15)], noise=0.15, seed=seed))
        partly |= bool(((stixels.confidence > 0.1) & (stixels.confidence < 0.9)).any())
        middle = np.abs(stixels.slope) < 0.06
        found += bool((stixels.confidence[middle] > 0.3).any())
        wrong = (stixels.confidence > 0.3) & (stixels.nearness > 1.4 / 0.9)
        assert np.count_nonzero(wrong) <= 1
    assert found >= 16
    assert partly


@pytest.mark.parametrize("seed", range(5))
def test_there_are_no_near_stixels_on_empty_floor(seed: int) -> None:
    stixels = stixels_of(boards_on_floor(0.08, [], noise=0.15, seed=seed))
    assert not ((stixels.confidence > 0.0) & (stixels.nearness > 0.6)).any()


def test_the_nearer_of_two_hides_the_other() -> None:
    stixels = stixels_of(boards_on_floor(0.08, [(1.6, 0.0, 0.8), (0.8, 0.0, 0.15)]))
    sure = (stixels.confidence > 0.5) & (np.abs(stixels.slope) < 0.05)
    assert stixels.nearness[sure] == pytest.approx(1.0 / 0.8, rel=0.06)


def test_there_are_no_stixels_without_baseline_with_steep_cameras_or_few_cells() -> None:
    boards, steep = [(0.8, 0.0, 0.15)], pitched(0.4)
    assert find_stixels(boards_on_floor(0.01, boards), CAMERA) is None
    assert find_stixels(boards_on_floor(0.08, boards, robot=steep), steep.camera) is None
    flow = boards_on_floor(0.08, boards)
    few = np.where(np.arange(18)[:, None] < 14, 0.0, flow.confidence)
    stixels = stixels_of(dataclasses.replace(flow, confidence=few))
    assert not stixels.confidence.any()
