"""Consistency of the Kalman filter for all sensor presets, given their correct data sheets.

NEES is the normalised squared error of the pose, 3 on average for exact covariances; NIS that of a
landmark detection, 2 on average. Conservative filters have less, overconfident ones more.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from localization_drives import (
    HALL,
    MARKS,
    RING,
    START,
    FakeRecognizer,
    Report,
    drive,
    follow,
    straight_drive,
)

from navfw.localization import Association, Ekf, MotionParams, associate, motion_noise
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.sim import PRESETS, SensorParams

Trip = Callable[..., tuple[Report, list[float]]]


@pytest.fixture
def trip(monkeypatch: pytest.MonkeyPatch) -> Trip:
    """Drive rounds with the sensors of a preset; the report, and the NIS of every detection."""
    distances: list[float] = []

    def recording(
        state: Array,
        covariance: Array,
        measured: Array,
        noise: Array,
        at: tuple[float, float],
        existence: float,
    ) -> Association:
        found = associate(state, covariance, measured, noise, at, existence)
        distances.append(found.distance)
        return found

    monkeypatch.setattr("navfw.localization.metric_filter.associate", recording)

    def run(
        preset: str, seed: int, *, rounds: int = 1, seen: bool = True, sheet: str | None = None
    ) -> tuple[Report, list[float]]:
        distances.clear()
        rng = np.random.default_rng(seed)
        sensors = SensorParams.preset(preset)
        ekf = Ekf(RobotModel(odometry=SensorParams.preset(sheet or preset).sheet))
        moments = drive(START, straight_drive(RING[:4] * rounds + RING[:1]), rng, sensors)
        recognizer = FakeRecognizer(MARKS if seen else [], rng, confused=0.0)
        return follow(ekf, HALL, moments, recognizer, START), list(distances)

    return run


@pytest.mark.parametrize("preset", PRESETS)
def test_with_landmarks_it_is_consistent(trip: Trip, preset: str) -> None:
    report, distances = trip(preset, 1)
    assert report.nees.mean() < 3.0
    assert np.percentile(report.nees, 95) < 7.8
    assert 0.2 < np.mean(distances) < 2.5
    if preset != "perfect":  # there the floors on the covariance dominate
        assert report.nees.mean() > 0.2


@pytest.mark.parametrize("preset", PRESETS)
def test_without_landmarks_the_covariance_follows_the_drift(trip: Trip, preset: str) -> None:
    ends = [trip(preset, seed, seen=False)[0].nees[-1] for seed in range(2)]
    assert np.mean(ends) < 6.0
    if preset != "perfect":
        assert np.mean(ends) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_it_is_consistent_over_many_drives(trip: Trip, preset: str) -> None:
    runs = [trip(preset, seed, rounds=2) for seed in range(10)]
    nees = np.array([report.nees.mean() for report, _ in runs])
    assert nees.mean() < 2.0
    assert nees.max() < 3.0
    assert 0.2 < np.mean([np.mean(distances) for _, distances in runs]) < 2.2
    # one round only: after two with poor sensors the heading error is a radian, far from Gaussian
    blind = [trip(preset, seed, seen=False)[0].nees[-1] for seed in range(10)]
    assert np.mean(blind) < 3.5


def test_with_the_sheets_of_better_sensors_it_is_overconfident(trip: Trip) -> None:
    report, _ = trip("poor", 1, sheet="good")
    assert report.nees.mean() > 6.0


def test_parameters_take_precedence_over_the_sheets() -> None:
    robot = RobotModel(odometry=SensorParams.preset("poor").sheet)
    better = motion_noise(MotionParams(), RobotModel())
    poor = motion_noise(MotionParams(), robot)
    for name in ("along", "yaw_by_time", "bias", "bias_walk"):
        assert getattr(poor, name) > 1.5 * getattr(better, name)
        noise = motion_noise(MotionParams(**{name: 0.123, "margin": 3.0}), robot)
        assert getattr(noise, name) == 0.123
    assert motion_noise(MotionParams(margin=3.0), robot).along == pytest.approx(2.0 * poor.along)
