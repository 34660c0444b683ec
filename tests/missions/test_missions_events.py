"""Events of missions: their schema and checks, their times, pairs of them; their effect."""

import math
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from cli_calls import refusal

from navfw.errors import InputError
from navfw.missions import MissionResult, prepare
from navfw.missions.mission_events import EventClock
from navfw.missions.missionspec import EventSpec, NearTrigger
from navfw.missions.run_report import write_run
from navfw.recording import RunFolder, read_result
from navfw.recording.explanations import explain_at
from navfw.recording.run_replay import replay
from navfw.signals import Pose
from navfw.sim.event_actions import CameraFault, GyroFault
from navfw.topomap import Place

MISSION = """\
start: [1, 1.5, 0.3]
goals: [{x: 2, y: 1.5}]
timeout: 60
events:
  - {at: 0, camera: {noisy: 3}}
  - %s
"""
HERE = Pose(0.0, 0.0, 0.0)


def mission(folder: Path, *events: str) -> Path:
    file = folder / "events.yaml"
    file.write_text(MISSION % "\n  - ".join(events))
    return file


# --- the file ------------------------------------------------------------------------------------

WRONG = [
    ("{at: -1, camera: black}", "events[1].at", "expected a number >= 0"),
    ("{at: 70, camera: black}", "events[1].at", "before the mission's timeout, 60 s, got 70"),
    ("{at: soon, camera: black}", "events[1].at", "got the text 'soon'"),
    ("{att: 1, camera: black}", "events[1].att", "did you mean 'at'?"),
    ("{camera: black}", "events[1]", "exactly one of at, near; got none"),
    ("{at: 1}", "events[1]", "obstacle, plugin; got none of them"),
    ("{at: 1, camera: black, gyro: dropout}", "events[1]", "got camera and gyro"),
    ("{at: 1, near: {x: 1, y: 1, within: 1}, camera: black}", "events[1]", "got at and near"),
    ("{at: 1, lasting: 0, camera: black}", "events[1].lasting", "expected a number > 0"),
    ("{at: 1, lasting: -3, camera: black}", "events[1].lasting", "expected a number > 0"),
    ("{near: {place: strat, within: 1}, camera: black}", "events[1].near.place", "'start'?"),
    ("{near: {x: 1, within: 1}, camera: black}", "events[1].near", "either place, or x and y"),
    ("{near: {x: 1, y: 1}, camera: black}", "events[1].near.within", "missing"),
    ("{at: 1, camera: blak}", "events[1].camera", "did you mean 'black'?"),
    ("{at: 1, camera: noisy}", "events[1].camera", "needs a value"),
    ("{at: 1, camera: {dropped: 1.5}}", "events[1].camera.dropped", "<= 1"),
    ("{at: 1, camera: {droped: 0.5}}", "events[1].camera.droped", "did you mean 'dropped'?"),
    ("{at: 1, camera: {dropped: 0.5, noisy: 3}}", "events[1].camera", "got dropped and noisy"),
    ("{at: 1, encoders: {dropout: lft}}", "events[1].encoders.dropout", "did you mean 'left'?"),
    ("{at: 1, weak_wheel: {side: left, share: 2}}", "events[1].weak_wheel.share", "<= 1"),
    ("{at: 1, slippery: {slip: 0}}", "events[1].slippery.slip", "> 0"),
    ("{at: 1, light: {share: -1}}", "events[1].light.share", ">= 0"),
    ("{at: 1, behavior: {name: avod, does: hangs}}", "events[1].behavior.name", "'avoid'?"),
    ("{at: 1, behavior: {name: avoid, does: hang}}", "events[1].behavior.does", "'hangs'?"),
    ("{at: 1, textureless: {name: outer-wal}}", "events[1].textureless.name", "'outer-wall'?"),
    ("{at: 1, textureless: {}}", "events[1].textureless", "expected a name, or x or y"),
    ("{at: 1, textureless: {x: [3, 2]}}", "events[1].textureless.x", "must ascend"),
    ("{at: 1, door: {name: exit, state: open}}", "events[1].door.name", "unknown door 'exit'"),
    ("{at: 1, obstacle: {radius: 0.2}}", "events[1].obstacle", "exactly one of at and ahead"),
    ("{at: 1, obstacle: {ahead: 1}}", "events[1].obstacle", "exactly one of size and radius"),
    ("{at: 1, obstacle: {at: [2, 99], radius: 0.2}}", "events[1].obstacle.at", "off the floor"),
    ("{at: 1, obstacle: {name: chest, ahead: 1, radius: 0.2}}", "events[1].obstacle.name", "taken"),
    (
        "{at: 1, obstacle: {ahead: 1, radius: 0.2, texture: ston}}",
        "events[1].obstacle.texture",
        "did you mean 'stone'?",
    ),
]


@pytest.mark.parametrize(("event", "key", "message"), WRONG, ids=[event for event, _, _ in WRONG])
def test_a_wrong_event_is_named_with_line_key_and_remedy(
    tmp_path: Path, event: str, key: str, message: str
) -> None:
    with pytest.raises(InputError) as caught:
        prepare("paper-room", mission(tmp_path, event))
    assert f"events.yaml:6: {key}: " in str(caught.value)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_obstacles_need_two_names(tmp_path: Path) -> None:
    thing = "{at: 1, obstacle: {ahead: 1, radius: 0.2}}"
    with pytest.raises(InputError, match=r"events.yaml:7: events\[2\].obstacle.name: .* taken"):
        prepare("paper-room", mission(tmp_path, thing, thing))


HOLE = "mission.drops=[{name: shaft, x: [2.0, 2.6], y: [2.0, 2.6]}]"


@pytest.mark.parametrize("shape", ["radius: 0.2", "size: [0.5, 0.3], yaw: 0.7"])
def test_an_obstacle_over_a_drop_is_refused(tmp_path: Path, shape: str) -> None:
    file = mission(tmp_path, f"{{at: 1, obstacle: {{at: [1.9, 2.3], {shape}}}}}")
    with pytest.raises(InputError) as caught:
        prepare("paper-room", file, overrides=[HOLE])
    text = str(caught.value)
    assert "events.yaml:6: events[1].obstacle.at: 'obstacle' would have no floor" in text
    assert "at 'shaft', x [2.0, 2.6] y [2.0, 2.6] [m]; move it" in text
    assert prepare("paper-room", file).events  # possible without the drop


def test_an_obstacle_beside_a_drop_needs_another_name(tmp_path: Path) -> None:
    thing = "{at: 1, obstacle: {name: %s, at: [1.7, 2.3], radius: 0.2}}"
    assert prepare("paper-room", mission(tmp_path, thing % "carton"), overrides=[HOLE]).events
    with pytest.raises(InputError, match=r"events\[1\].obstacle.name: .*'shaft' is taken"):
        prepare("paper-room", mission(tmp_path, thing % "shaft"), overrides=[HOLE])


def test_a_wrong_event_is_bad_input_on_the_command_line(tmp_path: Path) -> None:
    out = tmp_path / "out"
    event = "mission.events=[{at: 1, camera: blak}]"
    refusal("run", "paper-room", "through-the-door", "--set", event, "--out", out)
    assert not out.exists()


def test_a_door_that_an_event_opens_may_be_on_the_only_path(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text("""
name: gate
x: [0, 6]
y: [0, 3]
walls:
  - {name: fence, points: [[3, 0], [3, 3]], openings: [{name: gap, at: [3, 1.5], width: 1}]}
doors:
  - {name: gate, opening: gap, state: closed}
""")
    file = tmp_path / "through.yaml"
    text = "start: [1, 1.5, 0]\ngoals: [{x: 5, y: 1.5}]\nevents: [%s]\n"
    file.write_text(text % "")
    with pytest.raises(InputError, match="cannot be reached"):
        prepare(tmp_path / "world.yaml", file)
    file.write_text(text % "{at: 5, door: {name: gate, state: open}}")
    assert prepare(tmp_path / "world.yaml", file).shortest == pytest.approx(4.0, abs=0.05)


# --- the times ----------------------------------------------------------------------------------


def target_of(active: list[object]) -> Any:
    """A target that keeps in ``active`` which actions have begun and not ended."""
    return SimpleNamespace(begin=active.append, end=active.remove)


def test_events_begin_and_end_by_simulated_time() -> None:
    active: list[object] = []
    black, out = CameraFault(black=True), GyroFault(dropout=True)
    events = EventSpec(at=2.0, lasting=3.0, camera=black), EventSpec(at=4.0, gyro=out)
    clock = EventClock([(event, target_of(active)) for event in events])
    ticks: dict[object, list[int]] = {black: [], out: []}
    for tick in range(80):
        clock.tick(0.1 * tick, HERE)
        for action in active:
            ticks[action].append(tick)
    assert ticks == {black: list(range(20, 50)), out: list(range(40, 80))}
    first, second = map(asdict, clock.log)
    given = {"at": 2.0, "lasting": 3.0, "camera": {"black": True}}
    assert first == {"event": given, "began_s": 2.0, "ended_s": 5.0}
    assert second["ended_s"] is None


def test_an_event_near_a_point_happens_once() -> None:
    active: list[object] = []
    black = CameraFault(black=True)
    near = NearTrigger(place="lab", within=0.5)
    event = EventSpec(near=near, lasting=0.3, camera=black)
    clock = EventClock([(event, target_of(active))], {"lab": Place("lab", 1.0, 1.0)})
    clock.tick(0.0, HERE)
    assert not active
    clock.tick(0.1, Pose(0.6, 0.8, 0.0))
    assert active == [black]
    for tick in range(2, 9):
        clock.tick(0.1 * tick, Pose(1.0, 1.0, 0.0))
    assert not active
    assert len(clock.log) == 1


# --- the effect on the robot ---------------------------------------------------------------------


def run(*events: str, timeout: float = 40.0, record: bool = False) -> MissionResult:
    overrides = [f"mission.events=[{', '.join(events)}]", f"mission.timeout={timeout}"]
    overrides.append("mission.stuck_after=30")
    return prepare("paper-room", "through-the-door", seed=2, overrides=overrides).run(record=record)


@pytest.mark.thorough
def test_a_failing_behaviour_is_recorded_and_fails_again_in_the_replay(tmp_path: Path) -> None:
    result = run(
        "{at: 2, lasting: 1, behavior: {name: avoid, does: raises}}",
        "{at: 3.5, lasting: 1, behavior: {name: go_to_xy, does: returns_nan}}",
        "{near: {x: 0, y: 0, within: 30}, lasting: 6, behavior: {name: follow_wall, does: hangs}}",
        "{at: 5, lasting: 0.5, camera: frozen}",
        timeout=7,
        record=True,
    )
    assert result.outcome == "timeout"
    faults = {fault.partition(":")[0].split()[-1]: fault for fault in result.faults}
    assert set(faults) == {"avoid", "go_to_xy", "follow_wall"}
    assert "10 times" in faults["avoid"]
    assert "took too long" in faults["follow_wall"]
    with RunFolder(tmp_path / "run") as folder:
        write_run(result, folder)
    assert folder.final is not None
    events = read_result(folder.final)["events"]
    assert [event["began_s"] for event in events] == pytest.approx([0.0, 2.0, 3.5, 5.0], abs=0.02)
    assert events[1]["event"]["behavior"] == {"name": "avoid", "does": "raises"}
    assert replay(folder.final).same
    assert "avoid" not in explain_at(folder.final, 2.5)["behaviors"]
    assert "avoid" in explain_at(folder.final, 4.2)["behaviors"]


@pytest.mark.parametrize(
    ("event", "reason"),
    [
        ("{at: 4, camera: black}", "image is dark"),
        ("{at: 4, camera: frozen}", "frozen"),
        ("{at: 4, camera: {dropped: 1}}", "the camera is silent"),
        ("{at: 4, encoders: {dropout: both}}", "encoders do not count"),
    ],
)
@pytest.mark.slow
def test_a_permanent_sensor_failure_ends_the_mission_without_collision(
    event: str, reason: str
) -> None:
    result = run(event)
    assert result.outcome == "fault"
    assert reason in result.reason
    assert result.collisions == 0
    assert result.verdict.trace == ""


@pytest.mark.parametrize(
    "event",
    [
        "{at: 4, lasting: 4, camera: black}",
        "{at: 4, lasting: 4, camera: {dropped: 1}}",
        "{at: 4, lasting: 4, encoders: {dropout: both}}",
        "{at: 4, encoders: {dropout: left}}",
        "{at: 4, lasting: 5, gyro: dropout}",
        "{at: 4, weak_wheel: {side: right, share: 0.8}}",
        "{at: 0, camera: {latency: 0.2}}",
    ],
)
@pytest.mark.slow
def test_the_mission_continues_after_a_temporary_fault(event: str) -> None:
    result = run(event, timeout=90)
    assert (result.outcome, result.collisions) == ("reached", 0)


@pytest.mark.slow
def test_clearance_includes_temporary_obstacles() -> None:
    metrics = run("{at: 3, lasting: 4, obstacle: {ahead: 0.7, radius: 0.1}}", timeout=7)
    assert metrics.min_clearance_m < 0.55
    assert metrics.collisions == 0
    assert math.isfinite(metrics.clearance_p05_m)
