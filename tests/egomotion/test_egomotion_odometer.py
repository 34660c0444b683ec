"""The odometer: pose and twist from encoders and gyro, and the gyro's bias."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.egomotion import Odometer
from navfw.robot import RobotModel
from navfw.signals import Encoders, Inertial, Odometry, Twist

ROBOT = RobotModel(ticks_per_turn=2048)
DT = 1.0 / 60.0


class Drive:
    """A robot that turns its wheels exactly, with a gyro of a given bias and noise."""

    def __init__(self, bias: float = 0.0, noise: float = 0.0, robot: RobotModel = ROBOT) -> None:
        self.robot, self.odometer = robot, Odometer(robot)
        self.bias, self.noise = bias, noise
        self.rng = np.random.default_rng(0)
        self.time, self.wheels = 0.0, np.zeros(2)
        self.odometry = self.odometer.update(*self.readings(0.0))

    def readings(self, yaw_rate: float) -> tuple[Inertial, Encoders]:
        rate = yaw_rate + self.bias + self.rng.normal(0.0, self.noise)
        ticks = np.floor(self.wheels / (2 * math.pi) * self.robot.ticks_per_turn).astype(int)
        left, right = int(ticks[0]), int(ticks[1])
        return Inertial(self.time, 0.0, 0.0, rate), Encoders(self.time, left, right)

    def go(self, v: float, w: float, seconds: float) -> Odometry:
        for _ in range(round(seconds / DT)):
            self.time += DT
            self.wheels += np.array(self.robot.wheel_speeds(Twist(v, w))) * DT
            self.odometry = self.odometer.update(*self.readings(w))
        return self.odometry


@given(v=st.floats(-0.4, 0.5), w=st.floats(-1.5, 1.5))
def test_arcs_end_where_geometry_says(v: float, w: float) -> None:
    drive = Drive()
    pose = drive.go(v, w, 3.0).pose
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
    drive.go(0.3, 0.4, 0.5)
    speeds = [drive.go(0.3, 0.4, DT).twist for _ in range(60)]
    assert np.mean([s.v for s in speeds]) == pytest.approx(0.3, abs=0.002)
    assert np.std([s.v for s in speeds]) < 0.004
    assert speeds[-1].w == pytest.approx(0.4)


def test_bias_is_learnt_at_standstill_and_the_heading_does_not_drift() -> None:
    drive = Drive(bias=0.03, noise=0.005)
    standing = drive.go(0.0, 0.0, 2.0)
    assert standing.still
    assert standing.twist == Twist(0.0, 0.0)
    assert standing.yaw_bias == pytest.approx(0.03, abs=0.002)
    assert standing.pose.yaw == 0.0
    driven = drive.go(0.3, 0.0, 10.0)
    assert not driven.still
    assert abs(driven.pose.yaw) < 0.02
    assert driven.twist.w == pytest.approx(0.0, abs=0.02)


def test_bias_is_not_learnt_while_moving_or_just_stopped() -> None:
    drive = Drive(bias=0.02)
    drive.go(0.2, 0.5, 1.0)
    before = drive.odometry.yaw_bias
    assert not drive.go(0.0, 0.0, 0.25).still
    assert drive.odometry.yaw_bias == before
    assert drive.go(0.0, 0.0, 0.2).still
    drive.bias = 0.06
    drive.go(0.0, 0.0, 20.0)
    assert drive.odometry.yaw_bias == pytest.approx(0.06, abs=0.01)


def test_slow_driving_is_no_standstill() -> None:
    drive = Drive(bias=0.01)
    assert not drive.go(0.005, 0.0, 2.0).still


def test_an_external_turn_at_standstill_is_not_learnt_as_bias() -> None:
    drive = Drive(bias=0.01)
    drive.go(0.0, 0.0, 1.0)
    for _ in range(60):
        drive.time += DT
        drive.odometry = drive.odometer.update(*drive.readings(1.0))
    assert drive.odometry.yaw_bias == pytest.approx(0.01, abs=1e-6)
    assert drive.odometry.pose.yaw == pytest.approx(1.0, abs=0.01)
    assert drive.odometry.twist.w == pytest.approx(1.0, abs=1e-6)


def test_missing_gyro_readings_are_replaced_by_the_wheels() -> None:
    drive = Drive()
    drive.go(0.2, 0.5, 1.0)
    drive.bias = math.nan
    pose = drive.go(0.2, 0.5, 1.0).pose
    assert pose.yaw == pytest.approx(1.0, abs=0.01)


def test_the_same_reading_twice_changes_nothing() -> None:
    drive = Drive(bias=0.01)
    drive.go(0.3, 0.3, 0.7)
    again = drive.odometer.update(*drive.readings(0.3))
    assert again == drive.odometry


def test_reset_starts_at_the_origin() -> None:
    drive = Drive(bias=0.02)
    drive.go(0.3, 0.3, 1.0)
    drive.odometer.reset()
    odometry = drive.odometer.update(*drive.readings(0.0))
    assert (odometry.pose.x, odometry.pose.y, odometry.pose.yaw) == (0.0, 0.0, 0.0)
    assert odometry.yaw_bias == 0.0
