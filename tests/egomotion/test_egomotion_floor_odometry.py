"""Odometry corrected by the floor: registration in metres, calibration of wheels and gyro, slip."""

import math
from collections.abc import Iterator
from dataclasses import astuple, replace

import numpy as np
import pytest
from painted_floor import KNOWN, ORIGIN, ROBOT, PaintedFloor
from plan_samples import arcs

from navfw.egomotion.floor_odometry import FloorOdometry
from navfw.egomotion.floor_registration import FloorRegistration, FloorStep
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
