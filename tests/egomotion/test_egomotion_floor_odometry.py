"""Odometry corrected by the floor: registration in metres, calibration of wheels and gyro, slip."""

import math
from collections.abc import Iterator
from dataclasses import astuple, replace

import numpy as np
import pytest
from painted_floor import KNOWN, ORIGIN, ROBOT, PaintedFloor
from plan_samples import arcs
from scipy.ndimage import gaussian_filter, map_coordinates

from navfw.egomotion import FloorOdometry, FloorRegistration, FloorStep
from navfw.egomotion.floor_kernels import _residuals, register_floor
from navfw.numerics import Array
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, Frame, Odometry, Pose, Twist, YawCorrection


def measured(floor: PaintedFloor, true: Pose, guess: Pose, light: float = 1.0) -> FloorStep | None:
    """The step from the origin to ``true``, where the light is another, by a ``guess``."""
    registration = FloorRegistration(ROBOT)
    past, now = (registration.prepare(v) for v in (floor.view(ORIGIN), floor.view(true, light)))
    return registration.register(past, now, guess, KNOWN)


@pytest.mark.parametrize(
    "true",
    [Pose(0.1, 0.0, 0.0), Pose(0.08, 0.004, 0.1), Pose(-0.06, 0.0, 0.0), Pose(0.0, 0.0, 0.1)],
    ids=["ahead", "arc", "back", "turn"],
)
def test_motion_over_the_floor_is_measured_in_metres(true: Pose) -> None:
    guess = Pose(true.x + 0.003, true.y - 0.0005, true.yaw + 0.002)
    found = measured(PaintedFloor(), true, guess)
    assert found is not None
    off = np.array([found.pose.x - true.x, found.pose.y - true.y, found.pose.yaw - true.yaw])
    assert np.abs(off[0]) < 8e-4
    assert off @ np.linalg.solve(found.covariance, off) < 16.3  # 99.9 % of 3 degrees of freedom
    assert found.share > 0.9


STEEP = CameraModel(pitch=0.25, mount_forward=0.12, mount_height=0.3)


def seen_before(ground: Array, at: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Column and row (2, n) in the past image of ``ground`` (n, 2), and their depth (n,)."""
    c, s = math.cos(at[2]), math.sin(at[2])
    then = ground @ np.array([[c, s], [-s, c]]) + at[:2] - (STEEP.mount_forward, 0.0)
    rays = np.column_stack([then, np.full(len(then), -STEEP.mount_height)]) @ STEEP.base_from_camera
    middle = 0.5 * np.array([[shape[1] - 1], [shape[0] - 1]])
    return middle + STEEP.focal * rays[:, :2].T / rays[:, 2], np.asarray(rays[:, 2])


@pytest.mark.parametrize("seed", range(2))
def test_residuals_of_the_floor_are_those_of_bilinear_images(seed: int) -> None:
    rng, shape, n = np.random.default_rng(seed), (80, 90), 3000
    past = gaussian_filter(rng.uniform(0.0, 255.0, shape), 1.0).astype(np.float32)
    ground = rng.uniform((-0.4, -1.0), (2.0, 1.0), (n, 2))
    values, farness = rng.uniform(0.0, 255.0, n), rng.uniform(0.0, 2.0, n)
    at = np.array([0.06, -0.02, 0.1, 0.04, -3.0])
    middle = 0.5 * (shape[1] - 1), 0.5 * (shape[0] - 1)
    camera = np.array([STEEP.focal, STEEP.mount_forward, STEEP.mount_height, *middle])
    offsets, slopes = np.empty(n), np.zeros((6, n))
    _residuals(past, values, ground, farness, camera, STEEP.base_from_camera, at, offsets, slopes)
    (u, v), depth = seen_before(ground, at, shape)
    seen = (depth > 0.0) & (u >= 1.0) & (u < shape[1] - 2) & (v >= 1.0) & (v < shape[0] - 2)
    assert np.array_equal(~np.isnan(offsets), seen)
    assert 200 < seen.sum() < n - 200
    grey, across, down = (
        map_coordinates(image.astype(np.float64), (v[seen], u[seen]), order=1)
        for image in (past, np.gradient(past, axis=1), np.gradient(past, axis=0))
    )
    expected = grey - 1.04 * values[seen] + 3.0
    np.testing.assert_allclose(offsets[seen], expected, atol=1e-3)
    motions = []
    for step in 1e-6 * np.eye(5)[:3]:
        ends = [seen_before(ground[seen], at + way * step, shape)[0] for way in (1.0, -1.0)]
        motions.append((ends[0] - ends[1]) / 2e-6)
    by_motion = [across * du + down * dv for du, dv in motions]
    np.testing.assert_allclose(slopes[:3, seen], by_motion, rtol=1e-3, atol=0.05)
    np.testing.assert_allclose(slopes[3, seen], -values[seen])
    assert (slopes[4, seen] == -1.0).all()
    slant = (by_motion[0] * at[0] + by_motion[1] * at[1]) * farness[seen]
    np.testing.assert_allclose(slopes[5, seen], slant, rtol=1e-3, atol=0.01)


def test_the_registration_converges_to_its_robust_normal_equations() -> None:
    floor, registration = PaintedFloor(), FloorRegistration(ROBOT)
    r, true = registration, Pose(0.08, 0.004, 0.1)
    past, now = (r.prepare(floor.view(pose)) for pose in (Pose(0.0, 0.0, 0.0), true))
    start, prior = np.array([0.082, 0.0035, 0.101, 0.0, 0.0]), np.diag([1e5, 1e6, 1e5, 400.0, 0.04])
    fixed = (past.grey, now.values, r._ground, r._farness, r._camera, r._base_from_camera)

    def linearised(at: Array) -> tuple[Array, Array, float]:
        """Residuals and slopes of the visible pixels at ``at``, and the residuals' deviation."""
        offsets, slopes = np.empty(now.values.size), np.zeros((6, now.values.size))
        _residuals(*fixed, at, offsets, slopes)
        seen = ~np.isnan(offsets)
        sigma = max(float(np.median(np.abs(offsets[seen]))) / 0.6745, 0.7)
        return offsets[seen], slopes[:, seen], sigma

    off, slopes, sigma = linearised(start)
    weighted = slopes[:5] / (sigma**2 + (off / 2.385) ** 2)
    step = np.linalg.solve(weighted @ slopes[:5].T + prior, -weighted @ off)
    assert register_floor(*fixed, start, prior, 0.7, 1)[0] == pytest.approx(start + step, rel=1e-6)
    at, information, pull, share, explained = register_floor(*fixed, start, prior, 0.7, 10)
    off, slopes, sigma = linearised(at)
    weights = np.exp(-((off / sigma / 2.985) ** 2)) / sigma**2
    expected = (slopes * weights) @ slopes.T
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    np.testing.assert_allclose(information / scale, expected / scale, atol=0.01)
    left = -(slopes[:5] * weights) @ off + prior @ (start - at)
    assert np.abs(np.linalg.solve(expected[:5, :5] + prior, left)).max() < 1e-2
    assert np.abs(np.linalg.solve(expected[:5, :5] + prior, left))[:3].max() < 4e-5
    assert pull == pytest.approx(-(slopes[5] * weights) @ off, abs=0.02 * math.sqrt(expected[5, 5]))
    assert share == pytest.approx((np.abs(off) < 3.0 * sigma).mean(), abs=0.01)
    texture = np.median(np.abs(now.values - np.median(now.values))) / 0.6745
    assert explained == pytest.approx(1.0 - (sigma / texture) ** 2, abs=0.005)


def test_a_change_of_light_is_no_motion() -> None:
    found = measured(PaintedFloor(), Pose(0.1, 0.0, 0.0), Pose(0.098, 0.0, 0.0), light=0.85)
    assert found is not None
    assert found.pose.x == pytest.approx(0.1, abs=5e-4)


def test_a_bare_floor_tells_nothing_of_the_way() -> None:
    bare = PaintedFloor(contrast=3e-4)
    found = measured(bare, Pose(0.1, 0.0, 0.0), Pose(0.12, 0.0, 0.0))
    assert found is None or found.covariance[0, 0] > 0.003**2


def observed(
    odometry: FloorOdometry,
    floor: PaintedFloor,
    leg: tuple[float, float, float],
    scale: float = 1.0,
    bias: float = 0.0,
) -> Iterator[tuple[Pose, Odometry]]:
    """The moments of a drive, after ``odometry`` has seen the floor at each: see ``arcs``."""
    for true, raw in arcs(ORIGIN, [leg], scale, bias):
        odometry.observe(Frame(raw.time, floor.view(true)), raw)
        yield true, raw


def test_wheels_and_gyro_are_calibrated_by_the_floor() -> None:
    odometry = FloorOdometry(ROBOT)
    *_, (true, raw) = observed(odometry, PaintedFloor(seed=3), (12.0, 0.4, 0.15), 1.01, 0.004)
    corrected = odometry.corrected(raw)
    error = math.dist((corrected.pose.x, corrected.pose.y), (true.x, true.y))
    assert error < 0.003 * 0.4 * 12.0 < math.dist((raw.pose.x, raw.pose.y), (true.x, true.y))
    share, bias = odometry.calibration
    assert share == pytest.approx(1.0 - 1.0 / 1.01, abs=0.002)
    assert bias == pytest.approx(0.004, abs=0.001)
    assert corrected.twist.w == pytest.approx(0.15, abs=0.001)
    assert corrected.by_floor


@pytest.mark.parametrize(
    ("camera", "wall"),
    [(ROBOT.camera, 1.3), (CameraModel(mount_height=0.66, hfov=1.065), 1.9)],
    ids=["low", "high"],
)
def test_a_wall_right_in_front_is_not_taken_for_floor(camera: CameraModel, wall: float) -> None:
    """In the end neither camera sees any floor: the high one from a distance of 1.5 m on."""
    floor = PaintedFloor(wall=wall, camera=camera)
    odometry = FloorOdometry(ROBOT.model_copy(update={"camera": camera}))
    *_, (true, raw) = observed(odometry, floor, (4.5, 0.2, 0.0))
    assert odometry.corrected(raw).pose.x == pytest.approx(true.x, abs=0.015)
    assert not odometry.slipping
    assert not odometry.corrected(raw).by_floor


def test_slipping_wheels_are_noticed_and_corrected() -> None:
    odometry, noticed = FloorOdometry(ROBOT), []
    driven = observed(odometry, PaintedFloor(seed=5), (5.0, 0.4, 0.0), scale=1.25)
    for true, raw in driven:  # noqa: B007 - the last ones
        noticed.append(odometry.slipping)
    assert any(noticed)
    assert odometry.corrected(raw).pose.x == pytest.approx(true.x, abs=0.06)
    assert raw.pose.x - true.x > 0.4


def test_a_turn_on_skidding_wheels_is_seen_to_move_the_robot_aside() -> None:
    """The turning point lies 6 cm before base_link: a turn by 2 rad moves that by 10 cm."""
    errors = []
    for skid in (0.0, 0.08):
        floor = PaintedFloor(seed=4)
        odometry = FloorOdometry(ROBOT.model_copy(update={"skid": skid}))
        for time, yaw in ((0.1 * k, 0.02 * k) for k in range(101)):
            true = Pose(0.06 * (1.0 - math.cos(yaw)), -0.06 * math.sin(yaw), yaw)
            raw = Odometry(time, Pose(0.0, 0.0, yaw), Twist(0.0, 0.2), 0.0, still=False)
            odometry.observe(Frame(time, floor.view(true)), raw)
        corrected = odometry.corrected(raw).pose
        errors.append(math.dist((corrected.x, corrected.y), (true.x, true.y)))
    assert errors[0] > 0.05, "without it the wheels are believed"
    assert errors[1] < 0.015


# --- the Kalman filter ---

STATE = np.array([0.05, 0.01, 0.2, 0.03, 0.005])
SHEET = ROBOT.odometry
GYRO = SHEET.gyro_noise**2 / ROBOT.control_rate
LAST = Odometry(1.0, Pose(1.0, 2.0, 0.3), Twist(0.3, 0.2), 0.01, still=False)
NOW = Odometry(1.1, LAST.pose.compose(Pose(0.03, 0.001, 0.02)), Twist(0.3, 0.2), 0.012, still=False)


def spread(seed: int) -> Array:
    """A covariance (5, 5)."""
    root = np.random.default_rng(seed).normal(size=(5, 5)) * (0.01, 0.005, 0.01, 0.01, 0.003)
    return np.asarray(root.T @ root)


def with_state(state: Array, covariance: Array) -> FloorOdometry:
    odometry = FloorOdometry(ROBOT.model_copy(update={"skid": 0.05}))
    odometry._state, odometry._covariance = state.copy(), covariance.copy()
    return odometry


def predicted(state: Array, covariance: Array, now: Odometry = NOW) -> tuple[Array, Array]:
    odometry = with_state(state, covariance)
    odometry._predict(LAST, now)
    return odometry._state, odometry._covariance


@pytest.mark.parametrize("silent", [False, True])
def test_the_prediction_is_that_of_wheels_and_gyro_with_their_errors(silent: bool) -> None:
    now, none = replace(NOW, silent=silent), np.zeros((5, 5))
    state, noise = predicted(STATE, none, now)
    turn = 0.02 + (0.012 - 0.005) * 0.1
    pose = Pose(*STATE[:3].tolist()).compose(Pose(0.97 * 0.03, 0.97 * 0.001, turn))
    assert state == pytest.approx([pose.x, pose.y, pose.yaw, 0.03, 0.005])
    covariance, small = spread(0), 1e-6 * np.eye(5)
    ends = [predicted(STATE + s, none)[0] - predicted(STATE - s, none)[0] for s in small]
    jacobian = np.stack(ends, axis=1) / 2e-6
    after = predicted(STATE, covariance, now)[1]
    assert after == pytest.approx(jacobian @ covariance @ jacobian.T + noise, abs=1e-10)
    moved = state[:2] - STATE[:2]
    way, aside = float(np.hypot(*moved)), np.array([-math.sin(0.2), math.cos(0.2)])
    along = SHEET.slip**2 * SHEET.slip_time * 0.3 * way + silent * (0.3 * way) ** 2
    expected = np.diag([1e-9, 1e-9, GYRO * 0.1 + 2e-5**2, 5e-4**2 * way, 0.0])
    expected[4, 4] = (1.5 * SHEET.gyro_bias_walk) ** 2 * 0.1
    expected[:2, :2] += along * np.outer(moved, moved) / way**2
    expected[:2, :2] += 0.05**2 * math.radians(8.0) * 0.02 * np.outer(aside, aside)
    np.testing.assert_allclose(noise, expected, rtol=1e-9, atol=1e-18)


def test_a_robot_at_rest_has_the_bias_of_the_odometer() -> None:
    still = replace(NOW, still=True)
    state, covariance = predicted(STATE, spread(1), still)
    assert state == pytest.approx([*STATE[:4], 0.012])
    assert not covariance[4, :4].any()
    assert covariance[4, 4] == pytest.approx(GYRO + SHEET.gyro_bias_walk**2)
    again, same = predicted(STATE, spread(1), replace(NOW, time=LAST.time))
    assert (again == STATE).all()
    assert (same == spread(1)).all()


@pytest.mark.parametrize("yaw", [2e-4, 0.05])
def test_yaw_by_the_flow_is_a_measurement_of_the_bias(yaw: float) -> None:
    """A correction of more than four standard deviations widens the bias before."""
    odometry, covariance = with_state(STATE, spread(2)), spread(2)
    motion = CameraMotion(np.eye(3), np.zeros(3), 0.2)
    odometry._raw = NOW
    odometry.correct(YawCorrection(yaw, 0.001, motion))
    row = np.array([0.0, 0.0, 0.0, 0.0, -0.2])
    variance = GYRO * 0.2 + (0.5 * 0.001) ** 2
    total = float(row @ covariance @ row) + variance
    if yaw**2 > 16.0 * total:
        covariance[4, 4] += (yaw**2 - 16.0 * total) / 0.2**2
    gain = covariance @ row / (row @ covariance @ row + variance)
    assert odometry._state == pytest.approx(STATE + gain * yaw)
    assert odometry._covariance == pytest.approx(covariance - np.outer(gain, row @ covariance))
    # a pair that shares time with the last one is left out, and one without any
    for dt in (0.15, 0.0):
        odometry._raw = replace(NOW, time=NOW.time + 0.1)
        before = odometry._state
        odometry.correct(YawCorrection(yaw, 0.001, replace(motion, dt=dt)))
        assert odometry._state is before


def test_registration_corrects_the_state_as_a_kalman_filter() -> None:
    odometry, covariance = with_state(STATE, spread(3)), spread(3)
    step = FloorStep(Pose(0.052, 0.008, 0.21), np.diag([2e-6, 3e-6, 4e-6]), 0.9, 0.9)
    total = covariance[:3, :3] + step.covariance
    off = np.array([0.002, -0.002, 0.01])
    assert odometry._distance(step) == pytest.approx(off @ np.linalg.solve(total, off))
    odometry._update(step)
    gain = covariance[:, :3] @ np.linalg.inv(total)
    assert odometry._state == pytest.approx(STATE + gain @ off)
    assert odometry._covariance == pytest.approx(covariance - gain @ covariance[:3, :], abs=1e-12)


def test_slip_a_stop_and_a_jump_of_the_bias_leave_these_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # so many jumps contradict the floor: here it is believed all the same
    monkeypatch.setattr("navfw.egomotion.floor_odometry._DOUBTED", 2.0)
    floor, odometry = PaintedFloor(seed=3), FloorOdometry(ROBOT)
    still = CameraMotion(np.eye(3), np.zeros(3), 0.2)
    for k, (true, ideal) in enumerate(arcs(ORIGIN, [(4.0, 0.4, 0.2)], scale=1.03, bias=0.01)):
        raw = replace(ideal, silent=k in (8, 9), still=k == 30, yaw_bias=0.001 * k)
        odometry.observe(Frame(raw.time, floor.view(true)), raw)
        if k % 5 == 4:
            odometry.correct(YawCorrection(0.002 if k == 24 else 2e-4, 1e-3, still))
    state = [0.040064, 0.00041453, 0.021863, 0.011417, 0.030024]
    sigmas = [2.7326e-4, 3.1646e-5, 7.8062e-5, 9.8628e-3, 2.6866e-4]
    assert odometry._state == pytest.approx(state, rel=1e-3)
    assert np.sqrt(odometry._covariance.diagonal()) == pytest.approx(sigmas, rel=1e-3)
    found = odometry.corrected(raw)
    pose, twist = (1.36960, 0.57281, 0.80253), (0.40730, 0.21898)
    assert astuple(found.pose) == pytest.approx(pose, abs=1e-4)
    assert astuple(found.twist) == pytest.approx(twist, abs=1e-4)


def test_a_reset_forgets_all() -> None:
    odometry = FloorOdometry(ROBOT)
    raw = Odometry(1.0, Pose(1.0, 0.0, 0.3), Twist(0.1, 0.0), 0.02, still=False)
    bare: Array = np.full((ROBOT.camera.height, ROBOT.camera.width), 128.0)
    odometry.observe(Frame(1.0, bare.astype(np.uint8)), raw)
    odometry.reset()
    assert odometry.corrected(raw) is raw
    assert odometry.calibration == (0.0, 0.0)
