"""Wheel trim: weak wheels are driven faster, sound and blocked ones as commanded."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.locom.trim import WheelTrim
from navfw.robot import RobotModel
from navfw.signals import Encoders, Twist

ROBOT = RobotModel()
DT = 1.0 / 60.0


class Drive:
    """Wheels that reach a share of the speed they are commanded."""

    def __init__(self, left: float = 1.0, right: float = 1.0) -> None:
        self.trim = WheelTrim(ROBOT)
        self.shares = (left, right)
        self.turned = [0.0, 0.0]
        self.tick = 0

    def go(self, seconds: float, wanted: Twist) -> Twist:
        """Drive ``wanted``; the twist of the robot at the end."""
        commanded = Twist(0.0, 0.0)
        for _ in range(round(seconds / DT)):
            ticks = [math.floor(a / (2 * math.pi) * ROBOT.ticks_per_turn) for a in self.turned]
            self.trim.update(Encoders(self.tick * DT, ticks[0], ticks[1]))
            commanded = self.trim.apply(wanted)
            speeds = ROBOT.wheel_speeds(commanded)
            self.turned = [
                angle + speed * share * DT
                for angle, speed, share in zip(self.turned, speeds, self.shares, strict=True)
            ]
            self.tick += 1
        left, right = ROBOT.wheel_speeds(commanded)
        return ROBOT.twist(left * self.shares[0], right * self.shares[1])


@pytest.mark.parametrize("shares", [(0.8, 1.0), (1.0, 0.7), (0.8, 0.6)])
def test_weak_wheels_reach_the_wanted_twist(shares: tuple[float, float]) -> None:
    drive = Drive(*shares)
    done = drive.go(5.0, Twist(0.4, 0.2))
    assert (done.v, done.w) == pytest.approx((0.4, 0.2), abs=0.02)
    assert drive.trim.shares == pytest.approx(shares, abs=0.02)


@given(
    left=st.floats(0.93, 1.05),
    right=st.floats(0.93, 1.05),
    v=st.floats(-0.15, 0.5),
    w=st.floats(-1.5, 1.5),
)
def test_sound_wheels_get_the_wanted_twist(left: float, right: float, v: float, w: float) -> None:
    drive = Drive(left, right)
    wanted = Twist(v, w)
    for _ in range(120):
        drive.go(DT, wanted)
        assert drive.trim.apply(wanted) == wanted


def test_dead_or_blocked_wheels_are_not_driven_harder() -> None:
    drive = Drive()
    drive.go(1.0, Twist(0.3, 0.0))
    drive.shares = (0.0, 1.0)
    drive.go(3.0, Twist(0.3, 0.0))
    commanded = drive.trim.apply(Twist(0.3, 0.0))
    assert commanded.v < 0.3 / 0.4
    drive.trim.reset()
    assert drive.trim.shares == (1.0, 1.0)


def test_weak_wheels_stand_at_a_twist_of_zero() -> None:
    drive = Drive(0.7, 1.0)
    drive.go(4.0, Twist(0.4, 0.0))
    assert drive.trim.apply(Twist(0.0, 0.0)) == Twist(0.0, 0.0)
