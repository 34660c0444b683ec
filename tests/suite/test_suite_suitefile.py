"""Suite files and seeds: valid ones, and the errors for wrong ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from navfw.config import list_files
from navfw.errors import InputError
from navfw.suite import draw_difficulty, load_suite, parse_seeds


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
