"""The pose graph: closed loops spread the error of odometry, and contradictions are dropped."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from navfw.mapping.pose_graph import KeyPoseGraph, Relation, odometry_information
from navfw.numerics import Array
from navfw.signals import Pose, wrap_angle

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
