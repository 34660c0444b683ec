"""The motion of the camera: between paired frames by odometry, and from point motion alone."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localization_drives import odometry, step
from pydantic import ValidationError

from navfw.camera_geometry.rotations import rotate_points, rotation_matrix
from navfw.egomotion import seeing_speed
from navfw.egomotion.flow_egomotion import (
    Egomotion,
    EgomotionPrior,
    MotionKind,
    PointMotion,
    estimate_egomotion,
)
from navfw.egomotion.pairing import FrameBuffer, PairingParams, camera_motion, yaw_rotation
from navfw.egomotion.plane_approach import towards_plane
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, FramePair, Odometry, Pose, Twist

MAX_AGE = 2.0
MIN_BASELINE = 0.02

ROBOT = RobotModel()
IMAGE = np.zeros((120, 160), np.uint8)


def drive(
    v: float,
    w: float,
    frames: int = 20,
    params: PairingParams | None = None,
    dt: float = 0.1,
    robot: RobotModel = ROBOT,
) -> list[tuple[FramePair, ...]]:
    """Pairs after each frame of a drive at constant twist."""
    buffer = FrameBuffer(robot, params)
    pose, given = Pose(0.0, 0.0, 0.0), []
    for i in range(frames):
        buffer.add(Frame(i * dt, IMAGE), Odometry(i * dt, pose, Twist(v, w), 0.0, still=False))
        given.append(buffer.pairs())
        pose = pose.compose(step(v, w, dt))
    return given


@given(v=st.floats(-0.15, 0.5), w=st.floats(-1.0, 1.0))
def test_every_pair_keeps_the_limits(v: float, w: float) -> None:
    params = PairingParams(short=True)
    for pairs in drive(v, w, params=params):
        assert len(pairs) <= 2
        for pair in pairs:
            turn = math.acos(min(1.0, (np.trace(pair.motion.rotation) - 1.0) / 2.0))
            assert MIN_BASELINE <= pair.motion.baseline <= params.max_baseline
            assert turn <= params.max_rotation + 1e-6
            assert 0.0 < pair.now.time - pair.past.time <= MAX_AGE + 1e-9
            assert pair.motion.dt == pytest.approx(pair.now.time - pair.past.time)
        if len(pairs) == 2:
            assert pairs[1].motion.baseline < 0.7 * pairs[0].motion.baseline


@pytest.mark.parametrize("v", [0.06, 0.2, 0.4, -0.1])
def test_the_baseline_comes_as_near_to_the_target_as_frames_allow(v: float) -> None:
    pairs = drive(v, 0.0, frames=40)[-1]
    assert len(pairs) == 1
    assert abs(pairs[0].motion.baseline - 0.08) <= 0.5 * abs(v) * 0.1 + 1e-9
    assert pairs[0].motion.translation[2] * v > 0.0
    assert pairs[0].now.time == pytest.approx(3.9)


@pytest.mark.parametrize(("height", "expected"), [(0.5, 0.08), (0.15, 0.05), (0.03, 0.02)])
def test_a_low_camera_has_a_shorter_baseline(height: float, expected: float) -> None:
    low = ROBOT.with_camera(ROBOT.camera.model_copy(update={"mount_height": height}))
    [pair] = drive(0.1, 0.0, robot=low)[-1]
    assert pair.motion.baseline == pytest.approx(expected)


def test_a_short_pair_comes_too_when_asked_for() -> None:
    pairs = drive(0.2, 0.0, params=PairingParams(short=True))[-1]
    assert [round(pair.motion.baseline, 3) for pair in pairs] == [0.08, 0.04]
    assert len(drive(0.2, 0.0)[-1]) == 1


@pytest.mark.parametrize(("v", "w"), [(0.0, 1.0), (0.0, 0.0), (0.2, 1.2)])
def test_turning_alone_or_fast_and_standing_give_no_pair(v: float, w: float) -> None:
    assert not any(drive(v, w))


@pytest.mark.parametrize("rate", [5.0, 6.0, 10.0])
def test_up_to_the_seeing_speed_successive_frames_are_pairs(rate: float) -> None:
    camera = ROBOT.camera.model_copy(update={"rate": rate})
    robot = ROBOT.model_copy(update={"camera": camera})
    speed = seeing_speed(robot, PairingParams())
    assert all(drive(speed, 0.0, dt=1.0 / rate)[1:])
    assert not any(drive(1.2 * speed, 0.0, dt=1.0 / rate))


def added(buffer: FrameBuffer, *places: tuple[float, float], v: float = 0.4) -> int:
    """Number of pairs after frames at times [s] and places ahead [m], in order."""
    for time, x in places:
        buffer.add(Frame(time, IMAGE), odometry(Pose(x, 0.0, 0.0), time, v))
    return len(buffer.pairs())


@pytest.mark.parametrize("moved", [0.0, 0.0019, 0.0021])
def test_a_step_of_less_than_two_millimetres_repeats_no_pair(moved: float) -> None:
    buffer = FrameBuffer(ROBOT)
    assert added(buffer, *((0.1 * i, 0.04 * i) for i in range(5))) == 1
    assert added(buffer, (0.5, 0.16 + moved), v=0.0) == (moved > 0.002)
    assert added(buffer, (0.6, 0.2)) == 1


def test_old_frames_are_forgotten_and_a_reset_forgets_all() -> None:
    assert added(FrameBuffer(ROBOT), (0.0, 0.0), (1.9, 0.08)) == 1
    assert added(FrameBuffer(ROBOT), (0.0, 0.0), (2.1, 0.08)) == 0
    buffer = FrameBuffer(ROBOT)
    assert added(buffer, (0.0, 0.0), (0.1, 0.04), (0.2, 0.08)) == 1
    buffer.reset()
    assert buffer.pairs() == ()
    assert added(buffer, (0.4, 0.2)) == 0


def test_a_frame_older_than_its_odometry_is_placed_by_the_twist() -> None:
    buffer = FrameBuffer(ROBOT, PairingParams(max_rotation=0.5))
    added(buffer, (0.0, 0.0), v=0.5)
    arc = Odometry(0.22, Pose(0.11, 0.0, 0.1), Twist(0.5, 1.0), 0.0, still=False)
    buffer.add(Frame(0.2, IMAGE), arc)
    (pair,) = buffer.pairs()
    then = arc.pose.compose(Pose(-0.01 * math.cos(0.01), 0.01 * math.sin(0.01), -0.02))
    camera = ROBOT.camera.mount_forward
    place = then.to_parent(camera, 0.0)
    assert pair.motion.baseline == pytest.approx(math.hypot(place[0] - camera, place[1]))
    assert math.atan2(pair.motion.rotation[0, 2], pair.motion.rotation[2, 2]) == pytest.approx(0.08)


def test_a_short_baseline_is_below_the_desired_one() -> None:
    for wrong in (0.08, 0.019):
        with pytest.raises(ValidationError, match="short_baseline"):
            PairingParams(short=True, short_baseline=wrong)


# --- the motion of the camera between two poses of the robot --------------------------------------

ORIGIN = Pose(0.0, 0.0, 0.0)
poses = st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-math.pi, math.pi))


def in_camera(robot: RobotModel, pose: Pose, point: Array) -> Array:
    """A point of the world in the axes of the camera of a robot at ``pose``."""
    camera = robot.camera
    base = yaw_rotation(-pose.yaw) @ (point - np.array([pose.x, pose.y, 0.0]))
    mount = np.array([camera.mount_forward, 0.0, camera.mount_height])
    return np.asarray(camera.base_from_camera.T @ (base - mount))


@given(
    past=poses,
    now=poses,
    pitch=st.floats(-0.9, 0.9),
    forward=st.floats(-0.3, 0.3),
    point=st.tuples(*[st.floats(-10, 10)] * 3),
)
def test_static_points_move_as_the_motion_says(
    past: Pose, now: Pose, pitch: float, forward: float, point: tuple[float, ...]
) -> None:
    robot = RobotModel(camera=CameraModel(pitch=pitch, mount_forward=forward))
    motion = camera_motion(robot, past, now, 0.1)
    before = in_camera(robot, past, np.array(point))
    after = in_camera(robot, now, np.array(point))
    np.testing.assert_allclose(motion.rotation @ before - motion.translation, after, atol=1e-9)
    np.testing.assert_allclose(motion.rotation @ motion.rotation.T, np.eye(3), atol=1e-12)


def test_sigmas_grow_with_time_way_and_turn() -> None:
    skidding = RobotModel(skid=0.02)
    usual = camera_motion(ROBOT, ORIGIN, Pose(0.05, 0, 0), 0.1)
    assert usual.yaw_sigma == pytest.approx(0.0003)
    assert usual.translation_sigma == pytest.approx(math.hypot(5e-4, 0.03 * 0.05))
    long = camera_motion(skidding, ORIGIN, Pose(0.1, 0, 0.2), -0.3, yaw_rate_sigma=0.01, slip=0.04)
    assert long.yaw_sigma == pytest.approx(0.003)
    assert long.skid_sigma == pytest.approx(0.02 * 0.2)
    expected = math.hypot(5e-4, 0.04 * long.baseline, 0.02 * 0.2)
    assert long.translation_sigma == pytest.approx(expected)


# --- from point motion: heading, rotation, their covariance, kinds --------------------------------

FOCAL = 100.0
HALF = np.array([80.0, 60.0])
ANGLE = st.floats(-0.06, 0.06)


def scene(seed: int, count: int = 200) -> tuple[Array, Array]:
    """Image points (n, 2) [px] and their depths (n,) [m]: a room with things in it."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-HALF, HALF, (count, 2)), rng.uniform(0.8, 6.0, count)


def seen(
    points: Array, depth: Array, rotation: Array, shift: Array, noise: float = 0.0, seed: int = 0
) -> PointMotion:
    """The motion of ``points`` when the camera turns by ``rotation`` and moves by ``shift`` [m]."""
    rays = np.column_stack([points / FOCAL, np.ones(len(points))])
    before = (rays * depth[:, None] + shift) @ rotation
    past = before[:, :2] / before[:, 2:] * FOCAL
    past += np.random.default_rng(seed).normal(0.0, noise, past.shape) if noise else 0.0
    return PointMotion(points, past, np.full(len(points), max(noise, 0.02)), np.ones(len(points)))


def angle_between(found: Egomotion, shift: Array) -> float:
    """Angle [deg] between the direction found and the true one."""
    cosine = float(found.direction @ shift) / float(np.linalg.norm(shift))
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))


@settings(max_examples=40, deadline=None)
@given(ANGLE, ANGLE, ANGLE, st.floats(-math.pi, math.pi), st.floats(-0.5, 0.5))
def test_any_motion_is_found_without_a_prior(
    x: float, y: float, z: float, bearing: float, elevation: float
) -> None:
    rotation = rotation_matrix(np.array([x, y, z]))
    flat, up = math.cos(elevation), math.sin(elevation)
    shift = 0.15 * np.array([flat * math.sin(bearing), up, flat * math.cos(bearing)])
    found = estimate_egomotion(seen(*scene(1), rotation, shift), FOCAL)
    assert angle_between(found, shift) < 0.5
    assert np.abs(found.rotation @ rotation.T - np.eye(3)).max() < 0.002
    if abs(shift[2]) > 0.51 * 0.15:
        expected = MotionKind.FORWARD if shift[2] > 0.0 else MotionKind.BACKWARD
        assert found.kind is expected
    elif abs(shift[2]) < 0.49 * 0.15:
        assert found.kind is MotionKind.SIDEWAYS


def test_a_quarter_of_moving_objects_does_no_harm() -> None:
    shift, rotation = np.array([0.02, 0.0, 0.12]), rotation_matrix(np.array([0.0, 0.03, 0.01]))
    motion = seen(*scene(2), rotation, shift, noise=0.1)
    moving = seen(*scene(2), rotation, shift + np.array([0.4, 0.1, 0.0]), noise=0.1)
    motion.past[:50] = moving.past[:50]
    found = estimate_egomotion(motion, FOCAL)
    assert found.kind is MotionKind.FORWARD
    assert angle_between(found, shift) < 2.0


def test_the_covariance_tells_the_truth() -> None:
    shift, rotation = np.array([0.0, -0.02, 0.12]), rotation_matrix(np.array([0.01, -0.02, 0.0]))
    within, bearings = 0, []
    for seed in range(60):
        motion = seen(*scene(seed), rotation, shift, noise=0.25, seed=seed)
        found = estimate_egomotion(motion, FOCAL)
        assert found.kind is MotionKind.FORWARD
        off = math.atan2(found.direction[0], found.direction[2])
        bearings.append(off / math.sqrt(found.covariance[3, 3]))
        within += angle_between(found, shift) < math.degrees(2.0 * found.heading_sigma)
    assert within >= 0.84 * 60
    # less than 1: the principal point, exact here, is not known elsewhere
    assert 0.5 < float(np.std(bearings)) < 1.5


def test_deviations_are_as_far_off_as_the_covariance_says() -> None:
    points, depth = scene(3)
    turn, shift = rotation_matrix(np.array([0.0, 0.02, 0.0])), np.array([0.1, 0.0, 0.2])
    found = estimate_egomotion(seen(points, depth, turn, shift, 0.3), FOCAL)
    off = [
        [*cv2.Rodrigues(turn)[0].ravel(), math.acos(min(float(way @ found.direction), 1.0))]
        for turn, way in found.deviations(2.0)
    ]
    turns, angles = np.array(off)[:, :3], np.array(off)[:, 3]
    assert turns.T @ turns / 8.0 == pytest.approx(found.covariance[:3, :3], rel=1e-3, abs=1e-9)
    assert angles @ angles / 8.0 == pytest.approx(np.trace(found.covariance[3:, 3:]), rel=1e-2)
    still = estimate_egomotion(PointMotion(points, points, np.ones(200), np.ones(200)), FOCAL)
    assert not list(still.deviations(2.0)), "no direction, no deviation from it"


def test_rotation_stillness_and_too_few_points_are_told_apart() -> None:
    points, depth = scene(3)
    turn = rotation_matrix(np.array([0.0, 0.05, 0.0]))
    found = estimate_egomotion(seen(points, depth, turn, np.zeros(3), noise=0.05), FOCAL)
    assert found.kind is MotionKind.ROTATION
    assert np.abs(found.rotation @ turn.T - np.eye(3)).max() < 0.002
    assert found.heading_sigma == math.inf
    still = estimate_egomotion(seen(points, depth, np.eye(3), np.zeros(3), noise=0.05), FOCAL)
    assert still.kind is MotionKind.STILL
    few = seen(points[:8], depth[:8], turn, np.array([0.0, 0.0, 0.1]))
    assert estimate_egomotion(few, FOCAL).kind is MotionKind.UNKNOWN


def test_points_that_move_at_random_show_no_motion() -> None:
    points, _ = scene(4)
    past = points + np.random.default_rng(4).normal(0.0, 4.0, points.shape)
    motion = PointMotion(points, past, np.full(len(points), 0.1), np.ones(len(points)))
    assert estimate_egomotion(motion, FOCAL).heading_sigma > math.radians(10.0)


def test_a_gyro_sharpens_the_heading() -> None:
    shift, turn = np.array([0.01, 0.0, 0.1]), rotation_matrix(np.array([0.0, 0.04, 0.0]))
    ratios = []
    for seed in range(8):
        motion = seen(*scene(seed), turn, shift, noise=0.3)
        alone = estimate_egomotion(motion, FOCAL)
        helped = estimate_egomotion(motion, FOCAL, EgomotionPrior(turn, np.eye(3) * 0.0005**2))
        ratios.append(helped.heading_sigma / alone.heading_sigma)
        assert angle_between(helped, shift) < 3.0
    assert np.mean(ratios) < 0.85


@pytest.mark.parametrize("towards", [np.array([0.0, 0.0, 1.0]), np.array([0.5, 0.0, 0.8])])
def test_a_heading_known_before_pulls_only_where_the_points_leave_it_open(towards: Array) -> None:
    towards = towards / np.linalg.norm(towards)
    points, _ = scene(6)
    shift = 0.1 * towards
    wall = seen(points, np.full(len(points), 2.0), np.eye(3), shift, noise=0.15)
    prior = EgomotionPrior(direction=towards, direction_sigma=0.1)
    alone, helped = (estimate_egomotion(wall, FOCAL, known) for known in (None, prior))
    assert angle_between(helped, shift) <= max(angle_between(alone, shift), 3.0)
    wrong = EgomotionPrior(direction=np.array([-1.0, 0.0, 0.0]), direction_sigma=0.3)
    room = seen(*scene(7), np.eye(3), shift, noise=0.05)
    assert angle_between(estimate_egomotion(room, FOCAL, wrong), shift) < 3.0


def test_a_rotation_with_noise_is_not_taken_for_a_translation() -> None:
    turn, still = rotation_matrix(np.array([0.0, 0.03, 0.0])), np.zeros(3)
    kinds = []
    for seed in range(40):
        motion = seen(*scene(seed), turn, still, noise=0.4, seed=seed)
        found = estimate_egomotion(replace(motion, sigma=0.25 * motion.sigma), FOCAL)
        kinds.append(found.kind)
        assert math.isinf(found.heading_sigma)
    assert kinds.count(MotionKind.ROTATION) > 30


def test_points_that_move_alike_in_parts_of_the_image_widen_the_covariance() -> None:
    shift = np.array([0.0, 0.0, 0.1])
    inside = []
    for seed in range(60):
        motion = seen(*scene(seed, 300), np.eye(3), shift, noise=0.1, seed=seed)
        corner = np.floor(motion.points / 40.0)  # the error of each patch of 40 px is its own
        waves = np.random.default_rng(seed).normal(0.0, 0.4, (8, 8, 2))
        past = motion.past + waves[tuple((corner.astype(int) + 4).T)]
        found = estimate_egomotion(replace(motion, past=past), FOCAL)
        inside.append(angle_between(found, shift) < math.degrees(2.15 * found.heading_sigma))
    assert np.mean(inside) > 0.8


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-0.03, 0.03), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.03, 0.3),
    st.integers(0, 9),
)  # fmt: skip
def test_a_plane_across_the_axis_is_approached_whatever_the_heading(
    yaw: float, right: float, down: float, ahead: float, seed: int
) -> None:
    points, _ = scene(seed)
    turn, shift = rotation_matrix(np.array([0.0, yaw, 0.0])), np.array([right, down, ahead])
    motion = seen(points, np.ones(len(points)), turn, shift, noise=0.1)
    prior = EgomotionPrior(turn, np.eye(3) * 0.05**2)
    found = towards_plane(motion, FOCAL, prior)
    assert found is not None
    assert math.isinf(found.heading_sigma)
    left = motion.points - rotate_points(motion.past, found.rotation, FOCAL)
    growth = np.polyfit(points[:, 0], left[:, 0], 1)[0]
    assert growth == pytest.approx(ahead / (1.0 + ahead), abs=0.02)


def test_no_plane_is_claimed_in_a_room_along_a_wall_or_going_back() -> None:
    prior, ahead = EgomotionPrior(), np.array([0.0, 0.0, 0.15])
    points, _ = scene(3)
    slanted = 2.0 / (1.0 + 0.8 * points[:, 0] / HALF[0])
    for depth, shift in ((scene(3)[1], ahead), (slanted, ahead), (np.ones(len(points)), -ahead)):
        assert towards_plane(seen(points, depth, np.eye(3), shift), FOCAL, prior) is None


def test_a_camera_that_went_backward_before_goes_on_backward() -> None:
    backward = np.array([0.05, 0.0, -1.0]) / math.hypot(0.05, 1.0)
    prior = EgomotionPrior(direction=backward, direction_sigma=0.05)
    motion = seen(*scene(8), np.eye(3), 0.1 * backward, noise=0.1)
    found = estimate_egomotion(motion, FOCAL, prior)
    assert found.kind is MotionKind.BACKWARD
    assert angle_between(found, backward) < 2.0
