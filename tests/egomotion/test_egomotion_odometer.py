"""The odometer: pose and twist from encoders and gyro, the gyro's bias, and failed sensors."""

import math

import numpy as np
import pytest
from flow_scene import exact_field, turn_about
from hypothesis import given
from hypothesis import strategies as st
from localization_drives import odometry

from navfw.egomotion import Odometer
from navfw.egomotion.odometer import EncoderFaultDetector, OdometryHistory
from navfw.egomotion.pairing import with_yaw_sigma
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Encoders, Inertial, Odometry, Pose, Twist, YawCorrection

ROBOT = RobotModel()
DT = 1.0 / 60.0


class Drive:
    """A robot that executes its command exactly, with a gyro of a given bias and noise.

    Its sensors can fail: ``dead`` encoders no longer count, without ``gyro`` its reading is old.
    """

    def __init__(self, robot: RobotModel = ROBOT, bias: float = 0.0, noise: float = 0.0) -> None:
        self.robot, self.odometer = robot, Odometer(robot)
        self.bias, self.noise, self.told = bias, noise, True
        self.rng = np.random.default_rng(0)
        self.time, self.counted = 0.0, np.zeros(2)
        self.inertial, encoders = self.readings(0.0)
        self.odometry = self.odometer.update(self.inertial, encoders)

    def readings(self, yaw_rate: float) -> tuple[Inertial, Encoders]:
        rate = yaw_rate + self.bias + self.rng.normal(0.0, self.noise)
        ticks = np.floor(self.counted / (2 * math.pi) * self.robot.ticks_per_turn).astype(int)
        left, right = int(ticks[0]), int(ticks[1])
        return Inertial(self.time, 0.0, 0.0, rate), Encoders(self.time, left, right)

    def go(
        self, seconds: float, v: float, w: float = 0.0, *, dead: str = "", gyro: bool = True
    ) -> Odometry:
        counting = [dead not in ("left", "both"), dead not in ("right", "both")]
        for _ in range(round(seconds / DT)):
            self.time += DT
            self.counted += np.array(self.robot.wheel_speeds(Twist(v, w))) * DT * counting
            inertial, encoders = self.readings(w)
            self.inertial = inertial if gyro else self.inertial
            command = Twist(v, w) if self.told else None
            self.odometry = self.odometer.update(self.inertial, encoders, command)
        return self.odometry


@given(v=st.floats(-0.4, 0.5), w=st.floats(-1.5, 1.5))
def test_arcs_end_where_geometry_says(v: float, w: float) -> None:
    pose = Drive().go(3.0, v, w).pose
    if abs(v) < 0.02:
        return
    turn = 3.0 * w
    if abs(w) > 1e-6:
        expected = (v / w * math.sin(turn), v / w * (1.0 - math.cos(turn)))
    else:
        expected = (3.0 * v, 0.0)
    assert (pose.x, pose.y) == pytest.approx(expected, abs=2e-3)
    assert math.remainder(pose.yaw - turn, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)


def test_measured_twist_is_smooth_and_right() -> None:
    drive = Drive()
    drive.go(0.5, 0.3, 0.4)
    speeds = [drive.go(DT, 0.3, 0.4).twist for _ in range(60)]
    assert np.mean([s.v for s in speeds]) == pytest.approx(0.3, abs=0.002)
    assert np.std([s.v for s in speeds]) < 0.004
    assert speeds[-1].w == pytest.approx(0.4)
    # a step of the speed shows with a time constant of 0.05 s
    assert Drive().go(0.05, 0.4).twist.v == pytest.approx(0.4 * (1.0 - math.exp(-1.0)), abs=0.015)


def test_bias_is_learnt_at_standstill_and_the_heading_does_not_drift() -> None:
    drive = Drive(bias=0.03, noise=0.005)
    standing = drive.go(2.0, 0.0, 0.0)
    assert standing.still
    assert standing.twist == Twist(0.0, 0.0)
    assert standing.yaw_bias == pytest.approx(0.03, abs=0.002)
    assert standing.pose.yaw == 0.0
    driven = drive.go(10.0, 0.3, 0.0)
    assert not driven.still
    assert abs(driven.pose.yaw) < 0.02
    assert driven.twist.w == pytest.approx(0.0, abs=0.02)


def test_bias_is_not_learnt_while_moving_or_just_stopped() -> None:
    drive = Drive(bias=0.02)
    drive.go(1.0, 0.2, 0.5)
    before = drive.odometry.yaw_bias
    assert not drive.go(0.25, 0.0, 0.0).still
    assert drive.odometry.yaw_bias == before
    assert drive.go(0.2, 0.0, 0.0).still
    drive.bias = 0.06
    drive.go(20.0, 0.0, 0.0)
    assert drive.odometry.yaw_bias == pytest.approx(0.06, abs=0.01)


def test_slow_driving_is_no_standstill() -> None:
    assert not Drive(bias=0.01).go(2.0, 0.005, 0.0).still


@pytest.mark.parametrize("told", [True, False])
def test_the_begin_of_a_turn_is_not_learnt_as_bias(told: bool) -> None:
    drive = Drive(bias=0.01)
    drive.told = told
    drive.go(0.8, 0.0)
    drive.go(0.1, 0.0, 0.02)  # no encoder has counted yet
    assert drive.go(0.5, 0.0, 0.5).yaw_bias == pytest.approx(0.01, abs=1e-9)


def test_an_external_turn_at_standstill_is_not_learnt_as_bias() -> None:
    drive = Drive(bias=0.01)
    drive.go(1.0, 0.0, 0.0)
    for _ in range(60):
        drive.time += DT
        drive.odometry = drive.odometer.update(*drive.readings(1.0))
    assert drive.odometry.yaw_bias == pytest.approx(0.01, abs=1e-6)
    assert drive.odometry.pose.yaw == pytest.approx(1.0, abs=0.01)
    assert drive.odometry.twist.w == pytest.approx(1.0, abs=1e-6)


def test_the_same_reading_twice_changes_nothing() -> None:
    drive = Drive(bias=0.01)
    drive.go(0.7, 0.3, 0.3)
    again = drive.odometer.update(*drive.readings(0.3))
    assert again == drive.odometry


def test_reset_starts_at_the_origin() -> None:
    drive = Drive(bias=0.02)
    drive.go(1.0, 0.3, 0.3)
    drive.odometer.reset()
    odometry = drive.odometer.update(*drive.readings(0.0))
    assert (odometry.pose.x, odometry.pose.y, odometry.pose.yaw) == (0.0, 0.0, 0.0)
    assert odometry.yaw_bias == 0.0


# --- failed sensors, and a bias that changes while driving ---


@pytest.mark.parametrize("dead", ["left", "right"])
@given(v=st.floats(0.15, 0.5), w=st.floats(-0.6, 0.6))
def test_one_encoder_and_the_gyro_give_the_pose(dead: str, v: float, w: float) -> None:
    whole, half = Drive(), Drive()
    whole.go(2.0, v, w)
    half.go(2.0, v, w, dead=dead)
    off = whole.odometry.pose.relative(half.odometry.pose)
    # the distance driven before the fault is detected is lost
    assert math.hypot(off.x, off.y) < 0.04
    assert abs(off.yaw) < 1e-6
    assert not half.odometry.silent
    assert half.odometry.twist.v == pytest.approx(v, abs=0.02)


def test_silent_encoders_are_no_standstill() -> None:
    drive = Drive()
    drive.go(0.2, 0.4, dead="both")
    assert drive.odometry.silent
    drive.go(0.8, 0.4, dead="both")
    assert not drive.odometry.still
    assert drive.odometry.pose.x == pytest.approx(0.4, abs=0.04)
    # a slow turn is not learnt as bias
    drive.go(2.0, 0.0, 0.1, dead="both")
    assert drive.odometry.yaw_bias == 0.0
    assert not drive.go(0.1, 0.2).silent


def test_without_encoders_the_robot_counts_as_driven_as_commanded_unless_very_slow() -> None:
    drive = Drive()
    drive.go(1.0, 0.4, dead="both")
    before = drive.odometry.pose.x
    assert drive.go(1.0, 0.25, dead="both").pose.x - before == pytest.approx(0.25, abs=1e-6)
    slow = Drive()
    assert not slow.go(5.0, 0.029, dead="both").silent  # the rim's speed is too low to judge
    assert slow.go(5.0, 0.031, dead="both").silent


def test_one_wheel_without_gyro_is_not_enough() -> None:
    assert Drive().go(1.0, 0.4, dead="left", gyro=False).silent


def test_the_encoder_of_a_wheel_at_rest_is_not_silent() -> None:
    rest = Drive().go(3.0, 0.0, dead="both")
    assert (rest.silent, rest.still) == (False, True)


@pytest.mark.parametrize(
    ("missing", "off"),
    [
        (math.nan, 0.01),
        (0.0, 0.06),  # a gyro reading is stale after one tenth of a second
    ],
    ids=["not a number", "old"],
)
def test_missing_gyro_readings_are_replaced_by_the_wheels(missing: float, off: float) -> None:
    drive = Drive()
    drive.go(1.0, 0.3, 0.0)
    drive.bias = missing
    drive.go(2.0, 0.3, 0.5, gyro=math.isnan(missing))
    assert drive.odometry.pose.yaw == pytest.approx(1.0, abs=off)


def motion(w: float, dt: float = 0.2) -> CameraMotion:
    return CameraMotion(turn_about(1, w * dt), np.array([0.0, 0.0, 0.08]), dt)


def test_a_bias_with_a_lasting_gyro_residual_is_corrected_while_driving() -> None:
    drive, bias = Drive(), math.radians(1.0)
    drive.go(1.0, 0.0)
    drive.bias = bias
    for _ in range(100):
        drive.go(0.1, 0.4)
        left = bias - drive.odometry.yaw_bias
        drive.odometer.correct(YawCorrection(-0.5 * left * 0.2, 0.0, motion(0.0)))
    assert drive.odometry.yaw_bias == pytest.approx(bias, abs=0.003)
    assert abs(drive.odometry.pose.yaw) < 4.0 * bias


def test_a_small_gyro_residual_changes_nothing() -> None:
    drive = Drive(bias=0.002)
    for _ in range(100):
        drive.go(0.1, 0.4)
        drive.odometer.correct(YawCorrection(-0.002 * 0.2, 0.0, motion(0.0)))
    assert drive.odometry.yaw_bias == 0.0


def test_a_gyro_residual_in_proportion_to_the_turning_rate_is_no_bias() -> None:
    drive = Drive()
    for tick in range(200):
        w = 0.3 * math.sin(0.15 * tick)
        drive.go(0.1, 0.4, w)
        drive.odometer.correct(YawCorrection(0.05 * w * 0.2, 0.0, motion(w)))
    assert abs(drive.odometry.yaw_bias) < 0.002


def test_without_gyro_yaw_is_less_certain_and_the_flow_corrects_unequal_wheels() -> None:
    drive, field = Drive(), exact_field(ROBOT.camera, motion(0.0), np.ones((12, 16)))
    drive.go(1.0, 0.4)
    assert with_yaw_sigma(field, drive.odometry).motion.yaw_sigma == 0.0
    skew = 0.04
    for _ in range(100):
        before = drive.odometry.pose.yaw
        drive.go(0.1, 0.4, gyro=False)
        measured = (drive.odometry.pose.yaw - before) / 0.04
        yaw = 0.5 * (skew - measured) * 0.08
        drive.odometer.correct(YawCorrection(yaw, 0.0, motion(0.0)))
    assert with_yaw_sigma(field, drive.odometry).motion.yaw_sigma == pytest.approx(0.1 * 0.08)
    before = drive.odometry.pose.yaw
    drive.go(1.0, 0.4, gyro=False)
    assert drive.odometry.pose.yaw - before == pytest.approx(0.4 * skew, rel=0.2)


@given(st.lists(st.tuples(st.integers(1, 50), st.floats(-0.5, 0.5)), min_size=1, max_size=60))
def test_an_encoder_that_counts_is_never_silent(steps: list[tuple[int, float]]) -> None:
    detector, count = EncoderFaultDetector(ROBOT), 0
    for tick, (ticks, v) in enumerate(steps):
        count += ticks
        detector.update(Encoders(tick * DT, count, count), Twist(v, 0.0))
        assert detector.silent == (False, False)


def test_the_history_gives_the_odometry_of_late_frames() -> None:
    history = OdometryHistory()
    with pytest.raises(IndexError):
        history.at(0.0)
    for tick in range(600):
        history.add(odometry(Pose(tick / 60.0, 0.0, 0.0), tick / 60.0, 1.0))
    assert history.at(599 / 60.0).pose.x == 599 / 60.0
    assert history.at(9.5).pose.x == pytest.approx(9.5, abs=1e-9)
    assert history.at(9.51).pose.x == pytest.approx(9.5, abs=1e-9)
    assert history.at(0.0).pose.x == pytest.approx(599 / 60.0 - 3.0, abs=0.02)
