"""LOCOM keeps the limits of the drive for every command."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.locom.unicycle import Unicycle
from navfw.robot import RobotModel
from navfw.signals import Command, Odometry, Pose, Twist

ROBOT = RobotModel()
DT = 1.0 / ROBOT.control_rate
ANY = st.floats(allow_nan=True, allow_infinity=True, width=32)


def odometry(time: float) -> Odometry:
    return Odometry(time, Pose(0, 0, 0), Twist(0, 0), 0.0, still=False)


def command(time: float, v: float, w: float, emergency: bool = False) -> Command:
    return Command(time, Twist(v, w), "test", "test", emergency)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(ANY, ANY, st.booleans()), min_size=1, max_size=30))
def test_limits_hold_for_any_commands(commands: list[tuple[float, float, bool]]) -> None:
    locom = Unicycle(ROBOT)
    before = Twist(0.0, 0.0)
    for k, (v, w, emergency) in enumerate(commands):
        time = k * DT
        now = locom.control(command(time, v, w, emergency), odometry(time), DT)
        assert math.isfinite(now.v) and math.isfinite(now.w)
        assert -ROBOT.max_reverse <= now.v <= ROBOT.max_v
        assert abs(now.w) <= ROBOT.max_w
        assert abs(now.v - before.v) <= ROBOT.max_brake * DT + 1e-9
        assert abs(now.w - before.w) <= ROBOT.max_turn_accel * DT + 1e-9
        if abs(now.v) > abs(before.v):
            assert abs(now.v) - abs(before.v) <= ROBOT.max_accel * DT + 1e-9
        before = now


def test_reaches_the_command_and_holds_it() -> None:
    locom = Unicycle(ROBOT)
    for k in range(120):
        twist = locom.control(command(k * DT, 0.3, 0.5), odometry(k * DT), DT)
    assert twist == Twist(0.3, 0.5)


def test_a_stale_command_brakes_to_a_standstill() -> None:
    locom = Unicycle(ROBOT)
    for k in range(60):
        locom.control(command(k * DT, 0.3, 0.0), odometry(k * DT), DT)
    for k in range(60, 240):
        twist = locom.control(command(59 * DT, 0.3, 0.0), odometry(k * DT), DT)
    assert twist == Twist(0.0, 0.0)


def test_speed_in_curves_keeps_the_lateral_acceleration() -> None:
    locom = Unicycle(ROBOT)
    for k in range(240):
        twist = locom.control(command(k * DT, ROBOT.max_v, ROBOT.max_w), odometry(k * DT), DT)
    assert twist.v * abs(twist.w) <= ROBOT.max_lateral + 1e-9
