"""LOCOM keeps the limits of the drive for every command."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from param_ranges import check_ranges

from navfw.locom import Unicycle
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


def settled(v: float, w: float) -> Unicycle:
    """A controller that has reached the twist (v, w)."""
    locom = Unicycle(ROBOT)
    for k in range(120):
        locom.control(command(k * DT, v, w), odometry(k * DT), DT)
    return locom


@pytest.mark.parametrize(
    ("before", "wanted", "change"),
    [
        (0.0, 0.4, ROBOT.max_accel),
        (0.2, 0.4, ROBOT.max_accel),
        (0.0, -0.1, -ROBOT.max_accel),
        (-0.05, -0.1, -ROBOT.max_accel),
        (0.4, 0.2, -ROBOT.max_brake),
        (0.4, 0.0, -ROBOT.max_brake),
        (-0.1, 0.0, ROBOT.max_brake),
        (0.4, -0.1, -ROBOT.max_brake),
        (-0.1, 0.4, ROBOT.max_brake),
    ],
)
def test_speeding_up_is_gentler_than_slowing_down(
    before: float, wanted: float, change: float
) -> None:
    twist = settled(before, 0.0).control(command(9.0, wanted, 0.0), odometry(9.0), DT)
    assert twist.v == pytest.approx(before + change * DT)


@pytest.mark.parametrize(
    ("before", "wanted", "reached"), [(0.001, -0.1, 0.0), (-0.001, 0.4, 0.0), (0.3, 0.299, 0.299)]
)
def test_the_other_direction_begins_at_standstill_and_slowing_down_ends_at_the_command(
    before: float, wanted: float, reached: float
) -> None:
    twist = settled(before, 0.0).control(command(9.0, wanted, 0.0), odometry(9.0), DT)
    assert twist.v == pytest.approx(reached, abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turning_rates_change_by_the_largest_angular_acceleration(sign: float) -> None:
    locom = Unicycle(ROBOT)
    first = locom.control(command(0.0, 0.0, sign * 1.0), odometry(0.0), DT)
    assert first.w == pytest.approx(sign * ROBOT.max_turn_accel * DT)
    back = settled(0.0, sign * 1.0).control(command(9.0, 0.0, 0.0), odometry(9.0), DT)
    assert back.w == pytest.approx(sign * (1.0 - ROBOT.max_turn_accel * DT))


@pytest.mark.parametrize(
    ("wanted", "reached"),
    [
        (Twist(9.0, 0.0), Twist(ROBOT.max_v, 0.0)),
        (Twist(-9.0, 0.0), Twist(-ROBOT.max_reverse, 0.0)),
        (Twist(0.0, 9.0), Twist(0.0, ROBOT.max_w)),
        (Twist(0.0, -9.0), Twist(0.0, -ROBOT.max_w)),
        (Twist(9.0, 1.5), Twist(ROBOT.max_lateral / 1.5, 1.5)),
        (Twist(9.0, -1.5), Twist(ROBOT.max_lateral / 1.5, -1.5)),
        (Twist(9.0, 0.5), Twist(ROBOT.max_v, 0.5)),
        (Twist(math.nan, 1.0), Twist(0.0, 0.0)),
        (Twist(0.3, math.inf), Twist(0.0, 0.0)),
    ],
)
def test_the_twist_reached_is_the_nearest_within_the_limits(wanted: Twist, reached: Twist) -> None:
    locom = settled(wanted.v, wanted.w)
    twist = locom.control(command(2.0, wanted.v, wanted.w), odometry(2.0), DT)
    assert (twist.v, twist.w) == pytest.approx((reached.v, reached.w))


@pytest.mark.parametrize(("age", "v"), [(0.5, 0.3), (0.51, 0.3 - ROBOT.max_brake * DT)])
def test_commands_are_void_from_the_age_of_the_parameter(age: float, v: float) -> None:
    locom = settled(0.3, 0.0)
    twist = locom.control(command(9.0, 0.3, 0.0), odometry(9.0 + age), DT)
    assert twist.v == pytest.approx(v)
    assert locom.control(None, odometry(9.0), DT).v < 0.3
    for k in range(120):
        twist = locom.control(command(9.0, 0.3, 0.0), odometry(10.0 + k * DT), DT)
    assert twist == Twist(0.0, 0.0)


def test_in_an_emergency_the_robot_brakes_turns_and_may_reverse() -> None:
    locom = settled(0.3, 0.0)
    twist = locom.control(command(9.0, 0.3, 1.0, emergency=True), odometry(9.0), DT)
    assert twist.v == pytest.approx(0.3 - ROBOT.max_brake * DT)
    assert twist.w > 0.0
    locom = settled(-0.1, 0.0)
    assert locom.control(command(9.0, -0.1, 0.0, emergency=True), odometry(9.0), DT).v == -0.1


def test_reset_is_standstill() -> None:
    locom = settled(0.3, 0.5)
    locom.reset()
    assert locom.control(None, odometry(9.0), DT) == Twist(0.0, 0.0)


def test_parameters_are_within_their_ranges() -> None:
    check_ranges(Unicycle.Params, {"stale": "(0, 5]"})
