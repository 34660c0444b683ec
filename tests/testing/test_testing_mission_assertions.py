"""Assertions on the run of a mission: when they hold, and what they say when they do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from navfw.errors import UnknownNameError
from navfw.missions import MissionVerdict, Outcome, measure
from navfw.numerics import Array
from navfw.recording import Contact, RunLogger
from navfw.signals import Pose, Twist
from navfw.testing import (
    MissionRun,
    assert_behavior_led,
    assert_clearance,
    assert_no_collision,
    assert_reached,
    assert_visited,
)
from navfw.testing.driven_run import DrivenRun
from navfw.testing.mission_case import MissionCase


class _Wall:
    """Everything is 0.45 m away."""

    def clearances(self, points: Array) -> Array:
        return np.full(len(points), 0.45)


@pytest.fixture
def run() -> MissionRun:
    """From x = 0 to 4 m and back to 2 m in 6 s, led by `go` for 4 s, then by `turn`."""
    logger = RunLogger()
    for tick in range(61):
        pose = Pose(min(tick, 80 - tick) / 10, 0.0, 0.0)
        leader = "go" if tick < 40 else "turn"
        logger.add(tick / 10, pose, pose, Twist(1.0, 0.0), leader, emergency=False)
    log = logger.log()
    metrics = measure(
        log,
        _Wall(),
        start=(0.0, 0.0),
        goal=(2.0, 0.0),
        within=0.5,
        shortest=2.0,
        discs=((0.0, 0.0, 0.2),),
        succeeded=True,
    )
    driven = DrivenRun(
        world="hall",
        mission="there",
        stack="default",
        stack_named=False,
        verdict=MissionVerdict(Outcome.REACHED, "stopped 0.1 m from b", "turn", 60, 6.0),
        metrics=metrics,
        faults=(),
        events=(),
        behaviors=("go", "turn", "avoid"),
        places={"a": (0.0, 0.0), "b": (2.0, 0.0), "c": (4.0, 0.3), "far": (9.0, 0.0)},
        explanation={},
        log=log,
    )
    return MissionRun(MissionCase("hall", "there"), driven, Path("unused"))


def test_the_goals_are_reached(run: MissionRun) -> None:
    assert_reached(run)
    verdict = MissionVerdict(Outcome.STUCK, "no way", "turn", 60, 6.0)
    run.run = replace(run.run, verdict=verdict)
    with pytest.raises(
        AssertionError, match=r"reached; stuck after 6\.0 s: no way \(leading .*turn"
    ):
        assert_reached(run)


def test_nothing_is_touched(run: MissionRun) -> None:
    assert_no_collision(run)
    log = replace(run.log, contacts=(Contact(2.5, 2.5, 0.0, "chest"),))
    run.run = replace(run.run, log=log)
    with pytest.raises(AssertionError, match=r"touched chest at \(2\.50, 0\.00\) after 2\.5 s"):
        assert_no_collision(run)


def test_the_clearance_is_kept(run: MissionRun) -> None:
    assert_clearance(run, 0.2)
    with pytest.raises(AssertionError, match=r"at least 0\.3 m; the smallest was 0\.250 m"):
        assert_clearance(run, 0.3)


def test_places_are_visited_in_order(run: MissionRun) -> None:
    assert_visited(run, "a", "b", "c", "b")
    assert_visited(run, (3.0, 0.0), "c", (3.0, 0.0))
    with pytest.raises(AssertionError, match=r"within 0\.5 m of a after 3\.6 s.*was 2\.00 m"):
        assert_visited(run, "c", "a")
    with pytest.raises(AssertionError, match=r"of far; its smallest distance was 5\.00 m"):
        assert_visited(run, "far")
    with pytest.raises(AssertionError, match=r"smallest distance was 0\.30 m"):
        assert_visited(run, "c", within=0.2)
    with pytest.raises(UnknownNameError, match="place 'fat': did you mean 'far'"):
        assert_visited(run, "fat")


def test_a_behavior_led(run: MissionRun) -> None:
    assert_behavior_led(run, "go", 3.9)
    assert_behavior_led(run, "turn")
    with pytest.raises(AssertionError, match=r"5 s, got 4\.0 s; led: go 4\.0 s, turn 2\.1 s"):
        assert_behavior_led(run, "go", 5)
    with pytest.raises(AssertionError, match=r"avoid to lead for at least 0\.1 s, got 0\.0 s"):
        assert_behavior_led(run, "avoid")
    with pytest.raises(UnknownNameError, match="did you mean 'turn'"):
        assert_behavior_led(run, "tur")
