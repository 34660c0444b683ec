"""``navfw new``: projects and parts are sound, nothing is overwritten or half-written.

``navfw check``: all errors of a project at once, each with its place and remedy.
"""

import json
import os
import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from cli_calls import invoke, output, put_file, put_files, refusal
from docs_pages import ROOT, blocks_of, load_module
from packaging.requirements import Requirement
from processes import run

import navfw
from navfw.plugins import default_registry
from navfw.scaffold import PARTS
from navfw.suite import load_suite, plan_runs

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


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, in which all projects are trusted."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NAVFW_TRUST", "1")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path.with_name("config")))
    return tmp_path


def test_a_new_project_is_sound(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = output("new", "project", "mine").splitlines()[1:-1]
    written = {str(p.relative_to("mine")) for p in Path("mine").rglob("*") if p.is_file()}
    assert {line.strip() for line in listed} == written
    assert {"navfw.toml", ".gitignore", "behaviors/cautious.py", "README.md"} <= written
    monkeypatch.chdir(folder / "mine")
    monkeypatch.delenv("NAVFW_TRUST")
    assert output("check") == "5 checked, 0 wrong\n", "its plugins are trusted"
    needs = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    assert needs["name"] == "mine"
    assert Requirement(needs["dependencies"][0]).extras == {"sim"}


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
def test_five_commands_lead_to_an_edited_behaviour_that_passes(folder: Path) -> None:
    """Those of the README, typed in a shell by a user with a home of his own."""
    (block,) = (b for b in blocks_of(ROOT / "README.md") if "navfw new project" in b.text)
    lines = re.findall(r"^\$ (.*)$", block.text, re.MULTILINE)
    assert len(lines) == 5
    environment = {
        "NAVFW_TRUST": None,
        "HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder / "config"),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    done = run(["/bin/sh", "-ec", "\n".join(lines)], env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "IF ahead IS very little" in (folder / "my-robot/behaviors/cautious.yaml").read_text()
    assert "2 passed" in done.stdout


@pytest.fixture
def project(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new project: the working folder, and trusted."""
    output("new", "project", "mine")
    monkeypatch.chdir(folder / "mine")
    return folder / "mine"


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


def test_a_new_world_has_no_stack_of_the_project(project: Path) -> None:
    output("new", "world", "east-wing")
    made = [path for path in project.rglob("*east?wing*") if path.is_file()]
    made += list((project / "worlds/east-wing").rglob("*.yaml"))
    assert len(made) == 4
    assert "careful" not in "".join(path.read_text() for path in made)


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
    assert {case.world_name for case in plan.cases} >= {"office", "den"}


WRONG = {
    ("behavior", "a", "--start", "slow"): "unknown start 'slow': did you mean 'slow-near'?",
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
def test_a_wrong_name_is_refused(part: tuple[str, ...], message: str, project: Path) -> None:
    before = sorted(project.rglob("*"))
    (said,) = refusal("new", *part).strip().splitlines()
    assert message in said
    assert sorted(project.rglob("*")) == before


@pytest.mark.parametrize("kind", NAMES)
def test_no_part_outside_of_a_project(kind: str, folder: Path) -> None:
    assert "is in no project; change into one" in refusal("new", kind, NAMES[kind])
    assert list(folder.iterdir()) == []


def test_a_part_that_cannot_be_written_whole_is_not_written(project: Path) -> None:
    """The plugin is written first, then the stack cannot be: both are gone."""
    (project / "stacks/careful.yaml").unlink()
    (project / "stacks").rmdir()
    (project / "stacks").write_text("in the way")
    before = sorted(project.rglob("*"))
    said = refusal("new", "flow", "tracked_points")
    assert "stacks/tracked_points.yaml: cannot be written" in said
    assert sorted(project.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize("kind", NAMES)
def test_the_next_command_and_the_test_of_a_part_succeed(kind: str, project: Path) -> None:
    lines = invoke("new", kind, NAMES[kind]).stdout.splitlines()
    tests = [line.strip() for line in lines if line.startswith("  tests/")]
    python = shlex.quote(sys.executable)
    command = f"{python} -c 'from navfw.cli import main; main()' "
    then = lines[-1].removeprefix("next: ").replace("navfw ", command)
    pytest_ = f" && {python} -m pytest -q -p no:cacheprovider {' '.join(tests)}" if tests else ""
    done = run(["/bin/sh", "-ec", then + pytest_], cwd=project, env={"NAVFW_TRUST": "1"})
    assert done.returncode == 0, done.stdout + done.stderr


# --- check ---------------------------------------------------------------------------------------

CAUTIOUS = ROOT / "navfw/scaffold/templates/project/behaviors/cautious"


def code(name: str) -> str:
    text = CAUTIOUS.with_suffix(".py.template").read_text(encoding="utf-8")
    return text.replace("cautious", name).replace("Cautious", name.title())


def rules(name: str, covering: bool = True) -> str:
    text = CAUTIOUS.with_suffix(".yaml").read_text(encoding="utf-8").replace("cautious", name)
    return text if covering else re.sub(r".*IF ahead IS plenty.*\n", "", text)


GOOD = {
    "navfw.toml": "",
    "behaviors/sound.py": code("sound"),
    "behaviors/sound.yaml": rules("sound"),
    "stacks/mine.yaml": "base: default\nbehaviors: {sound: }\n",
    "worlds/empty/missions/own.yaml": (
        "map: empty\nstart: [0, 0, 0]\ngoals: [east]\nstack: mine\ntimeout: 30\n"
    ),
    "robots/slow.yaml": "max_v: 0.2\n",
}

BAD = {
    "behaviors/lonely.py": code("lonely"),
    "behaviors/open.py": code("open"),
    "behaviors/open.yaml": rules("open", covering=False),
    "behaviors/typo.py": code("typo"),
    "behaviors/typos.yaml": rules("typo"),
    "behaviors/_helper.yaml": "",
    "stacks/wrong.yaml": "base: default\nbehaviors: {sound: {wait: 1}}\n",
    "robots/torn.yaml": "radius: wide\n",
    "worlds/suites/torn.yaml": "entries: []\n",
    "worlds/empty/missions/far.yaml": (
        "map: empty\nstart: [0, 0, 0]\ngoals: [centr]\nstack: mine\ntimeout: 30\n"
    ),
}

SIMULATES = GOOD["behaviors/sound.py"] + "\nimport pybullet\n"


@pytest.fixture
def sound(folder: Path) -> Path:
    """A sound project, trusted, in the working folder."""
    put_files(folder, GOOD)
    return folder


def test_a_sound_project_passes(sound: Path) -> None:
    assert output("check") == "4 checked, 0 wrong\n"


def test_every_error_is_told_at_once(sound: Path) -> None:
    put_files(sound, BAD)
    done = invoke("check")
    assert done.exit_code == 2
    for words in (
        "behaviors/lonely.yaml: there is no such file",
        "behaviors/open.yaml",
        "no rule",
        "behaviors/typo.yaml: there is no such file; did you mean 'typos.yaml'?",
        "stacks/wrong.yaml:2: behaviors.sound.wait: unknown key",
        "robots/torn.yaml:1: radius",
        "worlds/suites/torn.yaml:1: entries",
        "worlds/empty/missions/far.yaml:3: goals[0]: unknown place 'centr'",
        "did you mean 'centre'?",
        "12 checked, 7 wrong",
    ):
        assert words in done.stdout


def test_plugins_lists_a_behaviour_without_covering_rules_as_broken(sound: Path) -> None:
    put_files(sound, BAD)
    done = invoke("list", "plugins", "--kind", "behavior", "--json")
    status = {row["name"]: row["status"] for row in json.loads(done.stdout)}
    assert done.exit_code == 2
    assert {name for name in status if status[name] == "broken"} == {"lonely", "open", "typo"}


def test_what_a_run_would_refuse_is_refused_and_told_once(project: Path) -> None:
    """A map without its door's edge, which two missions use; a behaviour that returns nothing."""
    behavior = (project / "behaviors/cautious.py").read_text()
    head, _, _ = behavior.partition("    def propose")
    missions = project / "worlds/den/missions"
    own_map = (project / "maps/den.yaml").read_text()
    texts = {
        "behaviors/silent.py": head.replace("Cautious", "Silent").replace('"cautious"', '"silent"')
        + "    def propose(self, context: Context) -> Proposal:\n        return None\n",
        "behaviors/silent.yaml": (project / "behaviors/cautious.yaml").read_text(),
        "maps/den.yaml": "".join(
            line for line in own_map.splitlines(True) if "from: door-west" not in line
        ),
        "worlds/den/missions/again.yaml": (missions / "next-room.yaml").read_text(),
    }
    put_files(project, texts)
    done = invoke("check")
    assert done.exit_code == 2
    assert done.stdout.count("the map does not connect the start") == 1
    assert "also: 2 files that use it: worlds/den/missions/again.yaml" in done.stdout
    assert done.stdout.count("and 14 more propose returned NoneType, not a Proposal") == 1


SLIPS = yaml.safe_load(Path(__file__).with_name("slips.yaml").read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("slip", SLIPS, ids=[slip["slip"] for slip in SLIPS])
def test_a_slip_gets_one_verdict_with_its_cause_once(slip: dict[str, str], project: Path) -> None:
    text = (project / slip["file"]).read_text(encoding="utf-8")
    assert slip["old"] in text
    put_file(project, slip["file"], text.replace(slip["old"], slip["new"], 1))
    checked, driven = invoke("check"), invoke("run", "den", "next-room", "--quiet")
    tested = run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"], cwd=project)
    said = {"check": checked.output, "run": driven.output, "pytest": tested.stdout}
    assert all((checked.exit_code, driven.exit_code, tested.returncode)), said
    assert [by for by, text in said.items() if slip["says"] not in text] == [], said
    assert len(re.findall(r"^[\w/.-]+(?::\d+)?: ", said["check"], re.MULTILINE)) == 1, said


def test_single_files_are_checked_by_their_folder_or_keys(sound: Path) -> None:
    put_files(
        sound, BAD | {"elsewhere.yaml": rules("open", covering=False), "other.yaml": "x: 1\n"}
    )
    done = invoke("check", "--json", "elsewhere.yaml", "other.yaml", "behaviors/sound.py", "robots")
    rows = {row["source"]: row for row in json.loads(done.stdout)}
    kinds = [row["kind"] for row in rows.values()]
    assert kinds == ["behavior", "rule base", None, "robot", "robot"]
    assert rows["robots/slow.yaml"]["error"] is None
    assert "no file of navfw" in rows["other.yaml"]["error"]
    assert done.exit_code == 2


def test_use_of_the_simulator_is_noted(sound: Path) -> None:
    put_files(sound, {"behaviors/sound.py": SIMULATES})
    assert "note: behaviors/sound.py:34: imports pybullet" in output("check", "behaviors")


@pytest.mark.usefixtures("folder")
def test_outside_a_project_files_must_be_named() -> None:
    assert "no project here" in refusal("check")
    missing = invoke("check", "nothing.yaml")
    assert (missing.exit_code, "there is no such file" in missing.output) == (2, True)
