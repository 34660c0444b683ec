"""Mission files and unknown starts: content, draw of the start, runs; the errors for wrong ones."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scripted_run import FakeSimulator, ScriptedPilot

from navfw.config import find, list_files
from navfw.config.lookup import NamedFile, list_missions
from navfw.errors import ConfigError, InputError, UnknownNameError, WorldError
from navfw.missions import MissionLoop, prepare
from navfw.missions.missionfile import (
    Destination,
    MissionFile,
    draw_start,
    load_mission,
    mission_to,
)
from navfw.missions.outcome import Outcome
from navfw.missions.run_metrics import RunMetrics, measure
from navfw.missions.runner import Task
from navfw.missions.session_setup import chosen_stack
from navfw.recording.run_observers import RunLog, RunLogger
from navfw.robot import RobotModel
from navfw.signals import Belief, Pose, Twist, Waypoint
from navfw.sim import SceneGeometry, SensorParams, WorldSpec, load_world
from navfw.sim.sensor_models import PRESETS
from navfw.sim.worldspec import BoxSpec
from navfw.stack import StackState
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.map_formats import save_map

HERE = Pose(0.0, 0.0, 0.0)
GOOD = """\
description: a test
map: office
start: [1.2, 1.2, 0.6]
goals: [lab]
timeout: 60
"""
KNOWN = "map: office\nstart: [1.2, 1.2, 0.6]\ngoals: [lab]"


@pytest.fixture(scope="module")
def office() -> SceneGeometry:
    return SceneGeometry.from_world(load_world(find("world", "office")))


def mission(folder: Path, text: str) -> MissionFile:
    file = folder / "mission.yaml"
    file.write_text(text)
    return load_mission(file)


def test_places_and_points_become_waypoints(tmp_path: Path) -> None:
    text = GOOD.replace("[lab]", "[lab, {x: 1.5, y: 1.25}]")
    loaded = mission(tmp_path, text)
    place = loaded.topo_map.places["lab"]
    assert (loaded.start.x, loaded.start.y, loaded.start.yaw) == (1.2, 1.2, 0.6)
    assert [(w.x, w.y, w.place) for w in loaded.goals] == [
        (place.x, place.y, "lab"),
        (1.5, 1.25, ""),
    ]
    assert {(w.kind, w.final, w.tolerance) for w in loaded.goals} == {("goal", True, 0.4)}
    loaded = mission(tmp_path, GOOD.replace("[1.2, 1.2, 0.6]", "{place: kitchen, yaw: 1.5}"))
    place = loaded.topo_map.places["kitchen"]
    assert (loaded.start.x, loaded.start.y, loaded.start.yaw) == (place.x, place.y, 1.5)


def test_without_a_map_the_goals_are_the_map(tmp_path: Path) -> None:
    text = "start: [0, 0, 0]\ngoals: [{x: 3, y: 4}, {x: 3, y: 0}, {x: 3, y: 4}]\n"
    loaded = mission(tmp_path, text)
    assert [(p.x, p.y) for p in loaded.topo_map.places.values()] == [(0, 0), (3, 4), (3, 0)]
    lengths = sorted(passage.length for passage in loaded.topo_map.passages)
    assert lengths == pytest.approx([4.0, 5.0])


@pytest.mark.parametrize("preset", PRESETS)
def test_the_robot_has_the_error_data_of_its_sensors(tmp_path: Path, preset: str) -> None:
    text = GOOD + f"sensors: {{preset: {preset}, slip: 0.123}}\n"
    sheet = SensorParams.preset(preset).sheet
    assert mission(tmp_path, text).spec.robot.odometry == sheet  # without the changes to the preset
    given = mission(tmp_path, text + "robot: {odometry: {gyro_noise: 0.02}}\n").spec.robot.odometry
    assert given == sheet.model_copy(update={"gyro_noise": 0.02})
    assert mission(tmp_path, GOOD).spec.robot.odometry == RobotModel().odometry


def test_sensors_begin_with_a_preset(tmp_path: Path) -> None:
    text = GOOD + "sensors: {preset: perfect, slip: 0.1}\n"
    sensors = mission(tmp_path, text).spec.sensors.resolved()
    assert (sensors.slip, sensors.gyro_noise, sensors.image_noise) == (0.1, 0.0, 0.0)
    usual = mission(tmp_path, GOOD).spec.sensors.resolved()
    assert usual.gyro_noise > 0.0


@pytest.mark.parametrize(
    ("old", "new", "error", "line", "message"),
    [
        ("[lab]", "[labb]", UnknownNameError, 4, "did you mean 'lab'?"),
        ("[lab]", "[]", ConfigError, 4, "goals"),
        ("[lab]", "[{x: 1}]", ConfigError, 4, "y"),
        ("map: office", "map: ofice", UnknownNameError, 2, "did you mean 'office'?"),
        ("map: office\n", "", ConfigError, 3, "the place 'lab' needs a map"),
        ("[1.2, 1.2, 0.6]", "{place: loby}", UnknownNameError, 3, "did you mean 'lobby'?"),
        ("[1.2, 1.2, 0.6]", "[1.2, 1.2]", ConfigError, 3, "start"),
        ("timeout: 60", "timeout: -1", ConfigError, 5, "timeout"),
        ("timeout: 60", "timeout: soon", ConfigError, 5, "timeout"),
        ("timeout: 60", "time_out: 60", ConfigError, 5, "did you mean 'timeout'?"),
        ("timeout: 60", "sensors: {preset: bad}", ConfigError, 5, "good"),
        ("timeout: 60", "sensors: {gyro_nois: 1}", ConfigError, 5, "did you mean 'gyro_noise'?"),
        ("timeout: 60", "robot: {radius: 0}", ConfigError, 5, "radius"),
        ("timeout: 60", "tolerance: .nan", ConfigError, 5, "tolerance"),
        ("[1.2, 1.2, 0.6]", "somewhere", ConfigError, 3, "unknown"),
        ("[1.2, 1.2, 0.6]", "{unknown: [kichen]}", UnknownNameError, 3, "'kitchen'"),
        ("[1.2, 1.2, 0.6]", "{unknown: []}", ConfigError, 3, "start"),
        (KNOWN, "start: unknown\ngoals: [{x: 1, y: 2}]", ConfigError, 2, "map: NAME"),
    ],
)
def test_a_wrong_file_is_named_with_line_and_remedy(
    tmp_path: Path, old: str, new: str, error: type[InputError], line: int, message: str
) -> None:
    with pytest.raises(error) as caught:
        mission(tmp_path, GOOD.replace(old, new))
    assert f"mission.yaml:{line}" in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "message"),
    [
        ("[1.2, 1.2, 0.6]", "[5.0, 3.0, 0]", 3, "start", "lobby-meeting-wall"),
        ("[1.2, 1.2, 0.6]", "[1.2, 0.2, 0]", 3, "start", "0.18"),
        ("[1.2, 1.2, 0.6]", "[-3, 1, 0]", 3, "start", "floor"),
        ("[lab]", "[lab, {x: 5, y: 3}]", 4, "goals[1]", "lobby-meeting-wall"),
        ("[lab]", "[{x: 40, y: 3}]", 4, "goals[0]", "floor"),
        ("timeout: 60", "robot: {radius: 0.49, track: 0.5}", 4, "goals[0]", "reached"),
    ],
)
def test_what_is_impossible_in_the_world_is_named(
    tmp_path: Path, office: SceneGeometry, old: str, new: str, line: int, key: str, message: str
) -> None:
    loaded = mission(tmp_path, GOOD.replace(old, new))
    with pytest.raises(WorldError) as caught:
        loaded.check(office)
    assert f"mission.yaml:{line}: {key}: " in str(caught.value)
    assert message in str(caught.value)


def test_the_shortest_path_leads_through_all_goals_in_order(
    tmp_path: Path, office: SceneGeometry
) -> None:
    loaded = mission(tmp_path, GOOD)
    length, (lab,) = loaded.check(office), loaded.goals
    assert length > math.hypot(lab.x - 1.2, lab.y - 1.2)
    and_back = GOOD.replace("[lab]", "[lab, {x: 1.2, y: 1.2}]")
    assert mission(tmp_path, and_back).check(office) == pytest.approx(2.0 * length, rel=0.01)


SHIPPED = [
    (world.name, found) for world in list_files("world") for found in list_missions(world.name)
]


@pytest.mark.parametrize(("world", "found"), SHIPPED, ids=[f"{w}/{f.name}" for w, f in SHIPPED])
def test_every_shipped_mission_is_possible(world: str, found: NamedFile) -> None:
    spec = load_world(find("world", world))
    loaded = load_mission(found.path)
    shortest = loaded.check(SceneGeometry.from_world(spec))
    assert loaded.spec.description
    assert shortest > 2.0 * loaded.spec.success.within
    # at least twice the time at top speed
    assert loaded.spec.timeout > 2.0 * shortest / loaded.spec.robot.max_v


PLAIN = "start: [1, 1, 0]\ngoals: [{x: 2, y: 1}]\n"


def test_a_mission_may_name_its_stack(tmp_path: Path) -> None:
    file = mission(tmp_path, f"stack: landmarcs\n{PLAIN}").file
    with pytest.raises(UnknownNameError, match="landmarks") as caught:
        prepare("empty", file)
    assert (caught.value.line, caught.value.key) == (1, "stack")
    mission(tmp_path, f"stack: oracle\n{PLAIN}")
    assert prepare("empty", file).stack_file.stem == "oracle"
    assert prepare("empty", file, stack="paper").stack_file.stem == "paper"


@pytest.mark.parametrize(("named", "stack"), [("office", "floor_plan"), ("paper-room", "default")])
def test_a_mission_without_a_stack_is_localised_on_the_floor_plan_of_its_map(
    tmp_path: Path, named: str, stack: str
) -> None:
    text = f"map: {named}\n{PLAIN}"
    assert chosen_stack(mission(tmp_path, text)).stem == stack
    assert chosen_stack(mission(tmp_path, f"stack: landmarks\n{text}")).stem == "landmarks"
    unknown = text.replace("start: [1, 1, 0]", "start: unknown")
    expected = "landmarks" if stack == "floor_plan" else stack  # the office has markers
    assert chosen_stack(mission(tmp_path, unknown)).stem == expected


ANYWHERE = "map: office\nstart: unknown\ngoals: [lab]\n"
TWO = "map: office\nstart: {unknown: [kitchen, lobby]}\ngoals: [lab]\n"
STACK = """\
base: default
localizer: {topological: }
composite: {search: }
behaviors: {look_around: , explore: }
"""


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
    loaded = mission(tmp_path, TWO)
    assert {place.name for place in loaded.starts} == {"kitchen", "lobby"}
    drawn_x = {loaded.placed(seed, office).start.x for seed in range(20)}
    assert drawn_x == {place.x for place in loaded.starts}
    known = mission(tmp_path, ANYWHERE.replace("unknown", "{place: kitchen}"))
    assert known.start_known
    assert known.placed(3, office) is known


def test_places_that_are_not_free_are_skipped() -> None:
    places = [Place("taken", 0.0, 0.0), Place("free", 1.0, 0.0)]
    chest = BoxSpec(name="chest", at=(0.0, 0.0), size=(0.4, 0.4, 0.4))
    plan = SceneGeometry.from_world(WorldSpec(name="hall", x=(-2, 2), y=(-2, 2), boxes=(chest,)))
    assert {draw_start(places, seed, plan, 0.2).x for seed in range(10)} == {1.0}
    with pytest.raises(WorldError, match=r"the start 'taken'.*chest"):
        draw_start(places[:1], 0, plan, 0.2)


class Clueless(ScriptedPilot):
    """Turns on the spot with a lost belief, for 3 s."""

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        assert pose is None
        super().start(pose, goals)
        belief = Belief(0.0, HERE, np.eye(3), confidence=0.1, lost=True, hypotheses=3)
        self.state = StackState(0.0, belief=belief)


def measured(log: RunLog) -> RunMetrics:
    """The metrics of a run in an empty world."""
    plan = SceneGeometry((-9.0, -9.0, 9.0, 9.0), ())
    place = (0.0, 0.0)
    return measure(
        log,
        plan,
        start=place,
        goal=place,
        within=0.5,
        shortest=1.0,
        with_room=1.0,
        discs=(),
        succeeded=False,
    )


def test_a_lost_belief_at_the_timeout_is_the_outcome_lost() -> None:
    start = Pose(3.0, 1.0, 0.0)
    goal = Waypoint(5.0, 1.0, 0.3, "there", "goal", final=True)
    task = Task(RobotModel(), start, (goal,), timeout=3.0, start_known=False)
    run = MissionLoop(task, Clueless([Twist(0.0, 0.5)] * 999), FakeSimulator(start)).run()
    assert run.verdict.outcome is Outcome.LOST
    assert "position estimate lost: 3 places fit" in run.verdict.reason
    numbers = measured(run.log)
    assert numbers.localized_after_s is None
    assert numbers.estimate_error_p95_m is None
    assert numbers.lost_s == pytest.approx(3.0, abs=0.1)


def test_localization_metrics_have_the_times_of_correct_and_wrong_beliefs() -> None:
    """Lost for 2 s, confident and wrong for 1 s, then correct with 0.2 m error; at 0.5 m/s."""
    recorder = RunLogger()
    for tick in range(601):
        time = tick / 60.0
        lost, confidence = time < 2.0, 0.3 if time < 2.0 else 0.95
        belief = Belief(time, HERE, np.eye(3), {}, confidence, lost, updates=tick // 60)
        true = Pose(0.5 * time, 0.0, 0.0)
        estimate = Pose(true.x + (5.0 if time < 3.0 else 0.2), 0.0, 0.0)
        recorder.add(time, true, estimate, Twist(0.5, 0.0), "", False, belief)
    numbers = measured(recorder.log())
    assert numbers.localized_after_s == pytest.approx(3.0, abs=0.11)
    assert numbers.localized_after_m == pytest.approx(1.5, abs=0.06)
    assert numbers.confidently_wrong_s == pytest.approx(1.0, abs=0.11)
    assert numbers.lost_s == pytest.approx(2.0, abs=0.11)
    assert numbers.estimate_error_p50_m == pytest.approx(0.2)
    assert numbers.estimate_error_p95_m == pytest.approx(5.0)
    assert numbers.landmark_updates == 10


def test_a_stack_that_cannot_find_its_start_refuses_the_mission(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot find an unknown start"):
        prepare("office", mission(tmp_path, ANYWHERE).file, seed=1, stack="default").run()


def test_without_a_visible_landmark_the_robot_turns_and_has_no_plan(tmp_path: Path) -> None:
    file, stack = mission(tmp_path, ANYWHERE + "timeout: 6\n").file, tmp_path / "seeker.yaml"
    stack.write_text(STACK)
    session = prepare("office", file, seed=1, stack=stack)
    result = session.run()
    assert result.outcome is Outcome.LOST
    assert session.stack.state.path == ()
    assert session.stack.state.waypoint is None
    assert result.verdict.behavior == "look_around"
    turned = np.abs(np.diff(np.unwrap(result.log.true[:, 2]))).sum()
    assert turned > math.pi / 2
    summary = result.summary()
    assert summary["localized_after_s"] is None
    assert summary["landmark_updates"] == 0


def test_a_destination_is_a_place_or_a_point_of_any_map(tmp_path: Path) -> None:
    lab = mission_to("office", Destination("lab"))
    first = load_mission(list_missions("office")[0].path)
    assert lab.goals[0].place == "lab"
    assert (lab.start, lab.topo_map.name) == (first.start, first.topo_map.name)
    # a map that someone else made, which does not know the place to start from
    own = tmp_path / "own.yaml"
    start = first.start
    save_map(
        TopoMap(
            "own",
            [Place("a", start.x, start.y), Place("b", start.x + 1.0, start.y)],
            [Passage("a", "b", 1.0)],
        ),
        own,
    )
    there = mission_to("office", Destination("b", str(own)))
    assert (there.topo_map.name, there.start) == ("own", start)
    assert there.spec.stack is None, "what the map contains decides"
    to_point = mission_to("office", Destination((2.0, 2.0), str(own)))
    assert (to_point.goals[0].x, to_point.goals[0].place) == (2.0, "")
    with pytest.raises(UnknownNameError, match=r"--goal c.*unknown place 'c'"):
        mission_to("office", Destination("c", str(own)))
    save_map(there.topo_map, own.with_suffix(".geojson"))
    other = mission_to("office", Destination("b", str(own.with_suffix(".geojson"))))
    assert other.topo_map.passages == there.topo_map.passages
    with pytest.raises(UnknownNameError, match=r"--map.*unknown map 'own'"):
        mission_to("office", Destination("b", "own"))
