"""Pitch of a body that rocks, by the rates of its gyro."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.egomotion import Odometer, RockingFilter
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Encoders, Inertial

DT = 1.0 / 60.0
NOISE, BIAS = math.radians(0.1), math.radians(0.05)


def readings(
    pitch: Array, turning: float = 0.0, noise: float = NOISE, bias: float = BIAS, seed: int = 0
) -> Iterator[Inertial]:
    """A gyro on a body of these pitches, one a reading, that turns about the vertical."""
    rng = np.random.default_rng(seed)
    for k, rate in enumerate(np.diff(pitch) / DT):
        true = (-turning * math.sin(pitch[k]), rate, turning * math.cos(pitch[k]))
        yield Inertial(k * DT, *(np.array(true) + bias + rng.normal(0.0, noise, 3)).tolist())


def fed(
    rocking: RockingFilter, inertials: Iterator[Inertial], turning: float = 0.0, still: bool = False
) -> Array:
    """The pitch after each reading."""
    pitches = []
    for inertial in inertials:
        rocking.update(inertial, turning, DT, still)
        pitches.append(rocking.pitch)
    return np.array(pitches)


def rested(noise: float = NOISE, bias: float = BIAS) -> RockingFilter:
    rocking = RockingFilter()
    fed(rocking, readings(np.zeros(90), 0.0, noise, bias, seed=9), still=True)
    return rocking


@given(
    degrees=st.floats(0.8, 4.0),
    period=st.floats(0.4, 5.0),
    turning=st.floats(-0.6, 0.6),
    seed=st.integers(0, 9),
)
@settings(max_examples=30)
def test_a_swing_is_followed_whatever_bias_and_turn(
    degrees: float, period: float, turning: float, seed: int
) -> None:
    times = np.arange(0.0, 10.0, DT)
    true = math.radians(degrees) * np.sin(2.0 * math.pi / period * times)
    estimate = fed(rested(), readings(true, turning, seed=seed), turning)
    error = np.degrees(estimate - true[1:])[round(period / DT) :]
    assert np.sqrt((error**2).mean()) < 0.12 + 0.12 * degrees


@pytest.mark.parametrize("worse", [1.0, 3.0])
def test_a_body_that_does_not_rock_is_level_to_the_last_bit(worse: float) -> None:
    noise, bias = worse * NOISE, 2.0 * worse * BIAS
    rocking = rested(noise, bias)
    assert not fed(rocking, readings(np.zeros(3000), 0.5, noise, bias), 0.5).any()
    assert rocking.rocking == 0.0


def test_a_body_that_stays_tipped_over_is_seen_in_turns() -> None:
    tipped = np.full(240, math.radians(-1.5))
    rocking = rested()
    fed(rocking, readings(np.concatenate([np.linspace(0.0, tipped[0], 12), tipped])))
    assert math.degrees(rocking.pitch) == pytest.approx(-1.1, abs=0.25)
    fed(rocking, readings(np.full(3600, tipped[0])))
    assert abs(math.degrees(rocking.pitch)) < 0.5, "without turns it is forgotten"
    swing = math.radians(0.5) * np.sin(np.linspace(0.0, 40.0, 600))
    fed(rocking, readings(tipped[0] + swing, 0.8), 0.8)
    true = math.degrees(tipped[0] + swing[-1])
    assert math.degrees(rocking.pitch) == pytest.approx(true, abs=0.4)


def test_a_tip_at_rest_is_no_bias() -> None:
    """It tips by 2 degrees within the first second, before the bias is known."""
    tip = np.linspace(0.0, math.radians(2.0), 15)
    rocking = RockingFilter()
    fed(rocking, readings(np.concatenate([np.zeros(20), tip, np.full(150, tip[-1])])), still=True)
    assert rocking._biases == pytest.approx([BIAS, BIAS], abs=math.radians(0.05))
    before = rocking._pitch
    fed(rocking, readings(np.concatenate([np.zeros(60), tip, np.full(9, tip[-1])])), still=True)
    assert rocking._biases == pytest.approx([BIAS, BIAS], abs=math.radians(0.1))
    assert rocking.pitch - before == pytest.approx(tip[-1], abs=math.radians(0.4)), "nor later"
    fed(rocking, readings(np.linspace(0.0, 1.0, 60)))
    assert rocking.pitch == 0.2, "no body leans further"


def test_a_gyro_with_one_axis_and_an_old_reading_say_nothing() -> None:
    odometer, level = Odometer(RobotModel()), []
    for k in range(200):
        rates = (math.nan, math.nan, 0.1) if k % 2 else (0.0, 0.9, 0.1)
        time = k * DT if k % 2 else -1.0
        odometry = odometer.update(Inertial(time, *rates), Encoders(k * DT, 100 * k, 100 * k))
        level.append((odometry.pitch, odometry.rocking))
    assert set(level) == {(0.0, 0.0)}
    for k in range(200, 230):
        inertial = Inertial(k * DT, 0.0, 0.1, 0.1)
        odometry = odometer.update(inertial, Encoders(k * DT, 100 * k, 100 * k))
    assert odometry.pitch == pytest.approx(0.05, rel=0.03)
    assert odometry.rocking == pytest.approx(0.05 * math.exp(-0.125), rel=0.05)
    odometer.reset()
    again = odometer.update(inertial, Encoders(9.0, 0, 0))
    assert (again.pitch, again.rocking) == (0.0, 0.0)
