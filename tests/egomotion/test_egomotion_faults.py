"""Odometry with a failed encoder, a stale gyro, a bias that changes while driving."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from flow_scene import exact_field
from hypothesis import given
from hypothesis import strategies as st

from navfw.egomotion import EncoderFaultDetector, Odometer, OdometryHistory, with_yaw_sigma
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Encoders, Inertial, Odometry, Pose, Twist, YawCorrection

ROBOT = RobotModel()
DT = 1.0 / 60.0


class Drive:
    """A robot that executes its command exactly; its sensors can fail."""

    def __init__(self) -> None:
        self.odometer = Odometer(ROBOT)
        self.time, self.yaw = 0.0, 0.0
        self.wheels = np.zeros(2)
        self.counted = np.zeros(2)
        self.inertial = Inertial(0.0, 0.0, 0.0, 0.0)
        self.odometry = self.odometer.update(self.inertial, Encoders(0.0, 0, 0))

    def go(
        self,
        seconds: float,
        v: float,
        w: float = 0.0,
        *,
        dead: str = "",
        gyro: bool = True,
        bias: float = 0.0,
    ) -> Odometry:
        for _ in range(round(seconds / DT)):
            self.time += DT
            step = np.array(ROBOT.wheel_speeds(Twist(v, w))) * DT
            self.counted += step * [dead not in ("left", "both"), dead not in ("right", "both")]
            ticks = np.floor(self.counted / (2 * math.pi) * ROBOT.ticks_per_turn).astype(int)
            if gyro:
                self.inertial = Inertial(self.time, 0.0, 0.0, w + bias)
            encoders = Encoders(self.time, int(ticks[0]), int(ticks[1]))
            self.odometry = self.odometer.update(self.inertial, encoders, Twist(v, w))
        return self.odometry


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


def test_one_wheel_without_gyro_is_not_enough() -> None:
    drive = Drive()
    drive.go(1.0, 0.4, dead="left", gyro=False)
    assert drive.odometry.silent


def test_the_encoder_of_a_wheel_at_rest_is_not_silent() -> None:
    drive = Drive()
    assert not drive.go(3.0, 0.0, dead="both").silent
    assert drive.odometry.still


def test_a_stale_gyro_is_replaced_by_the_wheels() -> None:
    drive = Drive()
    drive.go(1.0, 0.3, 0.0)
    drive.go(2.0, 0.3, 0.5, gyro=False)
    # a gyro reading is stale after one tenth of a second
    assert drive.odometry.pose.yaw == pytest.approx(1.0, abs=0.06)


def test_sensors_that_fail_one_after_the_other_leave_these_numbers() -> None:
    drive = Drive()
    for seconds, v, w, dead, gyro, bias, expected in (
        (0.5, 0.0, 0.0, "", True, 0.02, (0.0, 0.0, 0.0, 0.0, 0.02)),
        (0.4, 0.3, 0.5, "", True, 0.02, (0.1190830, 0.0119555, 0.2, 0.2994487, 0.02)),
        (0.5, 0.2, 0.3, "left", True, 0.05, (0.1996201, 0.0360752, 0.365, 0.1950612, 0.02)),
        (0.4, 0.2, -0.3, "", False, 0, (0.274458, 0.064263, 0.308191, 0.199382, 0.019612)),
        (0.4, 0.2, -0.3, "right", False, 0, (0.339065, 0.07436, 0.084924, 0.198578, 0.019612)),
        (0.5, -0.1, 0.8, "both", True, 0.03, (0.319618, 0.064218, 0.490118, -0.099857, 0.019612)),
        (0.8, 0.0, 0.0, "", True, 0.2, (0.319618, 0.064218, 0.634802, 0.0, 0.019144)),
    ):
        drive.odometer.correct(YawCorrection(0.002, 0.0, motion(w)))
        found = drive.go(seconds, v, w, dead=dead, gyro=gyro, bias=bias)
        numbers = (*dataclasses.astuple(found.pose), found.twist.v, found.yaw_bias)
        assert numbers == pytest.approx(expected, abs=1e-6)


def motion(w: float, dt: float = 0.2) -> CameraMotion:
    turn = w * dt
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return CameraMotion(rotation, np.array([0.0, 0.0, 0.08]), dt)


def test_a_bias_with_a_lasting_gyro_residual_is_corrected_while_driving() -> None:
    drive = Drive()
    bias = math.radians(1.0)
    drive.go(1.0, 0.0)
    for _ in range(100):
        drive.go(0.1, 0.4, bias=bias)
        left = bias - drive.odometry.yaw_bias
        drive.odometer.correct(YawCorrection(-0.5 * left * 0.2, 0.0, motion(0.0)))
    assert drive.odometry.yaw_bias == pytest.approx(bias, abs=0.003)
    assert abs(drive.odometry.pose.yaw) < 4.0 * bias


def test_a_small_gyro_residual_changes_nothing() -> None:
    drive = Drive()
    for _ in range(100):
        drive.go(0.1, 0.4, bias=0.002)
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
        assert not detector.doubtful


def test_the_history_gives_the_odometry_of_late_frames() -> None:
    history = OdometryHistory()
    with pytest.raises(IndexError):
        history.at(0.0)
    for tick in range(600):
        time = tick / 60.0
        history.add(Odometry(time, Pose(time, 0.0, 0.0), Twist(1.0, 0.0), 0.0, still=False))
    assert history.at(599 / 60.0).pose.x == 599 / 60.0
    assert history.at(9.5).pose.x == pytest.approx(9.5, abs=1e-9)
    assert history.at(9.51).pose.x == pytest.approx(9.5, abs=1e-9)
    assert history.at(0.0).pose.x == pytest.approx(599 / 60.0 - 3.0, abs=0.02)
