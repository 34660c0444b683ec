"""The examples of the README and the docs are true: they are written to a project and run."""

from __future__ import annotations

import importlib.util
import itertools
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from navfw.config.overrides import parse_override
from navfw.config.yamlfile import load_yaml
from navfw.missions.outcome import Outcome
from navfw.missions.session import MissionResult, prepare
from navfw.plugins import default_registry
from navfw.stackfile import load_stack
from navfw.testing import check_behavior, check_composite

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PAGES += sorted((ROOT / "docs").glob("*.md"))

# **`path/of/file`** with words behind it or not, then (perhaps after a paragraph) its fenced text
FILE = re.compile(r"^\*\*`([\w./-]+)`\*\*[^`]*?^```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
COMMAND = re.compile(r"^\$ (?:uv run )?navfw (.+?)(?:  +#.*)?$", re.MULTILINE)


def files_of(page: Path) -> dict[str, str]:
    return dict(FILE.findall(page.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The project that a reader has who types every file of the README and the docs.

    It is the working folder while the tests of this module run.
    """
    folder = tmp_path_factory.mktemp("my-robot")
    (folder / "navfw.toml").touch()
    for page in PAGES:
        for name, text in files_of(page).items():
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


def test_the_readme_has_all_the_files_it_speaks_of() -> None:
    assert set(files_of(ROOT / "README.md")) == {
        "behaviors/cautious.py",
        "behaviors/cautious.yaml",
        "stacks/careful.yaml",
        "tests/test_cautious.py",
        "worlds/den/world.yaml",
        "worlds/den/missions/next-room.yaml",
        "maps/den.yaml",
        "tests/test_den.py",
    }


@pytest.mark.usefixtures("project")
def test_the_behaviour_is_found_and_keeps_the_contract() -> None:
    registry = default_registry()
    check_behavior(registry.get("behavior", "cautious"))
    (listed,) = (row for row in registry.listing("behavior") if row["name"] == "cautious")
    assert [parameter["name"] for parameter in listed["parameters"]] == ["weight"]
    # the README's files must not hide that a shipped one is broken, nor break one
    assert [row["name"] for row in registry.broken() if "cautious" in row["source"]] == []


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("name", ["timid", "wary"])
def test_the_composites_are_found_and_keep_the_contract(name: str) -> None:
    check_composite(default_registry().get("composite", name))


@pytest.fixture(scope="module")
def driven(project: Path) -> MissionResult:
    del project
    return prepare("empty", "straight", seed=1, stack="careful").run()


def test_the_behaviour_drives_and_explains_itself(driven: MissionResult) -> None:
    assert driven.outcome is Outcome.REACHED, driven.reason
    assert not list(driven.run.faults)
    said = driven.session.stack.state.proposals["cautious"]
    assert "known to be free" in said.reason
    assert said.explain(0, 0)[0]["rule"].startswith("IF ahead IS ")


def test_the_readme_has_all_keys_of_the_json(driven: MissionResult) -> None:
    table = set(re.findall(r"`(\w+)`", _table("### The keys of `navfw run --json`")))
    missing = {"run_folder", *driven.summary()} - table
    assert not missing, f"the README's table of JSON keys lacks {sorted(missing)}"


@pytest.mark.usefixtures("project")
def test_the_world_can_be_driven_from_room_to_room() -> None:
    """World, map and mission fit each other, and the stack plans through the door."""
    session = prepare("den", "next-room", seed=0, overrides=["mission.timeout=4"])
    assert session.shortest > 6.0
    result = session.run()
    assert result.outcome is Outcome.TIMEOUT
    ahead = [waypoint.place for waypoint in session.stack.state.path]
    assert {"door", "east"} <= set(ahead)
    assert result.metrics.collisions == 0


def test_the_tests_of_the_behaviour_pass(project: Path) -> None:
    for name in ("test_cautious", "test_slow_before_a_wall"):
        tests = {
            key: value
            for key, value in vars(_load(project / "tests" / f"{name}.py")).items()
            if key.startswith("test_")
        }
        assert len(tests) == 1
        for test in tests.values():
            test()


def test_the_mission_test_asks_for_the_mission_of_the_readme(project: Path) -> None:
    test = _load(project / "tests" / "test_den.py").test_the_robot_gets_to_the_next_room
    (marker,) = test.pytestmark
    assert marker.name == "mission"
    assert marker.kwargs == {"world": "den", "mission": "next-room", "seeds": [0, 1]}


@pytest.mark.slow
def test_the_tests_of_the_project_pass_as_its_owner_runs_them(project: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"]
    done = subprocess.run(  # noqa: S603 - this Python, words of our own
        command, cwd=project, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 passed" in done.stdout


@pytest.mark.usefixtures("project")
def test_the_code_that_asks_why_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "behaviors.md").read_text(encoding="utf-8")
    after = page[page.index("## Why did it do that?") :]
    (code,) = re.findall(r"^```python\n(.*?)^```$", after, re.MULTILINE | re.DOTALL)
    exec(compile(code, "behaviors.md", "exec"), {})  # noqa: S102 - our own page
    assert re.search(r"^go_to_xy 0\.\d+ .*'rule': 'IF ", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_worlds_missions_stacks_and_values_of_commands_exist(page: Path) -> None:
    for words in (line.split() for line in COMMAND.findall(page.read_text(encoding="utf-8"))):
        if words[0] != "run":
            continue
        world, mission = words[1:3]
        options = list(itertools.pairwise(words[3:]))
        overrides = [value for option, value in options if option == "--set"]
        stack = next((value for option, value in options if option == "--stack"), "default")
        try:
            prepare(world, mission, stack=stack, overrides=overrides)
        except Exception as error:
            if not any(parse_override(o).path[-1] == "latancy" for o in overrides):
                raise
            # the README shows this mistake with the message that it gives
            assert f"navfw: {error}\n" in page.read_text(encoding="utf-8")


def test_the_stack_of_the_readme_lists_what_it_says(project: Path) -> None:
    document = load_yaml(project / "stacks" / "careful.yaml")
    assert len(document.data["behaviors"]) == 5
    config = load_stack(project / "stacks" / "careful.yaml", default_registry())
    assert json.dumps(config.behaviors["cautious"].as_data()) == '{"cautious": {"weight": 0.7}}'


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    text = _without_code(page.read_text(encoding="utf-8"))
    broken = [link for link in LINK.findall(text) if not _leads_somewhere(page, link)]
    assert not broken


def test_the_tables_of_keys_are_those_of_the_models() -> None:
    tables = _load(ROOT / "docs" / "update_tables.py")
    for page in sorted((ROOT / "docs").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        assert tables.renewed(text) == text, "run: uv run python docs/update_tables.py"


def test_the_folders_of_the_readme_exist() -> None:
    rows = _table("## Where things are").splitlines()
    named = re.findall(r"`([\w/.]+)`", "\n".join(row.split("|")[1] for row in rows))
    assert len(named) > 20
    assert [name for name in named if not (ROOT / name).exists()] == []


# --- helpers -------------------------------------------------------------------------------------


def _table(heading: str) -> str:
    """The rows of the table under a heading of the README."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    body = re.split(r"\n##+ ", text.split(f"\n{heading}\n", 1)[1])[0]
    return "\n".join(line for line in body.splitlines() if line.startswith("| `"))


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def _leads_somewhere(page: Path, link: str) -> bool:
    if "://" in link:
        return link.startswith("https://")
    path, _, anchor = link.partition("#")
    target = (page.parent / path).resolve() if path else page
    if not target.exists() or ROOT not in target.parents:
        return False
    return not anchor or anchor in set(_anchors(target))


def _anchors(page: Path) -> Iterator[str]:
    for line in _without_code(page.read_text(encoding="utf-8")).splitlines():
        if line.startswith("#"):
            words = re.sub(r"[^\w\s-]", "", line.lstrip("#").strip().lower())
            yield re.sub(r"\s", "-", words)


def _load(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
