"""Precedence of stacks: --stack, the variant's, the entry's, the mission's, ``default``."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from navfw.config import list_missions, shipped_folder
from navfw.errors import InputError
from navfw.plugins import default_registry
from navfw.suite import load_suite, plan_runs


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """A world with a mission that names the stack ``search``, and one without a stack."""
    folder = tmp_path / "field"
    shutil.copytree(shipped_folder() / "worlds" / "empty", folder)
    missions = folder / "missions"
    for other in missions.glob("*.yaml"):
        other.unlink()
    plain = "start: [1, 1, 0]\ngoals: [{x: 3, y: 1}]\ntimeout: 9\n"
    (missions / "plain.yaml").write_text(plain)
    (missions / "seek.yaml").write_text(plain + "stack: search\n")
    return folder


def stacks(world: Path, entry: str, variants: str = "", **options: Any) -> dict[str, str]:
    """The stack of each mission (and variant) of a suite with one entry."""
    file = world.parent / "mine.yaml"
    file.write_text(f"entries:\n  - {{world: {world / 'world.yaml'}{entry}}}\n{variants}")
    plan = plan_runs(load_suite(file), range(1), default_registry(), **options)
    found = {}
    for case in plan.cases:
        session = case.session(default_registry())
        assert case.stack_name == session.stack_file.stem
        found[f"{case.mission_name} {case.variant}".strip()] = case.stack_name
    return found


def test_each_mission_is_driven_with_the_stack_it_names(world: Path) -> None:
    assert stacks(world, "") == {"plain": "default", "seek": "search"}


def test_the_stack_of_an_entry_takes_precedence_over_the_mission_s(world: Path) -> None:
    assert stacks(world, ", stack: paper") == {"plain": "paper", "seek": "paper"}


def test_the_stack_of_a_variant_takes_precedence_over_both(world: Path) -> None:
    variants = "variants: {own: {}, set: {set: {mission.timeout: 5}}, other: {stack: patrol}}\n"
    assert stacks(world, ", missions: [seek]", variants) == {
        "seek own": "search",
        "seek set": "search",
        "seek other": "patrol",
    }
    entry = ", missions: [seek], stack: paper"
    assert stacks(world, entry, variants)["seek other"] == "patrol"


def test_the_stack_of_the_option_takes_precedence_over_all(world: Path) -> None:
    expected = {"plain": "patrol", "seek": "patrol"}
    assert stacks(world, ", stack: paper", stacks=["patrol"]) == expected


def test_an_override_may_name_the_stack_of_a_mission(world: Path) -> None:
    entry = ", set: {mission.stack: patrol}"
    assert stacks(world, entry) == {"plain": "patrol", "seek": "patrol"}


def test_an_unknown_stack_of_a_mission_is_refused_with_its_line(world: Path) -> None:
    seek = world / "missions" / "seek.yaml"
    seek.write_text(seek.read_text().replace("search", "serach"))
    with pytest.raises(InputError) as caught:
        stacks(world, "")
    text = str(caught.value)
    assert "mine.yaml:2: entries[0]" in text
    assert "seek.yaml:4: stack: unknown stack 'serach': did you mean 'search'" in text


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["office", "hospital"])
def test_long_missions_of_shipped_suites_use_landmarks(name: str) -> None:
    plan = plan_runs(load_suite(name), range(1), default_registry())
    used = {case.mission_name: case.stack_name for case in plan.cases}
    assert set(used.values()) == {"floor_plan", "landmarks"}
    assert used["patrol"] == "landmarks"
    left_out = {mission.name for mission in list_missions(name)} - used.keys()
    assert left_out <= {"patrol-1km"}
