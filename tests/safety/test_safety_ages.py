"""Sensors limit the speed beyond their thresholds, not at them."""

from __future__ import annotations

import pytest
from safety_samples import ORIGIN, ROBOT, FixedDistances, odometry, picture, reading

from navfw.guard import FailingStage
from navfw.safety import SafetyMonitor, SafetyParams
from navfw.signals import Twist

AGE, LATER = 0.5, 0.5 + 1 / 64
"""A threshold and an age beyond it [s], both exact in binary."""


@pytest.mark.parametrize(
    ("threshold", "sensor", "speed"),
    [
        ("camera_slow", "frame_age", 0.12),
        ("camera_stop", "frame_age", 0.0),
        ("gyro_slow", "gyro_age", 0.12),
        ("encoder_stop", "encoder_age", 0.0),
    ],
)
def test_only_what_is_older_than_the_threshold_counts(
    threshold: str, sensor: str, speed: float
) -> None:
    patient = {"camera_slow": 9.0, "camera_stop": 9.0, "gyro_slow": 9.0, "encoder_stop": 9.0}
    params = SafetyParams(**{**patient, threshold: AGE})
    for age, expected in ((AGE, 0.4), (LATER, speed)):
        monitor = SafetyMonitor(ROBOT, FixedDistances(10.0, 10.0), params)
        monitor.update(reading(0.0, picture()), odometry(0.0))
        monitor.update(reading(2.0, picture(), **{sensor: age}), odometry(2.0, 0.3))
        assert monitor.limit(Twist(0.4, 0.0), 2.0, ORIGIN).twist.v == expected


def test_without_blind_reverse_the_robot_reverses_only_by_sight() -> None:
    params = SafetyParams(blind_reverse=0.0)
    monitor = SafetyMonitor(ROBOT, FixedDistances(10.0, 10.0), params)
    back = Twist(-0.1, 0.0)
    for time, image, speed in ((0.0, picture(), -0.1), (2.0, None, 0.0), (2.1, picture(), -0.1)):
        monitor.update(reading(time, image), odometry(time, v=-0.1))
        assert monitor.limit(back, time, ORIGIN).twist.v == speed


def test_of_a_silent_camera_and_a_failing_stage_the_longer_failure_is_told() -> None:
    params = SafetyParams(camera_slow=0.1, camera_stop=9.0)
    for since, why in ((1.9, "the camera is late"), (0.5, "flow mine fails")):
        monitor = SafetyMonitor(ROBOT, FixedDistances(10.0, 10.0), params)
        monitor.update(reading(0.0, picture()), odometry(0.0))
        stage = FailingStage("flow mine", since, "broken")
        monitor.update(reading(2.0, picture(), frame_age=1.0), odometry(2.0, 0.3), (stage,))
        assert monitor.limit(Twist(0.4, 0.0), 2.0, ORIGIN).reason == why
