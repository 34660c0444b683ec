"""``navfw list`` and ``navfw schema``."""

import json
from pathlib import Path
from typing import Any

import pytest
from cli_calls import invoke, navfw, output, put_file, put_files, refusal, sole_refusal

from navfw.config import list_files
from navfw.config.document import load_yaml
from navfw.config.file_kinds import FILE_KINDS

BEHAVIOR = '''
print("hello from a plugin")
import os
os.write(1, b"hello from below\\n")
from navfw.interfaces import Behavior
from typing import Annotated
from pydantic import Field

class Hover(Behavior):
    """Keeps its position."""
    name = "hover"

    class Params(Behavior.Params):
        height: Annotated[float, Field(gt=0, description="above the floor [m]")] = 0.5

    def propose(self, context): pass
'''


@pytest.fixture
def project(workdir: Path) -> Path:
    """A user's project with valid and broken files of every kind."""
    files = {
        "navfw.toml": "",
        "behaviors/hover.py": BEHAVIOR,
        "behaviors/bad.py": "def f(:\n",
        "worlds/barn/world.yaml": "description: A barn [with hay].\nname: barn\n",
        "worlds/barn/missions/cross.yaml": (
            "description: Across.\nmap: barn\nstart: [1, 2.5, 0]\ngoals: [gate, {x: 3, y: 4}]\n"
            "timeout: 60\n"
        ),
        "worlds/barn/missions/bad.yaml": "goals: []\n",
        "worlds/ruin/world.yaml": "a: 1\na: 2\n",
        "maps/barn.yaml": "places: {gate: {x: 1, y: 2}, door: {x: 2, y: 2}}\nedges: [{}]\n",
        "maps/torn.yaml": "- 1\n",
        "stacks/torn.yaml": "description: [x]\n",
        "robots/torn.yaml": "radius: wide\n",
    }
    put_files(workdir, files)
    return workdir


def listed(*arguments: str) -> dict[str, dict[str, Any]]:
    """The listing that the command gives with --json, by name."""
    done = invoke(*arguments, "--json")
    rows = json.loads(done.stdout)
    broken = any(row["status"] == "broken" for row in rows)
    assert done.exit_code == (2 if broken and "plugins" in arguments else 0), done.output
    assert isinstance(rows, list)
    assert all(next(iter(row)) == "name" for row in rows)
    return {row["name"]: row for row in rows}


def test_worlds(project: Path) -> None:
    rows = listed("list", "worlds")
    assert rows["barn"] == {
        "name": "barn",
        "description": "A barn [with hay].",
        "missions": ["bad", "cross"],
        "status": "ok",
        "source": "project",
        "path": "worlds/barn/world.yaml",
        "error": None,
    }
    error = "worlds/ruin/world.yaml:2: a: duplicate key; first given in line 1"
    assert (rows["ruin"]["status"], rows["ruin"]["error"]) == ("broken", error)
    assert (rows["office"]["source"], rows["office"]["status"]) == ("shipped", "ok")


def test_missions(project: Path) -> None:
    rows = listed("list", "missions", "barn")
    assert rows["cross"] == {
        "name": "cross",
        "description": "Across.",
        "map": "barn",
        "start": [1.0, 2.5, 0.0],
        "goals": ["gate", {"x": 3, "y": 4}],
        "timeout": 60.0,
        "status": "ok",
        "source": "project",
        "path": "worlds/barn/missions/cross.yaml",
        "error": None,
    }
    assert "bad.yaml:1: start: missing" in rows["bad"]["error"]


def test_maps_and_stacks(project: Path) -> None:
    rows = listed("list", "maps")
    assert (rows["barn"]["places"], rows["barn"]["edges"]) == (2, 1)
    assert "maps/torn.yaml:1: expected a mapping" in rows["torn"]["error"]
    rows = listed("list", "stacks")
    assert rows["default"]["plugins"]["flow"] == ["block_matching"]
    assert "stacks/torn.yaml:1: description: expected text" in rows["torn"]["error"]


def test_plugins(project: Path) -> None:
    rows = listed("list", "plugins", "--kind", "behavior")
    assert rows["hover"]["status"] == "ok"
    assert rows["hover"]["summary"] == "Keeps its position."
    assert rows["hover"]["parameters"] == [
        {
            "name": "height",
            "type": "float",
            "default": 0.5,
            "required": False,
            "bounds": "> 0",
            "description": "above the floor [m]",
        }
    ]
    assert rows["bad"]["status"] == "broken"
    assert rows["bad"]["error"].startswith("behaviors/bad.py:1: cannot be imported: SyntaxError")
    assert {"avoid", "go_to_xy"} <= set(rows)
    assert {row["kind"] for row in rows.values()} == {"behavior"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["list", "worlds"],
            ["barn", "A barn [with hay].", "broken: worlds/ruin/world.yaml:2", "office"],
        ),
        (
            ["list", "missions", "barn"],
            ["cross", "1, 2.5, 0", "gate, x 3, y 4", "60", "start: missing"],
        ),
        (["list", "maps"], ["barn", "broken: maps/torn.yaml:1"]),
        (["list", "stacks"], ["default", "flow block_matching", "broken: stacks/torn.yaml:1"]),
        (["list", "robots"], ["default", "160 x 120, 90 deg", "broken: robots/torn.yaml:1"]),
        (
            ["list", "plugins"],
            ["hover", "Keeps its position.", "broken: behaviors/bad.py:1", "dis", "flow"],
        ),
        (
            ["list", "plugins", "--parameters"],
            ["hover", "> 0", "above the floor [m]", "= 0.5", "broken: behaviors/bad.py:1", "flow"],
        ),
    ],
)
def test_tables(project: Path, arguments: list[str], words: list[str]) -> None:
    done = invoke(*arguments)
    assert done.exit_code == (2 if "plugins" in arguments else 0)
    flat = " ".join(done.stdout.split())
    assert [word for word in words if word not in flat] == []


def test_nothing_to_list(project: Path) -> None:
    put_file(project, "worlds/empty-handed/world.yaml", "description: x")
    words = ("list", "missions", "empty-handed")
    assert output(*words) == "The world empty-handed has no missions.\n"
    assert listed(*words) == {}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["list", "missions", "bran"], "navfw: unknown world 'bran': did you mean 'barn'?\n"),
        (["list", "missions", "./nowhere.yaml"], "navfw: nowhere.yaml: there is no such file\n"),
        (
            ["list", "plugins", "--kind", "flw"],
            "navfw: unknown kind of plugin 'flw': did you mean 'flow'?\n",
        ),
    ],
)
def test_invalid_input_gives_one_message_and_exit_code_2(
    project: Path, arguments: list[str], message: str
) -> None:
    assert sole_refusal(*arguments) == sole_refusal(*arguments, "--json") == message


@pytest.mark.thorough
def test_stdout_is_json_alone_in_a_real_process(project: Path) -> None:
    done = navfw("list", "plugins", "--json")
    assert done.returncode == 2, done.stderr
    names = [row["name"] for row in json.loads(done.stdout)]
    assert {"hover", "bad", "avoid"} <= set(names)
    assert "hello from a plugin" in done.stderr
    assert "hello from below" in done.stderr


def test_a_terminal_without_unicode_is_supported(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_file(project, "worlds/barn/world.yaml", "description: Müller's — barn ☃\n")
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    for arguments in (["list", "worlds"], ["list", "worlds", "--json"]):
        done = navfw(*arguments)
        assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)[0]["description"] == "Müller's — barn ☃"


@pytest.mark.usefixtures("project")
def test_run_without_a_mission_lists_those_of_the_world() -> None:
    message = "navfw: give --goal, or one of the missions of barn: bad, cross"
    assert message in refusal("run", "barn")


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_the_schema_knows_every_key_of_the_shipped_files(kind: str) -> None:
    schema = json.loads(output("schema", kind))
    assert schema["$schema"].endswith("2020-12/schema")
    assert schema["additionalProperties"] is False
    for file in list_files(kind):
        keys = load_yaml(file.path).data
        assert isinstance(keys, dict)
        assert set(keys) - set(schema["properties"]) == set(), file.path


def test_an_unknown_kind_gives_the_nearest() -> None:
    said = refusal("schema", "mision")
    assert "unknown kind of file 'mision': did you mean 'mission'?" in said


HOSTILE = "a\x1b]0;title\x07\x1b[31m\u202e\u200b\x9b2J"
"""Sets a terminal's title and colour, turns the direction of text, and clears the screen."""


def test_texts_of_files_do_not_reach_the_terminal_as_they_are(project: Path) -> None:
    """Descriptions, names in errors, words of the command line; JSON keeps them, in ASCII."""
    text = json.dumps(HOSTILE)
    put_files(
        project,
        {
            "worlds/barn/world.yaml": f"description: {text}\nname: barn\n",
            "stacks/odd.yaml": f"description: {text}\nbase: default\n",
            "suites/odd.yaml": f"description: {text}\n{text}: 1\n",
            "maps/odd.yaml": f"name: {text}\nplaces: 1\n",
            "rules/odd.yaml": f"name: {text}\ninputs: {{}}\n",
            "robots/odd.yaml": f"{text}: 1\n",
        },
    )
    commands: list[tuple[str, ...]] = [
        ("list", kind.plural) for kind in FILE_KINDS.values() if kind.plural
    ]
    commands += [("list", "missions", "barn"), ("check",), ("run", "barn", HOSTILE)]
    printed = "".join(invoke(*words).output for words in commands)
    assert "\\x1b[31m\\u202e\\u200b" in printed
    assert not set(HOSTILE) & set(printed) - {*"a]0;title[3m1J2"}
    (row,) = (
        row for row in json.loads(output("list", "worlds", "--json")) if row["name"] == "barn"
    )
    assert row["description"] == HOSTILE
