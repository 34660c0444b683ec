"""``navfw new``: projects and parts are sound, nothing is overwritten."""

import json
import os
import shlex
import shutil
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from cli_calls import invoke, output, put_file, refusal
from docs_pages import ROOT, load_module
from packaging.requirements import Requirement
from processes import run

import navfw
from navfw.plugins import default_registry
from navfw.scaffold import new_files
from navfw.scaffold.part_kinds import PARTS
from navfw.suite import load_suite
from navfw.suite.suite_plan import plan_runs

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


def test_a_new_project_is_sound(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = output("new", "project", "mine").splitlines()[1:-6]
    written = {str(p.relative_to("mine")) for p in Path("mine").rglob("*") if p.is_file()}
    assert {line.strip() for line in listed} == written
    assert {"navfw.toml", ".gitignore", "behaviors/cautious.py", "README.md"} <= written
    monkeypatch.chdir(folder / "mine")
    monkeypatch.delenv("NAVFW_TRUST")
    assert output("check") == "5 checked, 0 wrong\n", "its plugins are trusted"
    needs = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    assert needs["name"] == "mine"
    assert Requirement(needs["dependencies"][0]).extras == {"sim", "report"}


def test_every_file_of_a_new_project_has_its_schema_in_the_editor(folder: Path) -> None:
    invoke("new", "project", "mine")
    project = folder / "mine"
    wired = json.loads((project / ".vscode/settings.json").read_text())["yaml.schemas"]
    schemas = {path.relative_to(project) for path in project.glob(".vscode/schemas/*.json")}
    assert {Path(name) for name in wired} == schemas
    by_file = {path: name for name, pattern in wired.items() for path in project.glob(pattern)}
    files = {path for path in project.rglob("*.yaml") if ".github" not in path.parts}
    assert set(by_file) == files
    for path, name in by_file.items():
        keys = json.loads((project / name).read_text())["properties"]
        assert set(yaml.safe_load(path.read_text())) <= set(keys), path


def test_an_empty_folder_is_taken_and_another_is_not(folder: Path) -> None:
    (folder / "empty").mkdir()
    output("new", "project", "empty")
    put_file(folder, "mine/notes.txt", "keep")
    said = refusal("new", "project", "mine")
    assert "mine: contains 'notes.txt', so it is not replaced; choose another DIR" in said
    assert [path.name for path in (folder / "mine").iterdir()] == ["notes.txt"]


def test_no_project_within_a_project(folder: Path) -> None:
    invoke("new", "project", "mine")
    for inside in ("mine/second", "mine/a/b"):
        said = refusal("new", "project", inside)
        assert "is within the project mine; choose a folder outside of it" in said
        assert not (folder / "mine" / inside).exists()


def test_a_place_that_cannot_be_written(folder: Path) -> None:
    file = put_file(folder, "file", "keep")
    assert "file/mine: cannot be written" in refusal("new", "project", "file/mine")
    assert "expected a folder, got a file" in refusal("new", "project", "file")
    assert list(folder.iterdir()) == [file]
    assert file.read_text() == "keep"


@pytest.mark.slow
def test_a_new_project_has_an_environment_of_its_own_by_uv(folder: Path) -> None:
    """The clone is the source of navfw: no repository is asked."""
    uv = os.environ.get("UV") or shutil.which("uv") or pytest.skip("needs uv")
    output("new", "project", "mine")
    for words in ("navfw check", "navfw run den next-room", "pytest tests"):
        run([uv, "run", *words.split()], cwd=folder / "mine", env={"VIRTUAL_ENV": None}, check=True)
    assert (folder / "mine/.venv/bin/navfw").is_file()


ORIGINS = {
    "clone": ({"url": ROOT.as_uri(), "dir_info": {"editable": True}}, ROOT, "navfw[sim,report]"),
    "lost clone": ({"url": "file:///gone", "dir_info": {}}, None, "navfw[sim,report]=="),
    "wheel": ({"url": "file:///a.whl", "archive_info": {}}, None, "navfw[sim,report] @ file:///a"),
    "index": (None, None, "navfw[sim,report]=="),
}


@pytest.mark.parametrize(("url", "clone", "needed"), ORIGINS.values(), ids=ORIGINS)
def test_a_new_project_gets_navfw_from_where_it_came(
    url: object, clone: Path | None, needed: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = None if url is None else json.dumps(url)
    installed = SimpleNamespace(version="0.1.0", read_text=lambda _: text)
    monkeypatch.setattr(new_files, "distribution", lambda _: installed)
    output("new", "project", "mine")
    project = tomllib.loads((folder / "mine/pyproject.toml").read_text())
    assert project["project"]["dependencies"][0].startswith(needed)
    sources = project.get("tool", {}).get("uv", {}).get("sources", {})
    assert [Path(source["path"]) for source in sources.values()] == ([clone] if clone else [])


def test_what_to_type_next_begins_with_the_environment(folder: Path) -> None:
    *_, first, then, drive, check, tests = output("new", "project", "my robot").splitlines()
    assert first.strip() == f"source {shlex.quote(str(Path(sys.prefix) / 'bin/activate'))}"
    script = f"{first}\n{then}\ncommand -v navfw pytest\npwd"
    done = run(["/bin/bash", "-ec", script], cwd=folder, env={"PATH": "/usr/bin:/bin"}, check=True)
    bin_ = Path(sys.prefix, "bin")
    assert done.stdout.split("\n") == [f"{bin_}/navfw", f"{bin_}/pytest", f"{folder}/my robot", ""]
    typed = [line.strip() for line in (drive, check, tests)]
    readme = (folder / "my robot/README.md").read_text()
    assert [line for line in typed if f"$ {line}" not in readme] == []
    assert f"`{first.strip()}`" in readme


def test_the_parts_of_all_kinds_are_sound_together(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(NAMES) == set(PARTS)
    before = {path for path in project.rglob("*") if path.is_file()}
    listed: set[str] = set()
    monkeypatch.chdir(project / "tests")
    for kind, name in NAMES.items():
        _, *lines, last = output("new", kind, name).splitlines()
        assert last.startswith("next: navfw check && navfw ")
        listed |= {line.strip() for line in lines}
    monkeypatch.chdir(project)
    written = {path for path in project.rglob("*") if path.is_file()} - before
    assert {str(path.relative_to(project)) for path in written} == listed
    texts = {path: path.read_text() for path in written}
    assert [path for path, text in texts.items() if "part_" in text or "PartName" in text] == []
    assert output("check") == "19 checked, 0 wrong\n"


@pytest.mark.parametrize("start", PARTS["behavior"].starts)
def test_a_new_behavior_says_what_its_test_expects(project: Path, start: str) -> None:
    output("new", "behavior", "slow_down", "--start", start)
    assert "class SlowDown(RuledBehavior):" in (project / "behaviors/slow_down.py").read_text()
    module = load_module(project / "tests/test_slow_down.py")
    tests = [test for name, test in vars(module).items() if name.startswith("test_")]
    assert len(tests) == 3
    for test in tests:
        test()


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("kind", STAGES)
def test_a_new_stage_drives_as_soon_as_it_is_written(kind: str) -> None:
    name = NAMES[kind]
    output("new", kind, name)
    with navfw.open_session("paper-room", "through-the-door", stack=name) as session:
        assert session.session.stack.resolved.stages[kind].name == name
        ticks = [tick for _, tick in zip(range(150), session, strict=False)]
    last = ticks[-1].state
    assert not last.faults
    assert last.proposals
    assert last.path[-1].place == "annex"
    driven = ticks[-1].true_pose[:2] - ticks[0].true_pose[:2]
    assert float(driven @ driven) > 0.03**2  # it turns first


@pytest.mark.parametrize(("world", "model"), [("den", "next-room"), ("office", "kitchen-tour")])
def test_a_new_mission_begins_as_another_one_of_its_world(
    project: Path, world: str, model: str
) -> None:
    output("new", "mission", f"{world}/evening")
    text = (project / "worlds" / world / "missions" / "evening.yaml").read_text()
    assert text.startswith(f"description: as {model}; set start and goals\n")
    with navfw.open_session(world, "evening") as session:
        tick = session.step()
        assert tick is not None
        assert session.session.mission.spec.goals


@pytest.mark.thorough
def test_a_new_suite_drives_generated_worlds_and_those_of_the_project(project: Path) -> None:
    output("new", "suite", "nightly")
    plan = plan_runs(load_suite("nightly"), range(2), default_registry())
    assert len(plan.cases) == 8
    file = project / "worlds/suites/nightly.yaml"
    file.write_text(file.read_text().replace("  # - {", "  - {"))
    plan = plan_runs(load_suite("nightly"), range(2), default_registry())
    assert len(plan.cases) == 12
    assert {case.key.world for case in plan.cases} >= {"office", "den"}


WRONG = {
    ("behavior", "a", "--start", "slow"): "unknown start 'slow': did you mean 'slow-near'?",
    ("behavior", "slow-down"): "NAME: expected a Python identifier in small letters",
    ("flow", "class"): "NAME: expected a Python identifier",
    ("planner", "_hidden"): "NAME: expected a Python identifier",
    ("fusion", "a/b"): "NAME: expected no '/'; got 'a/b'",
    ("behavior", "avoid"): "there is a plugin 'avoid' in",
    ("behavior", "cautious"): "there is a plugin 'cautious' in behaviors/cautious.py",
    ("flow", "dis"): "there is a plugin 'dis' in navfw; choose another name",
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
def test_a_wrong_name_is_refused(part: tuple[str, ...], message: str, project: Path) -> None:
    before = sorted(project.rglob("*"))
    (said,) = refusal("new", *part).strip().splitlines()
    assert message in said
    assert sorted(project.rglob("*")) == before


@pytest.mark.parametrize("kind", NAMES)
def test_no_part_outside_of_a_project(kind: str, folder: Path) -> None:
    assert "is in no project; change into one" in refusal("new", kind, NAMES[kind])
    assert list(folder.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", NAMES)
def test_the_next_command_and_the_test_of_a_part_succeed(kind: str, project: Path) -> None:
    lines = invoke("new", kind, NAMES[kind]).stdout.splitlines()
    tests = [line.strip() for line in lines if line.startswith("  tests/")]
    python = shlex.quote(sys.executable)
    command = f"{python} -c 'from navfw.cli import main; main()' "
    then = lines[-1].removeprefix("next: ").replace("navfw ", command)
    pytest_ = f" && {python} -m pytest -q -p no:cacheprovider {' '.join(tests)}" if tests else ""
    run(["/bin/sh", "-ec", then + pytest_], cwd=project, env={"NAVFW_TRUST": "1"}, check=True)
