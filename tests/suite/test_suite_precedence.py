"""Precedence of stacks and robots: option, variant, entry, mission, ``default``."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from navfw.config import list_missions, shipped_folder
from navfw.errors import InputError
from navfw.plugins import default_registry
from navfw.suite import Case, load_suite, plan_runs


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


def cases_of(folder: Path, entry: str, variants: str = "", **options: Any) -> tuple[Case, ...]:
    """The runs of a suite with one entry."""
    file = folder / "mine.yaml"
    file.write_text(f"entries:\n  - {{{entry}}}\n{variants}")
    return plan_runs(load_suite(file), range(1), default_registry(), **options).cases


def stacks(world: Path, entry: str, variants: str = "", **options: Any) -> dict[str, str]:
    """The stack of each mission (and variant)."""
    found = {}
    entry = f"world: {world / 'world.yaml'}{entry}"
    for case in cases_of(world.parent, entry, variants, **options):
        session = case.session(default_registry())
        assert case.stack_name == session.stack_file.stem
        found[f"{case.mission_name} {case.variant}".strip()] = case.stack_name
    return found


@pytest.mark.parametrize(
    ("entry", "options", "plain", "seek"),
    [
        ("", [], "default", "search"),
        (", stack: paper", [], "paper", "paper"),
        (", set: {mission.stack: patrol}", [], "patrol", "patrol"),
        (", stack: paper", ["patrol"], "patrol", "patrol"),
    ],
    ids=["mission", "entry", "set", "option"],
)
def test_the_last_choice_of_a_stack_counts(
    world: Path, entry: str, options: list[str], plain: str, seek: str
) -> None:
    assert stacks(world, entry, stacks=options) == {"plain": plain, "seek": seek}


@pytest.mark.parametrize("entry", ["", ", stack: paper"])
def test_the_stack_of_a_variant_takes_precedence_over_both(world: Path, entry: str) -> None:
    variants = "variants: {own: {}, set: {set: {mission.timeout: 5}}, other: {stack: patrol}}\n"
    own = "paper" if entry else "search"
    expected = {"seek own": own, "seek set": own, "seek other": "patrol"}
    assert stacks(world, f", missions: [seek]{entry}", variants) == expected


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


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with robots of different radii."""
    (tmp_path / "navfw.toml").touch()
    (tmp_path / "robots").mkdir()
    for name, radius in {"a": 0.21, "b": 0.22, "c": 0.23}.items():
        (tmp_path / "robots" / f"{name}.yaml").write_text(f"radius: {radius}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def radii(folder: Path, entry: str, variants: str = "", *options: str) -> list[float]:
    """The robot's radius in each run."""
    straight = f"world: empty, missions: [straight]{entry}"
    cases = cases_of(folder, straight, variants, overrides=options)
    return [case.session(default_registry()).mission.spec.robot.radius for case in cases]


def test_the_last_choice_counts(project: Path) -> None:
    variants = "variants: {own: {}, other: {robot: b}, changed: {robot: b, set: {robot.radius: 1}}}"
    assert radii(project, "") == [0.18]
    assert radii(project, ", robot: a") == [0.21]
    assert radii(project, ", robot: a, set: {robot.radius: 0.3}") == [0.3]
    assert radii(project, ", robot: a", variants) == [0.21, 0.22, 1.0]
    assert radii(project, ", robot: a", variants, "robot=c") == [0.23, 0.23, 0.23]


def test_an_unknown_robot_has_the_line_of_its_entry(project: Path) -> None:
    with pytest.raises(InputError, match=r"mine.yaml:2: .*unknown robot 'd'"):
        radii(project, ", robot: d")


def test_a_table_is_not_resumed_with_another_robot(project: Path) -> None:
    def fingerprint() -> str:
        (case,) = cases_of(project, "world: empty, missions: [straight], robot: a")
        return case.content

    before = fingerprint()
    assert fingerprint() == before
    (project / "robots" / "a.yaml").write_text("radius: 0.24\n")
    assert fingerprint() != before
