"""Gyro and encoder models have the statistics that their parameters specify."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from navfw.errors import UnknownNameError
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Encoders, Inertial
from navfw.sim import PRESETS, GyroModel, SensorParams, WheelEncoderModel

ROBOT = RobotModel()
DT = 1.0 / 60.0
QUIET = SensorParams.preset("perfect")


def yaw_rates(params: SensorParams, seed: int, count: int, rate: float = 0.0) -> Array:
    gyro = GyroModel(params, np.random.default_rng(seed))
    return np.array([gyro.read(i * DT, DT, (0.0, 0.0, rate)).yaw_rate for i in range(count)])


def ticks(params: SensorParams, seed: int, turns: float, count: int = 600) -> tuple[int, int]:
    encoders = WheelEncoderModel(params, ROBOT, np.random.default_rng(seed))
    reading = None
    for angle in np.linspace(0.0, 2.0 * math.pi * turns, count + 1)[1:]:
        reading = encoders.read(0.0, DT, (angle, angle))
    assert reading is not None
    return reading.left, reading.right


def test_perfect_gyro_measures_the_true_rate() -> None:
    assert np.all(yaw_rates(QUIET, 0, 10, rate=0.4) == 0.4)


def test_gyro_noise() -> None:
    rates = yaw_rates(QUIET.model_copy(update={"gyro_noise": 0.01}), 1, 4000)
    assert rates.std() == pytest.approx(0.01, rel=0.05)
    assert abs(rates.mean()) < 4 * 0.01 / math.sqrt(4000)
    # white: consecutive readings are uncorrelated
    assert abs(np.corrcoef(rates[1:], rates[:-1])[0, 1]) < 0.06


def test_gyro_bias_is_constant_and_differs_between_runs() -> None:
    params = QUIET.model_copy(update={"gyro_bias": 0.01})
    biases = np.array([yaw_rates(params, seed, 2) for seed in range(300)])
    assert np.all(biases[:, 0] == biases[:, 1])
    assert biases[:, 0].std() == pytest.approx(0.01, rel=0.15)


def test_gyro_bias_random_walk() -> None:
    params = QUIET.model_copy(update={"gyro_bias_walk": 0.002})
    ends = np.array([yaw_rates(params, seed, 600)[-1] for seed in range(100)])
    assert ends.std() == pytest.approx(0.002 * math.sqrt(600 * DT), rel=0.25)


def test_noise_does_not_depend_on_the_block_size() -> None:
    params = SensorParams.preset("poor")

    def readings(ahead: int) -> list[tuple[Inertial, Encoders]]:
        gyro = GyroModel(params, np.random.default_rng(3), ahead)
        wheels = WheelEncoderModel(params, ROBOT, np.random.default_rng(4), ahead)
        return [
            (gyro.read(i * DT, DT, (0.0, 0.0, 0.3)), wheels.read(i * DT, DT, (0.1 * i, 0.2 * i)))
            for i in range(20)
        ]

    assert readings(1) == readings(7) == readings(64)


@pytest.mark.parametrize("turns", [3.3, -3.3])
def test_perfect_encoders_only_quantise(turns: float) -> None:
    left, right = ticks(QUIET, 0, turns)
    assert left == right
    assert left == math.floor(turns * ROBOT.ticks_per_turn + 1e-6)


def test_slip_has_the_specified_mean_and_standard_deviation() -> None:
    params = QUIET.model_copy(update={"slip": 0.02, "slip_mean": 0.01, "slip_time": 0.0})
    excess = [ticks(params, seed, 20.0)[0] / (20 * ROBOT.ticks_per_turn) for seed in range(60)]
    assert np.mean(excess) == pytest.approx(1.01, abs=0.0005)
    # 600 independent samples average out to 0.02 / sqrt(600)
    assert np.std(excess) == pytest.approx(0.02 / math.sqrt(600), rel=0.3)


def test_correlated_slip_accumulates() -> None:
    params = QUIET.model_copy(update={"slip": 0.02, "slip_time": 0.5})
    excess = [ticks(params, seed, 20.0)[0] / (20 * ROBOT.ticks_per_turn) for seed in range(60)]
    # a Gauss-Markov process over 10 s with 0.5 s memory: sigma * sqrt(2 * 0.5 / 10)
    assert np.std(excess) == pytest.approx(0.02 * math.sqrt(0.1), rel=0.3)


def test_wheels_of_unequal_radius_count_unequally() -> None:
    params = QUIET.model_copy(update={"radius_mismatch": 0.01})
    ratios = [ticks(params, s, 20.0)[1] / ticks(params, s, 20.0)[0] for s in range(12)]
    assert np.abs(np.array(ratios) - 1.0) == pytest.approx(0.01, rel=0.02)
    assert min(ratios) < 1.0 < max(ratios)


def test_standing_wheels_count_nothing() -> None:
    assert ticks(SensorParams.preset("poor"), 3, 0.0) == (0, 0)


def test_presets() -> None:
    spread = [
        SensorParams.preset(name).gyro_bias for name in ("perfect", "good", "default", "poor")
    ]
    assert spread == sorted(spread)
    assert SensorParams.preset("default") == SensorParams()
    assert SensorParams.preset("good", slip=0.1).slip == 0.1
    assert set(PRESETS) == {"perfect", "good", "default", "poor"}
    with pytest.raises(UnknownNameError, match="did you mean 'good'"):
        SensorParams.preset("goood")
    with pytest.raises(ValidationError):
        SensorParams.preset("good", slipp=0.1)
