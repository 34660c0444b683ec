"""The pose graph: loops spread the error of odometry, contradictions go; landmarks in it."""

import math
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from navfw.errors import MapError
from navfw.mapping.landmark_mapping import LandmarkEstimate, LandmarkMapper, with_landmarks
from navfw.mapping.pose_graph import KeyPoseGraph, Relation, odometry_information
from navfw.numerics import Array
from navfw.signals import LandmarkDetection, Pose, wrap_angle
from navfw.topomap import Landmark, Place, TopoMap, load_map
from navfw.topomap.mapfile import map_text

SURE: Array = np.diag([1e4, 1e4, 1e6])


def ring(count: int) -> list[Pose]:
    """Poses on a circle of ``count`` steps of 1 m, back to the first."""
    pose, step = Pose(0.0, 0.0, 0.0), Pose(1.0, 0.0, 2.0 * math.pi / count)
    poses = [pose]
    for _ in range(count):
        pose = pose.compose(step)
        poses.append(pose)
    return poses


def graph_of(truth: list[Pose], errors: Array) -> KeyPoseGraph:
    """A chain of the relative poses, each off by a row of ``errors`` (n, 3)."""
    graph = KeyPoseGraph()
    graph.add(truth[0])
    pose = truth[0]
    for a, b, error in zip(truth, truth[1:], errors, strict=False):
        step = a.relative(b)
        step = Pose(step.x + error[0], step.y + error[1], step.yaw + error[2])
        pose = pose.compose(step)
        graph.add(pose, step)
    return graph


def largest_error(graph: KeyPoseGraph, truth: list[Pose]) -> float:
    """The largest distance [m] of a pose from the truth."""
    return max(math.dist((a.x, a.y), (b.x, b.y)) for a, b in zip(graph.poses, truth, strict=True))


def test_poses_without_a_loop_stay_where_odometry_has_them() -> None:
    truth = ring(12)
    graph = graph_of(truth, np.full((12, 3), 0.01))
    before = list(graph.poses)
    assert graph.optimize() == []
    for a, b in zip(before, graph.poses, strict=True):
        assert (a.x, a.y, a.yaw) == pytest.approx((b.x, b.y, b.yaw), abs=1e-9)


@settings(max_examples=15)
@given(st.floats(-0.01, 0.01), st.integers(20, 60))
def test_a_closed_loop_corrects_a_constant_error_of_heading(turn: float, count: int) -> None:
    truth = ring(count)
    graph = graph_of(truth, np.tile([0.0, 0.0, turn], (count, 1)))
    before = largest_error(graph, truth)
    graph.matches.append(Relation(0, count, truth[0].relative(truth[-1]), SURE))
    assert graph.optimize() == []
    assert largest_error(graph, truth) <= 0.2 * before + 0.01


def test_a_match_that_the_others_contradict_is_dropped() -> None:
    truth = ring(30)
    graph = graph_of(truth, np.zeros((30, 3)))
    wrong = Relation(3, 17, Pose(0.0, 0.0, 0.0), SURE)
    graph.matches.append(wrong)
    graph.matches.append(Relation(0, 30, truth[0].relative(truth[-1]), SURE))
    assert graph.optimize() == [wrong]
    assert largest_error(graph, truth) < 1e-3


def test_the_step_solves_the_least_squares_problem() -> None:
    rng = np.random.default_rng(4)
    truth = ring(25)
    graph = graph_of(truth, rng.normal(0.0, 0.002, (25, 3)))
    steps = [a.relative(b) for a, b in zip(graph.poses, graph.poses[1:], strict=False)]
    matches = [(0, 25), (2, 20), (5, 12)]
    relations = [Relation(i, i + 1, s, odometry_information(s)) for i, s in enumerate(steps)]
    for i, j in matches:
        relations.append(Relation(i, j, truth[i].relative(truth[j]), 0.1 * SURE))
        graph.matches.append(relations[-1])

    def residuals(state: Array) -> Array:
        poses = [graph.poses[0], *(Pose(*row) for row in state.reshape(-1, 3).tolist())]
        rows = []
        for relation in relations:
            off = poses[relation.first].relative(poses[relation.second])
            m = relation.measured
            error = np.array([off.x - m.x, off.y - m.y, wrap_angle(off.yaw - m.yaw)])
            rows.append(np.sqrt(np.diag(relation.information)) * error)
        return np.concatenate(rows)

    start = np.array([(p.x, p.y, p.yaw) for p in graph.poses[1:]]).ravel()
    expected = least_squares(residuals, start, xtol=1e-12).x.reshape(-1, 3)
    assert np.abs(start - expected.ravel()).max() > 5e-3
    assert graph.optimize() == []
    found = np.array([(p.x, p.y, p.yaw) for p in graph.poses[1:]])
    assert np.abs(found[:, :2] - expected[:, :2]).max() < 1e-3


START = Pose(1.0, 2.0, 0.5)
MARKS = {f"aruco-{i}": (4.0 * math.cos(i), 4.0 * math.sin(i)) for i in range(6)}
SIGMAS = np.array([math.radians(0.5), 0.05])


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
        mapper.integrate(measured, seen)
        ends.append((START.compose(measured).x - true.x, START.compose(measured).y - true.y))
    return mapper, ends


@pytest.mark.parametrize(
    ("seed", "sums"),
    [
        (1, [-1.84464857, 4.27904765, 4.14067764, 0.45944191, 169]),
        (2, [-1.75464959, 4.30110080, 4.18871233, 0.45594283, 169]),
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
    look = LandmarkDetection(0.0, "aruco-1", 0.1, 2.0, np.diag(SIGMAS**2))
    rare = LandmarkDetection(0.0, "aruco-2", -0.1, 3.0, np.diag(SIGMAS**2))
    for seen in ([look, rare], [look, rare], [look], [look]):
        mapper.integrate(Pose(0.0, 0.0, 0.0), seen)
    (mapped,) = mapper.estimate(least=3)
    assert mapped.identity == "aruco-1"
    place = START.to_parent(2 * math.cos(0.1), 2 * math.sin(0.1))
    assert (mapped.x, mapped.y) == pytest.approx(place)
    # the normal points to the robot
    assert mapped.yaw == pytest.approx(START.yaw + 0.1 - math.pi, abs=1e-6)
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
