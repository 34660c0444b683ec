"""Metrics of runs with known results."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from navfw.missions import RunMetrics, count_collisions, measure, path_length
from navfw.recording import Contact, RunLog, RunLogger
from navfw.signals import Pose, Twist
from navfw.sim import BoxSpec, SceneGeometry, WorldSpec

RADIUS = 0.18


OPEN = WorldSpec(name="open", x=(-9.0, 9.0), y=(-9.0, 9.0))
WALLED = OPEN.model_copy(
    update={"boxes": (BoxSpec(name="wall", at=(0.0, 0.6), size=(19.0, 0.2, 1.0)),)}
)
"""A wall begins at y = 0.5."""


def straight(length: float, seconds: float, drift: float = 0.0) -> RunLog:
    """Along x, with an estimate that ends ``drift`` [m] aside."""
    recorder = RunLogger()
    ticks = round(60 * seconds)
    for tick in range(ticks + 1):
        share = tick / ticks
        x = length * share
        recorder.add(
            tick / 60, Pose(x, 0.0, 0.0), Pose(x, drift * share, 0.0), Twist(0.1, 0.0), "go", False
        )
    return recorder.log()


def metrics(
    log: RunLog, shortest: float = 2.0, succeeded: bool = True, world: WorldSpec = WALLED
) -> RunMetrics:
    return measure(
        log,
        SceneGeometry.from_world(world),
        start=(0.0, 0.0),
        goal=(3.0, 0.4),
        within=0.5,
        shortest=shortest,
        discs=((0.0, 0.0, RADIUS),),
        succeeded=succeeded,
        stage_ms={"flow": 1.0},
    )


def test_a_straight_run_has_the_measured_lengths() -> None:
    found = metrics(straight(3.0, 10.0, drift=0.2))
    assert found.path_length_m == pytest.approx(3.0)
    assert found.spl == pytest.approx(2.0 / 3.0)
    assert found.mean_speed == pytest.approx(0.3)
    assert found.min_clearance_m == pytest.approx(0.5 - RADIUS)
    assert found.clearance_p05_m == pytest.approx(0.5 - RADIUS)
    assert found.distance_to_goal_m == pytest.approx(0.4)
    assert found.estimate_error_m == pytest.approx(0.2)
    assert found.estimate_error_max_m == pytest.approx(0.2)
    assert (found.collisions, found.emergencies) == (0, 0)


def test_the_traversal_lasts_from_the_first_decimetre_to_the_goal_s_neighbourhood() -> None:
    # 0.3 m/s along x; the goal (3, 0.4) comes within 0.5 m at x = 2.7
    assert metrics(straight(3.0, 10.0)).traversal_s == pytest.approx((2.7 - 0.1) / 0.3, abs=0.02)
    # without arrival to the end; a robot that did not set out has none
    assert metrics(straight(2.0, 10.0)).traversal_s == pytest.approx(9.5, abs=0.02)
    assert metrics(straight(0.05, 10.0)).traversal_s == 0.0


def test_spl_is_0_for_a_failure_and_at_most_1() -> None:
    assert metrics(straight(3.0, 10.0), succeeded=False).spl == 0.0
    # the success zone extends around the goal: a driven path may be shorter than the shortest one
    assert metrics(straight(1.6, 10.0), shortest=2.0).spl == 1.0


def test_a_run_without_ticks_has_metrics() -> None:
    found = metrics(RunLogger().log(), succeeded=False)
    assert (found.path_length_m, found.mean_speed, found.spl) == (0.0, 0.0, 0.0)
    assert found.distance_to_goal_m == pytest.approx(math.hypot(3.0, 0.4))


def test_without_objects_the_clearance_is_infinite_and_nothing_is_nan() -> None:
    found = metrics(straight(1.0, 2.0), world=OPEN)
    assert (found.min_clearance_m, found.clearance_p05_m) == (math.inf, math.inf)


def test_each_emergency_counts_once() -> None:
    recorder = RunLogger()
    pose = Pose(0.0, 0.0, 0.0)
    for tick, urgent in enumerate("..!!!..!...!!"):
        recorder.add(tick / 60, pose, pose, Twist(0.0, 0.0), "", urgent == "!")
    assert metrics(recorder.log()).emergencies == 3


@given(st.lists(st.floats(0.0, 100.0), max_size=30), st.randoms())
def test_collisions_are_debounced_in_any_order(times: list[float], random: object) -> None:
    contacts = [Contact(time, 0.0, 0.0, "wall") for time in times]
    count = count_collisions(contacts)
    assert count_collisions(contacts[::-1]) == count
    assert (count > 0) == bool(times)
    assert count <= 101
    # contacts far apart in time all count
    apart = [Contact(2.0 * i, 0.0, 0.0, "wall") for i in range(len(times))]
    assert count_collisions(apart) == len(times)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=20))
def test_no_path_is_shorter_than_the_straight_line(points: list[tuple[float, float]]) -> None:
    way = np.array(points)
    assume(len(way) >= 2)
    assert path_length(way) >= math.dist(points[0], points[-1]) - 1e-9
    assert path_length(way[::-1]) == pytest.approx(path_length(way))
    turned = way @ np.array([[0.6, 0.8], [-0.8, 0.6]])
    assert path_length(turned) == pytest.approx(path_length(way))
