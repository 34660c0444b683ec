"""Assertions on the run of a mission: when they hold, and what they say when they do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from navfw.errors import UnknownNameError
from navfw.missions import MissionVerdict, Outcome, measure
from navfw.recording import Contact, RunLogger
from navfw.signals import Pose, Twist
from navfw.sim import BoxSpec, SceneGeometry, WorldSpec
from navfw.testing import (
    MissionRun,
    assert_behavior_led,
    assert_clearance,
    assert_no_collision,
    assert_reached,
    assert_visited,
)
from navfw.testing.mission_case import MissionCase

WALL = BoxSpec(name="wall", at=(0.0, 0.55), size=(19.0, 0.2, 1.0))
"""It is 0.45 m away from the x axis."""


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
        SceneGeometry.from_world(WorldSpec(name="w", x=(-9.0, 9.0), y=(-9.0, 9.0), boxes=(WALL,))),
        start=(0.0, 0.0),
        goal=(2.0, 0.0),
        within=0.5,
        shortest=2.0,
        discs=((0.0, 0.0, 0.2),),
        succeeded=True,
    )
    return MissionRun(
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
        case=MissionCase("hall", "there"),
        folder=Path("unused"),
    )


def test_the_goals_are_reached(run: MissionRun) -> None:
    assert_reached(run)
    verdict = MissionVerdict(Outcome.STUCK, "no way", "turn", 60, 6.0)
    stuck = r"reached; stuck after 6\.0 s: no way \(leading .*turn"
    with pytest.raises(AssertionError, match=stuck):
        assert_reached(replace(run, verdict=verdict))


def test_nothing_is_touched(run: MissionRun) -> None:
    assert_no_collision(run)
    log = replace(run.log, contacts=(Contact(2.5, 2.5, 0.0, "chest"),))
    with pytest.raises(AssertionError, match=r"touched chest at \(2\.50, 0\.00\) after 2\.5 s"):
        assert_no_collision(replace(run, log=log))


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
