"""Suite files, seeds, entries with events, what passes; and the errors for wrong ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import suite_samples as samples

from navfw.config import list_files
from navfw.errors import ConfigError, InputError
from navfw.plugins import default_registry
from navfw.suite import Expect, draw_difficulty, load_suite, parse_seeds, plan_runs, summarize


def suite(folder: Path, text: str) -> Path:
    file = folder / "mine.yaml"
    file.write_text(text)
    return file


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
    entries = load_suite(suite(tmp_path, text)).spec.entries
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
        ("entries: [{family: rooms, difficulty: 1.5}]", "difficulty"),
        ("entries: [{family: rooms, difficulty: [0.9, 0.1]}]", "must ascend"),
        ("entries: [{world: a, mision: b}]", "did you mean 'missions'?"),
        ("entries: [{world: a}, {world: a}]", "entries[1]: a second entry called 'a'"),
        ("entries: [{world: a, name: '../up'}]", "name"),
    ],
)
def test_bad_suites_are_refused_with_file_and_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        load_suite(suite(tmp_path, text))
    assert message in str(caught.value)
    assert "mine.yaml:1" in str(caught.value)


def test_an_unknown_suite_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(InputError, match="unknown suite 'ofice': did you mean 'office'"):
        load_suite("ofice")


@pytest.mark.parametrize("name", [suite.name for suite in list_files("suite")])
def test_shipped_suites_can_be_loaded(name: str) -> None:
    assert load_suite(name).spec.description


def test_a_project_can_have_suites(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "navfw.toml").touch()
    (tmp_path / "worlds" / "suites").mkdir(parents=True)
    (tmp_path / "worlds" / "suites" / "office.yaml").write_text("entries: [{family: rooms}]")
    monkeypatch.chdir(tmp_path)
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
    drawn = [draw_difficulty((0.2, 0.8), seed) for seed in range(300)]
    assert drawn == [draw_difficulty((0.2, 0.8), seed) for seed in range(300)]
    values = [value for value in drawn if value is not None]
    assert 0.2 <= min(values) < 0.22
    assert 0.78 < max(values) <= 0.8
    assert draw_difficulty(0.4, 7) == 0.4
    assert draw_difficulty(None, 7) is None


EVENTS = """\
entries:
  - {name: black, family: clutter, difficulty: 0.1, expect: stop,
     events: [{at: 8, camera: black}]}
  - {name: usual, family: clutter, difficulty: 0.1, expect: arrival}
"""


def test_events_of_an_entry_apply_to_its_missions(tmp_path: Path) -> None:
    plan = plan_runs(load_suite(suite(tmp_path, EVENTS)), range(2), default_registry())
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
        plan_runs(
            load_suite(suite(tmp_path, EVENTS.replace(old, new))), range(1), default_registry()
        )
    assert message in str(caught.value)
    assert "mine.yaml" in str(caught.value)


def passes(expect: Expect, **changes: Any) -> bool:
    rows = [samples.row(seed) for seed in range(9)]
    rows.append(samples.row(9, **changes))
    entry = rows[0].entry
    summary = summarize(rows, {entry: expect})
    found = summary["by_entry"][entry]
    assert found["expect"] == expect
    assert found["passed"] >= 9
    return bool(found["passes"])


def test_nine_arrivals_of_ten_pass() -> None:
    assert passes("arrival", outcome="collided", collisions=1)
    rows = [samples.row(seed, outcome="reached" if seed < 8 else "stuck") for seed in range(10)]
    summary = summarize(rows, {rows[0].entry: "arrival"})
    assert not summary["by_entry"][rows[0].entry]["passes"]
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
