"""Suite files, seeds, entries with events and families; and the errors for wrong ones."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import suite_samples as samples
from cli_calls import put_files
from suite_plans import planned, suite_file

from navfw import worldgen
from navfw.config import list_files
from navfw.errors import ConfigError, InputError, UnknownNameError, WorldError
from navfw.missions.missionspec import MissionSpec
from navfw.plugins import default_registry
from navfw.sim import WorldSpec
from navfw.sim.worldspec import BoxSpec, Look, TextureSpec
from navfw.suite import load_suite
from navfw.suite.case import draw_difficulty
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_run import run_case
from navfw.suite.suite_summary import summarize
from navfw.suite.suitefile import Expect, parse_seeds
from navfw.topomap import Passage, Place, TopoMap


def test_entries_have_names_and_overrides(tmp_path: Path) -> None:
    text = """
entries:
  - family: rooms
    difficulty: [0.2, 1]
  - world: office
    missions: [lobby-to-lab]
    set: {avoid.spare: 0.1, mission.goals: [lab, {x: 1, y: 2}], sensors.preset: poor}
  - {world: some/where/world.yaml}
  - {worlds: ../imported/barn, name: the barn}
"""
    entries = load_suite(suite_file(tmp_path, text)).spec.entries
    assert [entry.title for entry in entries] == ["rooms", "office", "where", "the barn"]
    assert entries[0].difficulty == (0.2, 1.0)
    assert entries[1].overrides == (
        "avoid.spare=0.1",
        'mission.goals=["lab", {"x": 1, "y": 2}]',
        'sensors.preset="poor"',
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("entries: []", "entries"),
        ("description: nothing", "entries"),
        ("entries: [{}]", "expected exactly one of world, worlds, family; got none of them"),
        ("entries: [{world: a, family: b}]", "got world and family"),
        ("entries: [{world: a, difficulty: 0.5}]", "difficulty is for a family"),
        ("entries: [{world: a, contrast: 3}]", "contrast is for a family"),
        ("entries: [{family: a, contrast: 61}]", "contrast"),
        ("entries: [{family: a, missions: [x]}]", "leave out missions"),
        ("entries: [{family: a, pairs: true}]", "pairs are for worlds that have missions"),
        ("entries: [{family: rooms, difficulty: 1.5}]", "difficulty"),
        ("entries: [{family: rooms, difficulty: [0.9, 0.1]}]", "must ascend"),
        ("entries: [{world: a, mision: b}]", "did you mean 'missions'?"),
        ("entries: [{world: a}, {world: a}]", "entries[1]: a second entry called 'a'"),
        ("entries: [{world: a, name: '../up'}]", "name"),
    ],
)
def test_bad_suites_are_refused_with_file_and_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        load_suite(suite_file(tmp_path, text))
    assert message in str(caught.value)
    assert "mine.yaml:1" in str(caught.value)


def test_an_unknown_suite_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(InputError, match="unknown suite 'ofice': did you mean 'office'"):
        load_suite("ofice")


@pytest.mark.parametrize("name", [suite.name for suite in list_files("suite")])
def test_shipped_suites_can_be_loaded(name: str) -> None:
    assert load_suite(name).spec.description


def test_a_project_can_have_suites(workdir: Path) -> None:
    text = "entries: [{family: rooms}]"
    put_files(workdir, {"navfw.toml": "", "worlds/suites/office.yaml": text})
    assert load_suite("office").spec.entries[0].family == "rooms"
    assert "paper-room" in [suite.name for suite in list_files("suite")]


def test_seeds_are_half_open() -> None:
    assert list(parse_seeds("3:6")) == [3, 4, 5]
    assert list(parse_seeds(" 0 : 1 ")) == [0]


NO_SEEDS = ["", "5", ":", "1:", ":5", "a:b", "-1:5", "5:5", "6:5", "1:2:3", "1.0:2", "0x1:5"]
TOO_MANY = ["0:4294967297", "0:100001", "0:99999999999999999999"]


@pytest.mark.parametrize("text", [*NO_SEEDS, *TOO_MANY, "\u0661:\u0665"])
def test_other_seeds_are_refused_by_name(text: str) -> None:
    with pytest.raises(InputError, match="--seeds"):
        parse_seeds(text)


def test_the_difficulty_depends_on_the_seed_and_fills_its_range() -> None:
    drawn, again = ([draw_difficulty((0.2, 0.8), seed) for seed in range(300)] for _ in range(2))
    assert drawn == again
    values = [value for value in drawn if value is not None]
    assert 0.2 <= min(values) < 0.22
    assert 0.78 < max(values) <= 0.8
    assert draw_difficulty(0.4, 7) == 0.4
    assert draw_difficulty(None, 7) is None


EVENTS = """\
entries:
  - {name: black, family: boxes, difficulty: 0.1, expect: stop,
     events: [{at: 8, camera: black}]}
  - {name: usual, family: boxes, difficulty: 0.1, expect: arrival}
"""


def test_events_of_an_entry_apply_to_its_missions(tmp_path: Path) -> None:
    plan = planned(tmp_path, EVENTS, range(2))
    assert plan.expect == {"black": "stop", "usual": "arrival"}
    black, _, usual, _ = plan.cases
    session = black.session(default_registry())
    (event,) = session.mission.spec.events
    assert (event.at, event.key) == (8.0, "camera")
    assert len(session.events) == 1
    assert usual.session(default_registry()).events == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("camera: black", "camera: blak", "mine.yaml:3: entries[0].events[0].camera: "),
        ("at: 8", "at: -8", "mine.yaml:3: entries[0].events[0].at: "),
        ("expect: stop", "expect: stopp", "did you mean 'stop'?"),
        ("camera: black", "behavior: {name: avod, does: hangs}", "did you mean 'avoid'?"),
    ],
)
def test_wrong_events_are_located_in_the_suite(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises((ConfigError, InputError)) as caught:
        planned(tmp_path, EVENTS.replace(old, new))
    assert message in str(caught.value)
    assert "mine.yaml" in str(caught.value)


def passes(expect: Expect, **changes: Any) -> bool:
    rows = [*(samples.row(seed) for seed in range(9)), samples.row(9, **changes)]
    summary = summarize(rows, {"rooms": expect})["by_entry"]["rooms"]
    assert summary["expect"] == expect
    assert summary["passed"] >= 9
    return bool(summary["passes"])


def test_nine_arrivals_of_ten_pass() -> None:
    assert passes("arrival", outcome="collided", collisions=1)
    rows = [samples.row(seed, outcome="reached" if seed < 8 else "stuck") for seed in range(10)]
    assert not summarize(rows, {"rooms": "arrival"})["by_entry"]["rooms"]["passes"]
    assert not summarize([], {"none": "arrival"})["by_entry"]["none"]["passes"]


@pytest.mark.parametrize(
    ("changes", "passed"),
    [
        ({"outcome": "fault", "cause": "sensor_failed", "collisions": 0}, True),
        ({"outcome": "fault", "cause": "nothing_seen", "collisions": 0}, True),
        ({"outcome": "stuck", "collisions": 0}, True),
        ({"outcome": "fault", "cause": "exception", "collisions": 0}, False),
        ({"outcome": "fault", "cause": "bad_command", "collisions": 0}, False),
        ({"outcome": "collided", "collisions": 1}, False),
    ],
)
def test_every_stop_has_to_be_without_collision_and_for_a_known_reason(
    changes: dict[str, object], passed: bool
) -> None:
    assert passes("stop", **changes) == passed


# --- families of generated worlds, with a generator in the test: one room, one box ---------------


@dataclass(frozen=True)
class Made:
    world: WorldSpec
    mission: MissionSpec
    topo_map: TopoMap


def fake_generate(
    family: str, seed: int, difficulty: float, contrast: float | None, look: Look | None
) -> Made:
    """The box moves with the seed and grows with the difficulty; seed 13 is impossible.

    Its texture has the contrast, or is brick in a look.
    """
    if family != "boxes":
        raise UnknownNameError("family of worlds", family, ["boxes"])
    if seed == 13:
        raise WorldError("no way through after 100 tries")
    textures = {} if contrast is None else {"wood": TextureSpec(contrast=contrast)}
    if look is not None:
        textures = {"wood": TextureSpec(style="brick")}
    box = BoxSpec(name="box", at=(0.0, 1.0 + 0.1 * seed), size=(0.2 + difficulty, 0.3, 0.8))
    places = [Place("start", -2.0, 0.0), Place("end", 2.0, 0.0)]
    side = (-4.0, 4.0)
    return Made(
        world=WorldSpec(name="boxes", x=side, y=side, boxes=(box,), textures=textures),
        mission=MissionSpec(start=(-2.0, 0.0, 0.0), goals=("end",), timeout=40.0),
        topo_map=TopoMap("boxes", places, [Passage("start", "end", 4.0)]),
    )


@pytest.fixture(autouse=True)
def _generator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worldgen, "generate", fake_generate)


def plan_of(folder: Path, entry: str, seeds: range = range(1)) -> SuitePlan:
    return planned(folder, f"entries:\n  - {entry}\n", seeds)


def test_the_seed_determines_the_world_and_overrides_apply_to_the_mission(tmp_path: Path) -> None:
    entry = "{family: boxes, difficulty: [0.1, 0.9], set: {mission.timeout: 7, robot.max_v: 0.3}}"
    plan = plan_of(tmp_path, entry, range(3, 6))
    keys = [("boxes", f"boxes-{seed}", "cross", seed) for seed in (3, 4, 5)]
    assert [case.key[:4] for case in plan.cases] == keys
    sessions = [case.session(default_registry()) for case in plan.cases]
    assert [session.world.boxes[0].at[1] for session in sessions] == pytest.approx([1.3, 1.4, 1.5])
    sizes = [session.world.boxes[0].size[0] for session in sessions]
    assert sizes == pytest.approx([0.2 + case.columns["difficulty"] for case in plan.cases])
    assert len(set(sizes)) == 3
    session = sessions[0]
    assert (session.task.timeout, session.task.robot.max_v) == (7.0, 0.3)
    assert [goal.place for goal in session.mission.goals] == ["end"]
    assert session.shortest == pytest.approx(4.0)


def test_the_seeds_drive_every_pair_of_places_once(tmp_path: Path) -> None:
    entry = "{world: paper-room, missions: [through-the-door], pairs: true}"
    plan = plan_of(tmp_path, entry, range(156))
    pairs = [case._pair() for case in plan.cases]
    drawn = [(json.loads(pair[0].partition("=")[2])["place"], pair[1]) for pair in pairs]
    assert len(set(drawn)) == len(drawn)
    assert all(f'["{start}"]' not in goal for start, goal in drawn)
    session = plan.cases[3].session(default_registry())
    assert session.mission.goals[0].place in drawn[3][1]
    assert session.mission.start.yaw == json.loads(pairs[3][0].partition("=")[2])["yaw"]


def test_rounds_drops_and_unknown_starts_hold_in_generated_worlds(tmp_path: Path) -> None:
    drop = "{name: pit, x: [1.0, 1.5], y: [-3.0, -2.0]}"
    changes = f"mission.rounds: 2, mission.start: unknown, mission.drops: [{drop}]"
    (case,) = plan_of(tmp_path, f"{{family: boxes, set: {{{changes}}}}}").cases
    session = case.session(default_registry())
    assert [goal.place for goal in session.mission.goals] == ["end", "end"]
    assert not session.task.start_known
    assert (session.mission.start.x, session.mission.start.y) == (-2.0, 0.0)
    assert session.mission.start.yaw != 0.0
    assert session.task.drops == {"pit"}


@pytest.mark.parametrize(
    ("option", "textures"),
    [
        ("", {}),
        (", contrast: 3", {"wood": TextureSpec(contrast=3.0)}),
        (", look: photo", {"wood": TextureSpec(style="brick")}),
    ],
)
def test_contrast_and_look_of_an_entry_are_those_of_its_worlds(
    option: str, textures: dict[str, TextureSpec], tmp_path: Path
) -> None:
    (case,) = plan_of(tmp_path, f"{{family: boxes{option}}}").cases
    assert case.session(default_registry()).world.textures == textures


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            "{family: boxxes}",
            "mine.yaml:2: entries[0].family: unknown family of worlds 'boxxes': did you",
        ),
        ("{family: boxes, set: {mission.timeout: -1}}", "--set mission.timeout=-1"),
        ("{family: boxes, set: {ovoid.margin: 1}}", "did you mean 'avoid'?"),
        (
            "{family: boxes, set: {mission.goals: [and]}}",
            "entries[0]: --set mission.goals=[\"and\"]: unknown place 'and': did you mean 'end'?",
        ),
        ("{family: boxes, stack: defalt}", "entries[0].stack: unknown stack"),
    ],
)
def test_impossible_entries_are_refused_before_any_run(
    entry: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        plan_of(tmp_path, entry, range(2))
    assert message in str(caught.value)


def test_an_impossible_seed_is_a_fault_of_its_run(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "{family: boxes}", range(12, 14))
    row = run_case(replace(plan.cases[1], pictures=tmp_path, keep="failed"))
    assert (row.seed, row.outcome, row.cause) == (13, "fault", "bad_input")
    assert row.reason == "no way through after 100 tries"


def test_a_generated_run_gives_a_full_row_and_its_picture(tmp_path: Path) -> None:
    failing = "[{at: 1, lasting: 1, behavior: {name: avoid, does: raises}}]"
    entry = f"{{family: boxes, set: {{mission.timeout: 4}}, events: {failing}}}"
    plan = plan_of(tmp_path, entry)
    row = run_case(replace(plan.cases[0], pictures=tmp_path, keep="failed"))
    assert (row.entry, row.family, row.world) == ("boxes", "boxes", "boxes-0")
    assert (row.outcome, row.cause) == ("timeout", "slow")
    assert row.shortest_path_m == pytest.approx(4.0)
    assert len(row.command_hash) == 64
    assert row.plugin_faults == 0, "injected ones do not count"
    assert row.cpu_time_s is not None
    assert row.cpu_time_s > 0.1
    assert row.memory_mb is not None
    assert (tmp_path.parent / row.picture).is_file()


def test_an_exception_in_a_run_is_a_fault_with_its_source_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = plan_of(tmp_path, "{family: boxes}")

    def broken(*_: object) -> Made:
        raise ZeroDivisionError("of the generator")

    monkeypatch.setattr(worldgen, "generate", broken)
    row = run_case(replace(plan.cases[0], pictures=tmp_path, keep="failed"))
    assert (row.outcome, row.cause) == ("fault", "exception")
    assert row.reason.startswith("ZeroDivisionError: of the generator (")
    assert "test_suite_suitefile.py:" in row.reason
    assert "Traceback" in capsys.readouterr().err


def test_every_shipped_mission_is_in_the_suite_shipped() -> None:
    files = (Path(__file__).parents[2] / "worlds").glob("*/missions/*.yaml")
    shipped = {(file.parts[-3], file.stem) for file in files}
    entries = load_suite("shipped").spec.entries
    listed = {(entry.world, name) for entry in entries for name in entry.missions or ("",)}
    assert {one for one in listed if one[1]} <= shipped
    assert [one for one in shipped if not {one, (one[0], "")} & listed] == []
