from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from localization_drives import (
    FakeRecognizer,
    Report,
    displaced,
    drive,
    follow,
    place_landmarks,
    straight_drive,
    tour,
    turn_round,
    with_landmarks,
)

from navfw.localization import Topological
from navfw.robot import RobotModel
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose, Twist
from navfw.sim import SensorParams
from navfw.topomap import load_map

ROOT = Path(__file__).parents[2]
HOSPITAL = load_map(ROOT / "maps" / "hospital.yaml")
MARKS = place_landmarks(HOSPITAL)
MAP = with_landmarks(HOSPITAL, MARKS)


class Timed(Topological):
    """Measures its computing time."""

    spent = 0.0
    frames = 0

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        begun = clock.perf_counter()
        belief = super().update(odometry, percept, detections)
        self.spent += clock.perf_counter() - begun
        self.frames += 1
        return belief


def go(
    seed: int,
    *,
    known: bool = False,
    wrong: float = 0.0,
    goals: int = 2,
    sensors: SensorParams | None = None,
) -> tuple[Report, Timed]:
    """Two seconds of rest, a turn on the spot, then a tour of the hospital."""
    rng = np.random.default_rng(seed)
    real = displaced(MARKS, wrong, rng) if wrong else MARKS
    points = tour(MAP, rng, goals)
    (ax, ay), (bx, by) = points[:2]
    start = Pose(ax, ay, math.atan2(by - ay, bx - ax))
    driven = list(straight_drive(points))
    twists = [*driven[:120], *turn_round(), *driven[120:]]
    localizer = Timed(RobotModel())
    moments = drive(start, twists, rng, sensors)
    report = follow(localizer, MAP, moments, FakeRecognizer(real, rng), start if known else None)
    return report, localizer


@pytest.mark.parametrize(
    ("seed", "totals"),
    [
        (0, (53.7091786, 1089.174883, 1027.0, 1, 167)),
        (3, (1603.530684, 1621.084953, 1068.812302, 429, 169)),
    ],
)
def test_it_finds_an_unknown_start(seed: int, totals: tuple[float, ...]) -> None:
    report, _ = go(seed)
    assert report.lost[0]
    assert report.localized_at is not None
    assert report.driven[report.localized_at] < 25.0
    assert report.confidently_wrong == 0.0
    after = report.error[report.localized_at :]
    assert np.percentile(after, 95) < 0.35
    assert not report.lost[report.localized_at :].any()
    assert report.totals == pytest.approx(totals)


def test_a_known_start_stays_known_with_displaced_landmarks() -> None:
    report, localizer = go(0, known=True, wrong=0.1)
    assert localizer.relocations == 0
    assert np.percentile(report.error, 95) < 0.35
    assert not report.lost.any()
    assert 1e3 * localizer.spent / localizer.frames < 5.0  # a bound for slow machines


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0.0, 0.1])
def test_twenty_starts_in_the_hospital(wrong: float) -> None:
    reports = [go(100 + seed, wrong=wrong, goals=3)[0] for seed in range(20)]
    within = [r for r in reports if r.localized_at is not None and r.driven[r.localized_at] <= 25.0]
    assert len(within) >= 18
    assert sum(r.confidently_wrong > 0.0 for r in reports) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_long_patrol_of_the_hospital_with_displaced_landmarks(seed: int) -> None:
    report, localizer = go(200 + seed, known=True, wrong=0.1, goals=25)
    assert report.driven[-1] > 400.0
    assert np.percentile(report.error, 95) < 0.35
    assert localizer.relocations == 0


def test_from_a_wrong_start_it_relocates() -> None:
    """From a wrong start the confidence falls before the pose is right again."""
    rng = np.random.default_rng(1)
    points = tour(MAP, rng, 3)
    (ax, ay), (bx, by) = points[:2]
    true = Pose(ax, ay, math.atan2(by - ay, bx - ax))
    wrong_start = Pose(ax + 9.0, ay - 6.0, true.yaw + 1.0)
    localizer = Topological(RobotModel())
    twists = [*turn_round(), *straight_drive(points)]
    moments = drive(true, twists, rng)
    report = follow(localizer, MAP, moments, FakeRecognizer(MARKS, rng), wrong_start)
    assert localizer.relocations == 1
    assert report.error[0] > 8.0
    assert report.error[-1] < 0.3
    wrong = report.error > 1.0
    assert report.confidence[wrong].min() < 0.9


def test_one_landmark_does_not_suffice() -> None:
    localizer = Topological(RobotModel())
    still = [Odometry(0.1 * i, Pose(0, 0, 0), Twist(0, 0), 0.0, True) for i in range(60)]
    localizer.start(MAP, None, still[0])
    for odometry in still[1:]:
        seen = LandmarkDetection(odometry.time, "aruco-3", 0.1, 2.0, np.diag((1e-4, 1e-2)))
        belief = localizer.update(odometry, None, [seen])
    assert belief.lost
    assert belief.confidence < 0.5
