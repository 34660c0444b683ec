"""Landmark positions from drifting odometry and noisy detections, some of them false."""

from __future__ import annotations

import math
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from navfw.errors import MapError
from navfw.signals import LandmarkDetection, Odometry, Pose, Twist
from navfw.topomap import (
    Landmark,
    LandmarkEstimate,
    LandmarkMapper,
    Place,
    TopoMap,
    load_map,
    map_text,
    with_landmarks,
)

START = Pose(1.0, 2.0, 0.5)
MARKS = {f"aruco-{i}": (4.0 * math.cos(i), 4.0 * math.sin(i)) for i in range(6)}
SIGMAS = np.array([math.radians(0.5), 0.05])


def odometry(pose: Pose) -> Odometry:
    return Odometry(0.0, pose, Twist(0.3, 0.0), 0.0, still=False)


def driven(seed: int, false_share: float = 0.0) -> tuple[LandmarkMapper, list[tuple[float, float]]]:
    """Three rounds on a circle; odometry turns 1 % too far. The mapper and the odometry errors."""
    rng = np.random.default_rng(seed)
    mapper = LandmarkMapper(START)
    true, measured = START, Pose(0.0, 0.0, 0.0)
    ends = []
    for _ in range(180):
        true = true.compose(Pose(0.2, 0.0, 0.105))
        drift = float(rng.normal(0.001, 0.002))
        measured = measured.compose(Pose(0.2 * float(rng.normal(1.01, 0.01)), 0.0, 0.105 + drift))
        seen = []
        for identity, mark in MARKS.items():
            ahead, left = true.to_local(*mark)
            bearing, away = math.atan2(left, ahead), math.hypot(ahead, left)
            if abs(bearing) > 0.8 or away > 6.0:
                continue
            if rng.random() < false_share:
                bearing, away = rng.uniform(-0.8, 0.8), rng.uniform(1.0, 5.0)
            noise = SIGMAS * rng.standard_normal(2)
            values = bearing + float(noise[0]), away + float(noise[1])
            seen.append(LandmarkDetection(0.0, identity, *values, np.diag(SIGMAS**2)))
        mapper.integrate(odometry(measured), seen)
        ends.append((START.compose(measured).x - true.x, START.compose(measured).y - true.y))
    return mapper, ends


@pytest.mark.parametrize(
    ("seed", "sums"),
    [
        (1, [-1.84627438, 4.28036333, 4.13982396, 0.45944132, 169]),
        (2, [-1.75371553, 4.30392480, 4.18659948, 0.45585828, 169]),
    ],
)
def test_landmarks_are_accurate_although_the_odometry_drifts(seed: int, sums: list[float]) -> None:
    mapper, ends = driven(seed)
    learnt = mapper.estimate()
    assert {found.identity for found in learnt} <= set(MARKS)
    assert len(learnt) >= 5
    drift = max(math.hypot(*end) for end in ends)
    errors = [math.dist((found.x, found.y), MARKS[found.identity]) for found in learnt]
    assert drift > 0.3
    assert max(errors) < 0.25
    assert math.sqrt(np.mean(np.square(errors))) < 0.5 * drift
    assert np.sum([astuple(found)[1:] for found in learnt], axis=0) == pytest.approx(sums)
    # sigma is consistent with the errors
    assert all(error < 4.0 * found.sigma for error, found in zip(errors, learnt, strict=True))


def test_false_detections_do_little_harm() -> None:
    mapper, _ = driven(3, false_share=0.05)
    errors = [math.dist((f.x, f.y), MARKS[f.identity]) for f in mapper.estimate()]
    assert max(errors) < 0.35


def test_landmarks_with_few_detections_are_left_out() -> None:
    mapper = LandmarkMapper(START)
    for k in range(4):
        look = LandmarkDetection(0.0, "aruco-1", 0.1, 2.0, np.diag(SIGMAS**2))
        rare = LandmarkDetection(0.0, "aruco-2", -0.1, 3.0, np.diag(SIGMAS**2))
        mapper.integrate(odometry(Pose(0.0, 0.0, 0.0)), [look, rare] if k < 2 else [look])
    assert [found.identity for found in mapper.estimate(least=3)] == ["aruco-1"]
    (found,) = mapper.estimate(least=3)
    assert (found.x, found.y) == pytest.approx(
        START.to_parent(2 * math.cos(0.1), 2 * math.sin(0.1))
    )
    # the normal points to the robot
    assert found.yaw == pytest.approx(START.yaw + 0.1 - math.pi, abs=1e-6)
    assert LandmarkMapper(START).estimate() == []


def test_estimates_move_known_landmarks_and_add_others(tmp_path: Path) -> None:
    known = [
        Landmark("old", "aruco", 1, 0.0, 0.0, 0.0, z=1.2, size=0.3),
        Landmark("aruco-2", "poster", 9, 5.0, 5.0, 0.0),
    ]
    before = TopoMap("m", [Place("here", 0.0, 0.0)], [], None, known)
    estimates = [
        LandmarkEstimate("aruco-1", 1.0, 2.0, 0.5, 0.1, 5),
        LandmarkEstimate("aruco-2", 3.0, 4.0, -1.0, 0.1, 4),
    ]
    after = with_landmarks(before, estimates, {"aruco": 0.25, "poster": 0.5}.__getitem__)
    file = tmp_path / "map.yaml"
    file.write_text(map_text(after), encoding="utf-8")
    marks = load_map(file).landmarks
    assert marks["old"] == Landmark("old", "aruco", 1, 1.0, 2.0, 0.5, z=1.2, size=0.3)
    assert marks["aruco-2"] == known[1]
    assert marks["aruco-2-2"].id == 2
    with pytest.raises(MapError, match="lamp"):
        with_landmarks(before, [LandmarkEstimate("lamp", 1.0, 2.0, 0.0, 0.1, 5)], len)
