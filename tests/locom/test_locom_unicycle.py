"""LOCOM keeps the limits of the drive for every command, and trims weak wheels."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.locom.unicycle import Unicycle, WheelTrim
from navfw.robot import RobotModel
from navfw.signals import Command, Encoders, Odometry, Pose, Twist

MIN_DISTANCE = 0.06
MIN_SHARE = 0.4
TIME_CONSTANT = 0.5
WINDOW = 0.6

ROBOT = RobotModel()
DT = 1.0 / ROBOT.control_rate
ANY = st.floats(allow_nan=True, allow_infinity=True, width=32)


def odometry(time: float) -> Odometry:
    return Odometry(time, Pose(0, 0, 0), Twist(0, 0), 0.0, still=False)


def control(
    locom: Unicycle,
    v: float,
    w: float,
    time: float = 9.0,
    age: float = 0.0,
    emergency: bool = False,
) -> Twist:
    """The next twist for a command of (v, w) that was given ``age`` [s] before ``time``."""
    command = Command(time - age, Twist(v, w), "test", "test", emergency)
    return locom.control(command, odometry(time), DT)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(ANY, ANY, st.booleans()), min_size=1, max_size=30))
def test_limits_hold_for_any_commands(commands: list[tuple[float, float, bool]]) -> None:
    locom = Unicycle(ROBOT)
    before = Twist(0.0, 0.0)
    for k, (v, w, emergency) in enumerate(commands):
        now = control(locom, v, w, k * DT, emergency=emergency)
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
        control(locom, v, w, k * DT)
    return locom


@pytest.mark.parametrize(
    ("before", "wanted", "change"),
    [
        (0.0, 0.4, ROBOT.max_accel * DT),
        (0.2, 0.4, ROBOT.max_accel * DT),
        (0.0, -0.1, -ROBOT.max_accel * DT),
        (-0.05, -0.1, -ROBOT.max_accel * DT),
        (0.4, 0.2, -ROBOT.max_brake * DT),
        (0.4, 0.0, -ROBOT.max_brake * DT),
        (-0.1, 0.0, ROBOT.max_brake * DT),
        (0.4, -0.1, -ROBOT.max_brake * DT),
        (-0.1, 0.4, ROBOT.max_brake * DT),
        # the other direction begins at standstill, and slowing down ends at the command
        (0.001, -0.1, -0.001),
        (-0.001, 0.4, 0.001),
        (0.3, 0.299, -0.001),
    ],
)
def test_speeding_up_is_gentler_than_slowing_down(
    before: float, wanted: float, change: float
) -> None:
    assert control(settled(before, 0.0), wanted, 0.0).v == pytest.approx(before + change, abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turning_rates_change_by_the_largest_angular_acceleration(sign: float) -> None:
    first, back = control(Unicycle(ROBOT), 0.0, sign), control(settled(0.0, sign), 0.0, 0.0)
    assert first.w == pytest.approx(sign * ROBOT.max_turn_accel * DT)
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
    twist = control(settled(wanted.v, wanted.w), wanted.v, wanted.w, 2.0)
    assert (twist.v, twist.w) == pytest.approx((reached.v, reached.w))


@pytest.mark.parametrize(("age", "v"), [(0.5, 0.3), (0.51, 0.3 - ROBOT.max_brake * DT)])
def test_commands_are_void_from_the_age_of_the_parameter(age: float, v: float) -> None:
    locom = settled(0.3, 0.0)
    assert control(locom, 0.3, 0.0, 9.0 + age, age).v == pytest.approx(v)
    assert locom.control(None, odometry(9.0), DT).v < 0.3
    for k in range(120):
        twist = control(locom, 0.3, 0.0, 10.0 + k * DT, 1.0 + k * DT)
    assert twist == Twist(0.0, 0.0)


def test_in_an_emergency_the_robot_brakes_turns_and_may_reverse() -> None:
    twist = control(settled(0.3, 0.0), 0.3, 1.0, emergency=True)
    assert twist.v == pytest.approx(0.3 - ROBOT.max_brake * DT)
    assert twist.w > 0.0
    assert control(settled(-0.1, 0.0), -0.1, 0.0, emergency=True).v == -0.1


def test_reset_is_standstill() -> None:
    locom = settled(0.3, 0.5)
    locom.reset()
    assert locom.control(None, odometry(9.0), DT) == Twist(0.0, 0.0)


# --- wheel trim: weak wheels are driven faster, sound and blocked ones as commanded ---------------


FINE = RobotModel(ticks_per_turn=10**6)
"""A robot whose encoders are exact."""
STEP = 0.017
"""Time [s] between readings: no threshold is a multiple of it."""


def expected_share(
    times: list[float], commanded: list[float], measured: list[float], before: float
) -> float:
    """The next share of a wheel, from its commanded and measured rotations [rad] so far."""
    now = len(times) - 1
    then = next(k for k in range(now + 1) if times[now] - times[k] <= WINDOW)
    way = commanded[now] - commanded[then]
    if times[now] - times[then] <= 0.8 * WINDOW or abs(way) * FINE.wheel_radius < MIN_DISTANCE:
        return before
    share = (measured[now] - measured[then]) / way
    if not MIN_SHARE <= share <= 1.3:
        return before
    keep = math.exp(-(times[now] - times[now - 1]) / TIME_CONSTANT)
    return keep * before + (1.0 - keep) * min(share, 1.0)


SHARES = st.sampled_from([0.21, 0.41, 0.63, 0.87, 0.95, 1.0, 1.23, 1.35])
PHASES = st.lists(
    st.tuples(
        st.integers(5, 50),  # frames
        st.floats(-0.15, 0.5),  # v [m/s]
        st.floats(-1.0, 1.0),  # w [rad/s]
        SHARES,  # of the left wheel
        SHARES,  # of the right wheel
    ),
    min_size=1,
    max_size=5,
)


@given(PHASES)
def test_shares_are_those_of_the_last_window(
    phases: list[tuple[int, float, float, float, float]],
) -> None:
    trim = WheelTrim(FINE)
    times: list[float] = []
    commanded: tuple[list[float], list[float]] = ([], [])
    measured: tuple[list[float], list[float]] = ([], [])
    expected = [1.0, 1.0]
    turned, sums, speeds, shares = [0.0, 0.0], [0.0, 0.0], (0.0, 0.0), (1.0, 1.0)
    for frames, v, w, *now in phases:
        for _ in range(frames):
            times.append(STEP * len(times))
            for side in range(2):
                if len(times) > 1:
                    sums[side] += speeds[side] * STEP
                    turned[side] += speeds[side] * shares[side] * STEP
                commanded[side].append(sums[side])
                measured[side].append(turned[side])
                if len(times) > 1:
                    expected[side] = expected_share(
                        times, commanded[side], measured[side], expected[side]
                    )
            ticks = [round(a / (2.0 * math.pi) * FINE.ticks_per_turn) for a in turned]
            trim.update(Encoders(times[-1], ticks[0], ticks[1]))
            assert trim.shares == pytest.approx(expected, abs=1e-6)
            speeds, shares = FINE.wheel_speeds(trim.apply(Twist(v, w))), (now[0], now[1])
    before = trim.shares
    trim.update(Encoders(times[-1] - 4.0 * STEP, ticks[0], ticks[1]))
    assert trim.shares == before, "a reading from before says nothing"


@pytest.mark.parametrize(
    ("shares", "factors"),
    [
        ((0.87, 1.0), (1.0 / 0.87, 1.0)),
        ((0.89, 1.0), (1.0, 1.0)),
        ((1.0, 0.5), (1.0, 2.0)),
        ((0.95, 0.5), (1.0, 2.0)),
        ((0.6, 0.8), (1.0 / 0.6, 1.0 / 0.8)),
    ],
)
@given(v=st.floats(-0.15, 0.5), w=st.floats(-1.5, 1.5))
def test_weak_wheels_alone_are_driven_faster(
    shares: tuple[float, float], factors: tuple[float, float], v: float, w: float
) -> None:
    trim = WheelTrim(ROBOT)
    trim._shares = list(shares)
    driven = np.array(ROBOT.wheel_speeds(trim.apply(Twist(v, w))))
    wanted = np.array(factors) * ROBOT.wheel_speeds(Twist(v, w))
    assert driven == pytest.approx(wanted, abs=1e-9)
    if factors == (1.0, 1.0):
        assert trim.apply(Twist(v, w)) == Twist(v, w)
    trim.reset()
    assert trim.shares == (1.0, 1.0)
