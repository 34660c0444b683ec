"""``navfw new KIND NAME``: what it writes is sound and drives, and nothing is half-written."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import navfw
from navfw.cli import app
from navfw.plugins import default_registry
from navfw.scaffold import PARTS
from navfw.suite import load_suite, plan_runs
from navfw.testing import check_behavior

NAMES = {
    "behavior": "slow_down",
    "flow": "tracked_points",
    "fusion": "weighted_mean",
    "localizer": "wheels_alone",
    "planner": "fewest_metres",
    "world": "east-wing",
    "mission": "den/back-again",
    "suite": "nightly",
}
STAGES = ("flow", "fusion", "localizer", "planner")


def invoke(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new project: the working folder, and trusted."""
    monkeypatch.setenv("NAVFW_TRUST", "1")
    monkeypatch.chdir(tmp_path)
    assert invoke("new", "project", "mine").exit_code == 0
    monkeypatch.chdir(tmp_path / "mine")
    return tmp_path / "mine"


def test_there_is_a_name_for_each_kind() -> None:
    assert set(NAMES) == set(PARTS)


def test_the_parts_of_all_kinds_are_sound_together(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path for path in project.rglob("*") if path.is_file()}
    told: set[str] = set()
    monkeypatch.chdir(project / "tests")
    for kind, name in NAMES.items():
        done = invoke("new", kind, name)
        assert done.exit_code == 0, done.output
        assert done.stdout.splitlines()[-1].startswith("next: navfw check && navfw ")
        told |= {line.strip() for line in done.stdout.splitlines()[1:-1]}
    monkeypatch.chdir(project)
    written = {path for path in project.rglob("*") if path.is_file()} - before
    assert {str(path.relative_to(project)) for path in written} == told
    texts = {path: path.read_text() for path in written}
    assert [path for path, text in texts.items() if "part_" in text or "PartName" in text] == []
    checked = invoke("check")
    assert (checked.exit_code, checked.stdout) == (0, "19 checked, 0 wrong\n")


def test_a_new_behavior_keeps_the_contract(project: Path) -> None:
    assert invoke("new", "behavior", "slow_down").exit_code == 0
    assert "class SlowDown(RuledBehavior):" in (project / "behaviors/slow_down.py").read_text()
    found = default_registry().get("behavior", "slow_down")
    assert issubclass(found, navfw.Behavior)
    check_behavior(found)


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("kind", STAGES)
def test_a_new_stage_drives_as_soon_as_it_is_written(kind: str) -> None:
    name = NAMES[kind]
    assert invoke("new", kind, name).exit_code == 0
    with navfw.open_session("paper-room", "through-the-door", stack=name) as session:
        assert session.session.stack.resolved.stages[kind].name == name
        ticks = [tick for _, tick in zip(range(150), session, strict=False)]
    last = ticks[-1].state
    assert not last.faults
    assert last.proposals
    assert last.path[-1].place == "annex"
    driven = ticks[-1].true_pose[:2] - ticks[0].true_pose[:2]
    assert float(driven @ driven) > 0.03**2  # it turns first


def test_a_new_world_has_no_stack_of_the_project(project: Path) -> None:
    assert invoke("new", "world", "east-wing").exit_code == 0
    made = [path for path in project.rglob("*east?wing*") if path.is_file()]
    made += list((project / "worlds/east-wing").rglob("*.yaml"))
    assert len(made) == 4
    assert "careful" not in "".join(path.read_text() for path in made)


@pytest.mark.parametrize(("world", "model"), [("den", "next-room"), ("office", "kitchen-tour")])
def test_a_new_mission_begins_as_another_one_of_its_world(
    project: Path, world: str, model: str
) -> None:
    done = invoke("new", "mission", f"{world}/evening")
    assert done.exit_code == 0, done.output
    text = (project / "worlds" / world / "missions" / "evening.yaml").read_text()
    assert text.startswith(f"description: as {model}; set start and goals\n")
    with navfw.open_session(world, "evening") as session:
        tick = session.step()
        assert tick is not None
        assert session.session.mission.spec.goals


@pytest.mark.thorough
def test_a_new_suite_drives_generated_worlds_and_those_of_the_project(project: Path) -> None:
    assert invoke("new", "suite", "nightly").exit_code == 0
    plan = plan_runs(load_suite("nightly"), range(2), default_registry())
    assert len(plan.cases) == 8
    file = project / "worlds/suites/nightly.yaml"
    file.write_text(file.read_text().replace("  # - {", "  - {"))
    plan = plan_runs(load_suite("nightly"), range(2), default_registry())
    assert len(plan.cases) == 12
    assert {case.world_name for case in plan.cases} >= {"office", "den"}


WRONG = {
    ("behavior", "slow-down"): "NAME: expected a Python identifier in small letters",
    ("flow", "class"): "NAME: expected a Python identifier",
    ("planner", "_hidden"): "NAME: expected a Python identifier",
    ("fusion", "a/b"): "NAME: expected no '/'; got 'a/b'",
    ("behavior", "avoid"): "there is a plugin 'avoid' in",
    ("behavior", "cautious"): "there is a plugin 'cautious' in behaviors/cautious.py",
    ("flow", "lucas_kanade"): "there is a plugin 'lucas_kanade' in navfw; choose another name",
    ("localizer", "careful"): "there is a stack 'careful' in stacks/careful.yaml",
    ("behavior", "next_room"): "tests/test_next_room.py: exists, and is not replaced",
    ("world", "East Wing"): "NAME: expected small letters, digits and single hyphens",
    ("world", "office"): "there is a world 'office' in",
    ("mission", "evening"): "NAME: expected WORLD/NAME, such as office/evening; got 'evening'",
    ("mission", "offise/evening"): "did you mean 'office'?",
    ("mission", "den/next-room"): "there is a mission 'next-room' in",
    ("mission", "den/Next"): "NAME: expected small letters",
    ("suite", "rooms"): "there is a suite 'rooms' in",
}


@pytest.mark.parametrize(("part", "message"), WRONG.items(), ids=map(" ".join, WRONG))
def test_a_wrong_name_is_refused(part: tuple[str, str], message: str, project: Path) -> None:
    before = sorted(project.rglob("*"))
    done = invoke("new", *part)
    assert done.exit_code == 2, done.output
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert sorted(project.rglob("*")) == before


@pytest.mark.parametrize("kind", NAMES)
def test_no_part_outside_of_a_project(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = invoke("new", kind, NAMES[kind])
    assert (done.exit_code, "is in no project; change into one" in done.stderr) == (2, True)
    assert list(tmp_path.iterdir()) == []


def test_a_part_that_cannot_be_written_whole_is_not_written(project: Path) -> None:
    """The plugin is written first, then the stack cannot be: both are gone."""
    (project / "stacks/careful.yaml").unlink()
    (project / "stacks").rmdir()
    (project / "stacks").write_text("in the way")
    before = sorted(project.rglob("*"))
    done = invoke("new", "flow", "tracked_points")
    assert done.exit_code == 2
    assert "stacks/tracked_points.yaml: cannot be written" in done.stderr
    assert sorted(project.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize("kind", NAMES)
def test_the_next_command_and_the_test_of_a_part_succeed(kind: str, project: Path) -> None:
    told = invoke("new", kind, NAMES[kind]).stdout.splitlines()
    tests = [line.strip() for line in told if line.startswith("  tests/")]
    python = shlex.quote(sys.executable)
    command = f"{python} -c 'from navfw.cli import main; main()' "
    then = told[-1].removeprefix("next: ").replace("navfw ", command)
    pytest_ = f" && {python} -m pytest -q -p no:cacheprovider {' '.join(tests)}" if tests else ""
    done = subprocess.run(  # noqa: S603 - commands of our own
        ["/bin/sh", "-ec", then + pytest_],
        cwd=project,
        env=os.environ | {"NAVFW_TRUST": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
