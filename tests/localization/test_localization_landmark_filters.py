"""Localisation by landmarks, some of them displaced: the Kalman filter, and the topological one."""

import math
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from localization_drives import (
    HALL,
    MARKS,
    RING,
    START,
    FakeRecognizer,
    Report,
    detection,
    displaced,
    drive,
    follow,
    odometry,
    place_landmarks,
    straight_drive,
    tour,
    turn_round,
    with_landmarks,
)
from navfw_benchmarks.plugins.localizers import Ekf

from navfw.errors import InputError
from navfw.localization.landmark_model import Association, associate
from navfw.localization.motion_model import MotionParams, motion_noise
from navfw.localization.topological import Topological
from navfw.robot import RobotModel
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose
from navfw.sim import SensorParams
from navfw.sim.sensor_models import PRESETS
from navfw.topomap import Landmark, TopoMap, load_map


def round_trip(
    seed: int,
    *,
    rounds: int = 1,
    wrong: float = 0.0,
    seen: bool = True,
    preset: str = "default",
    sheet: str | None = None,
    confused: float = 0.002,
) -> Report:
    """Rounds with the sensors of a preset, and its data sheet or that of ``sheet``."""
    rng = np.random.default_rng(seed)
    real = displaced(MARKS, wrong, rng) if wrong else MARKS
    ekf = Ekf(RobotModel(odometry=SensorParams.preset(sheet or preset).sheet))
    way = straight_drive(RING[:4] * rounds + RING[:1])
    moments = drive(START, way, rng, SensorParams.preset(preset))
    recognizer = FakeRecognizer(real if seen else [], rng, confused)
    return follow(ekf, HALL, moments, recognizer, START)


@pytest.mark.parametrize("seed", [0, 1])
def test_with_landmarks_the_error_is_small_and_the_covariance_consistent(seed: int) -> None:
    report = round_trip(seed)
    assert np.percentile(report.error, 95) < 0.2
    # 3 on average for exact covariances of three dimensions; a little less is conservative
    assert 0.2 < report.nees.mean() < 3.5
    assert np.percentile(report.nees, 95) < 9.5
    assert report.updates > 30
    assert not report.lost.any()


def test_without_landmarks_it_drifts_and_the_confidence_falls() -> None:
    report = round_trip(2, rounds=2, seen=False, preset="poor")
    seeing = round_trip(2, rounds=2, preset="poor")
    assert report.error[-1] > 0.5
    assert np.percentile(seeing.error, 95) < 0.5 * np.percentile(report.error, 95)
    assert report.confidence[-1] < seeing.confidence[-1]
    assert report.totals == pytest.approx((2630.33324, 4463.30808, 689.142224, 1534, 0))


@pytest.mark.parametrize(
    ("seed", "totals"),
    [
        (3, (129.316465, 2956.13948, 2357.999188, 0, 226)),
        (4, (110.855165, 2279.90880, 2357.999236, 0, 225)),
    ],
)
def test_one_displaced_landmark_in_six_does_no_harm(seed: int, totals: tuple[float, ...]) -> None:
    report = round_trip(seed, rounds=2, wrong=0.16)
    assert np.percentile(report.error, 95) < 0.35
    assert report.error.max() < 0.6
    assert report.totals == pytest.approx(totals)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_a_hundred_metres_with_displaced_landmarks(seed: int) -> None:
    report = round_trip(seed, rounds=3, wrong=0.1)
    assert report.driven[-1] > 100.0
    assert np.percentile(report.error, 95) < 0.35
    assert report.nees.mean() < 4.0


@pytest.mark.slow
def test_a_kilometre() -> None:
    report = round_trip(0, rounds=23)
    assert report.driven[-1] > 1000.0
    assert np.percentile(report.error, 95) < 0.2
    assert report.nees.mean() < 3.5


def started(params: Ekf.Params | None = None, hall: TopoMap = HALL) -> Ekf:
    ekf = Ekf(RobotModel(), params)
    ekf.start(hall, START, odometry(START, still=True))
    return ekf


def at_rest(ekf: Ekf, time: float, *marks: Landmark, truth: Pose = START) -> Belief:
    """The belief at ``time`` [s] of a robot at rest that detects ``marks`` from ``truth``."""
    seen = [detection(mark, truth, time) for mark in marks]
    return ekf.update(odometry(START, time, still=True), None, seen)


def test_unmapped_landmarks_change_nothing() -> None:
    ekf = started()
    before = at_rest(ekf, 0.1)
    after = at_rest(ekf, 0.2, Landmark("unmapped", "aruco", 99, 3.0, 1.0, 0.0))
    assert after.pose == before.pose
    assert after.updates == 0


def test_repeated_detections_add_little_information() -> None:
    """A hundred detections of one landmark in ten seconds are not independent."""
    ekf = started(Ekf.Params(start_xy=0.5, least_xy=0.0, least_yaw=0.0))
    beliefs = [at_rest(ekf, 0.1 * frame, MARKS[0]) for frame in range(1, 101)]
    spreads = [float(np.trace(belief.covariance[:2, :2])) for belief in beliefs]
    single = 0.05**2 + 0.03**2
    assert spreads[-1] > single / 15.0
    assert spreads[-1] < spreads[0]


def test_a_late_detection_counts_from_the_pose_of_its_image() -> None:
    ekf = started(Ekf.Params(start_xy=0.3))
    late = detection(MARKS[0], Pose(0.05, 0.0, 0.0), 0.1)
    for frame in range(1, 11):
        driven = odometry(Pose(0.05 * frame, 0.0, 0.0), 0.1 * frame, 0.5)
        belief = ekf.update(driven, None, [late] if frame == 10 else [])
    assert belief.updates == 1
    assert belief.pose.x == pytest.approx(0.5, abs=0.02)
    assert belief.pose.y == pytest.approx(0.0, abs=0.02)


def test_consistent_landmarks_that_do_not_fit_move_the_pose() -> None:
    marks = [Landmark(f"m{i}", "aruco", i, 3.0, -2.0 + i, math.pi) for i in range(5)]
    ekf = started(hall=with_landmarks(HALL, marks))
    truth = Pose(0.6, 0.5, 0.0)
    for frame in range(1, 80):
        belief = at_rest(ekf, 0.5 * frame, marks[frame % 5], truth=truth)
    assert belief.pose.x == pytest.approx(truth.x, abs=0.15)
    assert belief.pose.y == pytest.approx(truth.y, abs=0.15)


def test_an_unknown_start_is_refused_with_a_remedy() -> None:
    with pytest.raises(InputError, match=r"unknown start.*topological"):
        Ekf(RobotModel()).start(HALL, None, odometry(START))


# --- consistency for all sensor presets, given their correct data sheets --------------------------
# NEES is the normalised squared error of the pose, 3 on average for exact covariances; NIS that of
# a landmark detection, 2 on average. Conservative filters have less, overconfident ones more.


@pytest.fixture
def distances(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The NIS of every detection."""
    record: list[float] = []

    def recording(*arguments: Any) -> Association:
        association = associate(*arguments)
        record.append(association.distance)
        return association

    monkeypatch.setattr("navfw.localization.metric_filter.associate", recording)
    return record


@pytest.mark.parametrize("preset", PRESETS)
def test_with_landmarks_it_is_consistent(distances: list[float], preset: str) -> None:
    report = round_trip(1, preset=preset, confused=0.0)
    assert report.nees.mean() < 3.0
    assert np.percentile(report.nees, 95) < 7.8
    assert 0.2 < np.mean(distances) < 2.5
    if preset != "perfect":  # there the floors on the covariance dominate
        assert report.nees.mean() > 0.2


@pytest.mark.parametrize("preset", PRESETS)
def test_without_landmarks_the_covariance_follows_the_drift(preset: str) -> None:
    ends = [round_trip(seed, seen=False, preset=preset).nees[-1] for seed in range(2)]
    assert np.mean(ends) < 6.0
    if preset != "perfect":
        assert np.mean(ends) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_it_is_consistent_over_many_drives(distances: list[float], preset: str) -> None:
    nees, nis = [], []
    for seed in range(10):
        distances.clear()
        report = round_trip(seed, rounds=2, preset=preset, confused=0.0)
        nees.append(report.nees.mean())
        nis.append(np.mean(distances))
    assert np.mean(nees) < 2.0
    assert max(nees) < 3.0
    assert 0.2 < np.mean(nis) < 2.2
    # one round only: after two with poor sensors the heading error is a radian, far from Gaussian
    blind = [round_trip(seed, seen=False, preset=preset).nees[-1] for seed in range(10)]
    assert np.mean(blind) < 3.5


def test_with_the_sheets_of_better_sensors_it_is_overconfident() -> None:
    report = round_trip(1, preset="poor", sheet="good", confused=0.0)
    assert report.nees.mean() > 6.0


def test_parameters_take_precedence_over_the_sheets() -> None:
    robot = RobotModel(odometry=SensorParams.preset("poor").sheet)
    better = motion_noise(MotionParams(), RobotModel())
    poor = motion_noise(MotionParams(), robot)
    for name in ("along", "yaw_by_time", "bias", "bias_walk"):
        assert getattr(poor, name) > 1.5 * getattr(better, name)
    for name in ("along", "bias"):
        noise = motion_noise(MotionParams(**{name: 0.123, "margin": 3.0}), robot)
        assert getattr(noise, name) == 0.123
    assert motion_noise(MotionParams(margin=3.0), robot).along == pytest.approx(2.0 * poor.along)


# --- the topological localiser, in the hospital ---------------------------------------------------

HOSPITAL = load_map(Path(__file__).parents[2] / "maps" / "hospital.yaml")
PLACE_MARKS = place_landmarks(HOSPITAL)
MAP = with_landmarks(HOSPITAL, PLACE_MARKS)


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
    seed: int, *, known: bool = False, off: Pose = START, wrong: float = 0.0, goals: int = 2
) -> tuple[Report, Timed]:
    """Two seconds of rest, a turn on the spot, then a tour of the hospital.

    The start is unknown or, if ``known``, given; it is ``off`` by so much in the map.
    """
    rng = np.random.default_rng(seed)
    real = displaced(PLACE_MARKS, wrong, rng) if wrong else PLACE_MARKS
    points = tour(MAP, rng, goals)
    (ax, ay), (bx, by) = points[:2]
    start = Pose(ax, ay, math.atan2(by - ay, bx - ax))
    told = Pose(start.x + off.x, start.y + off.y, start.yaw + off.yaw) if known else None
    driven = list(straight_drive(points))
    twists = [*driven[:120], *turn_round(), *driven[120:]]
    localizer = Timed(RobotModel())
    moments = drive(start, twists, rng)
    return follow(localizer, MAP, moments, FakeRecognizer(real, rng), told), localizer


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
    report, localizer = go(1, known=True, off=Pose(9.0, -6.0, 1.0), goals=3)
    assert localizer.relocations == 1
    assert report.error[0] > 8.0
    assert report.error[-1] < 0.3
    wrong = report.error > 1.0
    assert report.confidence[wrong].min() < 0.9


def test_one_landmark_does_not_suffice() -> None:
    localizer = Topological(RobotModel())
    localizer.start(MAP, None, odometry(START, still=True))
    for k in range(1, 60):
        seen = LandmarkDetection(0.1 * k, "aruco-3", 0.1, 2.0, np.diag((1e-4, 1e-2)))
        belief = localizer.update(odometry(START, 0.1 * k, still=True), None, [seen])
    assert belief.lost
    assert belief.confidence < 0.5
