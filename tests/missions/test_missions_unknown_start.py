"""Missions with an unknown start: files, draw of the start, runs, metrics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from navfw.config import find
from navfw.errors import ConfigError, InputError, UnknownNameError, WorldError
from navfw.missions import (
    MissionFile,
    MissionLoop,
    Outcome,
    Task,
    draw_start,
    load_mission,
    measure_localization,
    prepare,
)
from navfw.recording import RunLogger
from navfw.robot import RobotModel
from navfw.signals import Belief, Pose, SensorReading, Twist, Waypoint
from navfw.sim import SceneGeometry, load_world
from navfw.stack import StackState
from navfw.testing.fakes import FakeSimulator
from navfw.topomap import Place

ANYWHERE = "map: office\nstart: unknown\ngoals: [lab]\n"
TWO = "map: office\nstart: {unknown: [kitchen, lobby]}\ngoals: [lab]\n"
STACK = """\
base: default
localizer: {topological: }
composite: {search: }
behaviors: {look_around: , explore: }
"""


@pytest.fixture(scope="module")
def office() -> SceneGeometry:
    return SceneGeometry.from_world(load_world(find("world", "office")))


def mission(folder: Path, text: str) -> MissionFile:
    file = folder / "mission.yaml"
    file.write_text(text)
    return load_mission(file)


def test_an_unknown_start_is_drawn_by_the_seed_among_free_places(
    tmp_path: Path, office: SceneGeometry
) -> None:
    loaded = mission(tmp_path, ANYWHERE)
    assert not loaded.start_known
    starts = [loaded.placed(seed, office).start for seed in range(30)]
    assert starts == [loaded.placed(seed, office).start for seed in range(30)]
    points = {(p.x, p.y): p for p in loaded.topo_map.places.values()}
    drawn = {points[start.x, start.y].name for start in starts}
    assert len(drawn) > 5
    assert "lab" not in drawn
    assert not any(points[start.x, start.y].kind == "door" for start in starts)
    assert len({start.yaw for start in starts}) == 30
    assert all(abs(start.yaw) <= math.pi for start in starts)


def test_the_start_may_be_drawn_among_some_places(tmp_path: Path, office: SceneGeometry) -> None:
    loaded = mission(tmp_path, TWO)
    names = {place.name for place in loaded.starts}
    assert names == {"kitchen", "lobby"}
    drawn = {loaded.placed(seed, office).start.x for seed in range(20)}
    assert drawn == {place.x for place in loaded.starts}


def test_a_known_start_is_never_drawn(tmp_path: Path, office: SceneGeometry) -> None:
    loaded = mission(tmp_path, ANYWHERE.replace("unknown", "{place: kitchen}"))
    assert loaded.start_known
    assert loaded.placed(3, office) is loaded


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (ANYWHERE.replace("unknown", "somewhere"), ConfigError, "unknown"),
        (TWO.replace("kitchen", "kichen"), UnknownNameError, "kitchen"),
        (TWO.replace("[kitchen, lobby]", "[]"), ConfigError, "start"),
        ("start: unknown\ngoals: [{x: 1, y: 2}]\n", ConfigError, "map: NAME"),
    ],
)
def test_a_wrong_start_is_one_clear_error(
    tmp_path: Path, text: str, error: type[InputError], message: str
) -> None:
    with pytest.raises(error, match=message) as caught:
        mission(tmp_path, text)
    assert "mission.yaml" in str(caught.value)


def test_places_that_are_not_free_are_skipped() -> None:
    places = [Place("taken", 0.0, 0.0), Place("free", 1.0, 0.0)]

    def check(place: Place) -> None:
        if place.name == "taken":
            raise WorldError("the start 'taken' overlaps the chest")

    assert {draw_start(places, seed, check).x for seed in range(10)} == {1.0}
    with pytest.raises(WorldError, match="chest"):
        draw_start(places[:1], 0, check)


class Clueless:
    """Turns on the spot with a lost belief."""

    def __init__(self) -> None:
        self.poses: list[Pose | None] = []
        self.state = StackState(0.0)

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        self.poses.append(pose)

    def step(self, reading: SensorReading) -> Twist:
        belief = Belief(reading.time, Pose(0, 0, 0), np.eye(3), confidence=0.1, lost=True)
        self.state = StackState(reading.time, belief=belief)
        return Twist(0.0, 0.5)


def test_a_lost_belief_at_the_timeout_is_the_outcome_lost() -> None:
    start = Pose(3.0, 1.0, 0.0)
    goal = Waypoint(5.0, 1.0, 0.3, "there", "goal", final=True)
    task = Task(RobotModel(), start, (goal,), timeout=3.0, start_known=False)
    pilot = Clueless()
    run = MissionLoop(task, pilot, FakeSimulator(start)).run()
    assert pilot.poses == [None]
    assert run.verdict.outcome is Outcome.LOST
    assert "position estimate lost" in run.verdict.reason
    numbers = measure_localization(run.log, run.log.every(0.1))
    assert numbers.localized_after_s is None
    assert numbers.estimate_error_p95_m is None
    assert numbers.lost_s == pytest.approx(3.0, abs=0.1)


def test_localization_metrics_have_the_times_of_correct_and_wrong_beliefs() -> None:
    """Lost for 2 s, confident and wrong for 1 s, then correct with 0.2 m error; at 0.5 m/s."""
    recorder = RunLogger()
    for tick in range(601):
        time = tick / 60.0
        lost, wrong = time < 2.0, 2.0 <= time < 3.0
        off = 5.0 if lost or wrong else 0.2
        belief = Belief(
            time,
            Pose(0, 0, 0),
            np.eye(3),
            confidence=0.3 if lost else 0.95,
            lost=lost,
            updates=tick // 60,
        )
        true = Pose(0.5 * time, 0.0, 0.0)
        estimate = Pose(0.5 * time + off, 0.0, 0.0)
        recorder.add(time, true, estimate, Twist(0.5, 0.0), "", False, belief)
    log = recorder.log()
    numbers = measure_localization(log, log.every(0.1))
    assert numbers.localized_after_s == pytest.approx(3.0, abs=0.11)
    assert numbers.localized_after_m == pytest.approx(1.5, abs=0.06)
    assert numbers.confidently_wrong_s == pytest.approx(1.0, abs=0.11)
    assert numbers.lost_s == pytest.approx(2.0, abs=0.11)
    assert numbers.estimate_error_p50_m == pytest.approx(0.2)
    assert numbers.estimate_error_p95_m == pytest.approx(5.0)
    assert numbers.landmark_updates == 10


def test_a_stack_that_cannot_find_its_start_refuses_the_mission(tmp_path: Path) -> None:
    file = tmp_path / "find.yaml"
    file.write_text(ANYWHERE)
    with pytest.raises(InputError, match="cannot find an unknown start"):
        prepare("office", file, seed=1, stack="default").run()


def test_without_a_visible_landmark_the_robot_turns_and_has_no_plan(tmp_path: Path) -> None:
    (tmp_path / "find.yaml").write_text(ANYWHERE + "timeout: 6\n")
    (tmp_path / "seeker.yaml").write_text(STACK)
    session = prepare("office", tmp_path / "find.yaml", seed=1, stack=tmp_path / "seeker.yaml")
    result = session.run()
    assert result.outcome is Outcome.LOST
    assert session.stack.state.path == ()
    assert session.stack.state.waypoint is None
    assert result.run.verdict.behavior == "look_around"
    turned = np.abs(np.diff(np.unwrap(result.run.log.true[:, 2]))).sum()
    assert turned > math.pi / 2
    summary = result.summary()
    assert summary["localized_after_s"] is None
    assert summary["landmark_updates"] == 0
