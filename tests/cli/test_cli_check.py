"""``navfw check``: all errors of a project at once, each with its place and remedy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_calls import invoke, put_files

BEHAVIOR = '''
from typing import ClassVar
from navfw import Context, Proposal, RuledBehavior

class {cls}(RuledBehavior):
    """Keeps its position."""
    name: ClassVar[str] = "{name}"

    def propose(self, context: Context) -> Proposal:
        raise NotImplementedError
'''

RULES = """
name: {name}
inputs:
  ahead:
    range: [0, 3]
    terms:
      little: {{trapezoid: [0, 0, 0.5, 1.5]}}
      plenty: {{trapezoid: [0.5, 1.5, 3, 3]}}
outputs:
  speed:
    range: [0, 1]
    terms:
      slow: {{triangle: [0, 0.3, 0.6]}}
rules:
  - IF ahead IS little THEN speed IS slow
"""

COVERING = RULES + "  - IF ahead IS plenty THEN speed IS slow\n"

GOOD = {
    "navfw.toml": "",
    "behaviors/sound.py": BEHAVIOR.format(cls="Sound", name="sound"),
    "behaviors/sound.yaml": COVERING.format(name="sound"),
    "stacks/mine.yaml": "base: default\nbehaviors: {sound: }\n",
    "worlds/empty/missions/own.yaml": (
        "map: empty\nstart: [0, 0, 0]\ngoals: [east]\nstack: mine\ntimeout: 30\n"
    ),
    "robots/slow.yaml": "max_v: 0.2\n",
}

BAD = {
    "behaviors/lonely.py": BEHAVIOR.format(cls="Lonely", name="lonely"),
    "behaviors/open.py": BEHAVIOR.format(cls="Open", name="open"),
    "behaviors/open.yaml": RULES.format(name="open"),
    "behaviors/typo.py": BEHAVIOR.format(cls="Typo", name="typo"),
    "behaviors/typos.yaml": COVERING.format(name="typo"),
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
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A sound project, trusted, in the working folder."""
    put_files(tmp_path, GOOD)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NAVFW_TRUST", "1")
    return tmp_path


def test_a_sound_project_passes(project: Path) -> None:
    done = invoke("check")
    assert (done.exit_code, done.stdout) == (0, "4 checked, 0 wrong\n")


def test_every_error_is_told_at_once(project: Path) -> None:
    put_files(project, BAD)
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


def test_plugins_lists_a_behaviour_without_covering_rules_as_broken(project: Path) -> None:
    put_files(project, BAD)
    done = invoke("list", "plugins", "--kind", "behavior", "--json")
    status = {row["name"]: row["status"] for row in json.loads(done.stdout)}
    assert done.exit_code == 2
    assert {name for name in status if status[name] == "broken"} == {"lonely", "open", "typo"}


def test_single_files_are_checked_by_their_folder_or_keys(project: Path) -> None:
    put_files(project, BAD | {"elsewhere.yaml": RULES.format(name="open"), "other.yaml": "x: 1\n"})
    done = invoke("check", "--json", "elsewhere.yaml", "other.yaml", "behaviors/sound.py", "robots")
    rows = {row["source"]: row for row in json.loads(done.stdout)}
    kinds = [row["kind"] for row in rows.values()]
    assert kinds == ["behavior", "rule base", None, "robot", "robot"]
    assert rows["robots/slow.yaml"]["error"] is None
    assert "no file of navfw" in rows["other.yaml"]["error"]
    assert done.exit_code == 2


def test_use_of_the_simulator_is_noted(project: Path) -> None:
    put_files(project, {"behaviors/sound.py": SIMULATES})
    done = invoke("check", "behaviors")
    assert "note: behaviors/sound.py:12: imports pybullet" in done.stdout
    assert done.exit_code == 0


def test_outside_a_project_files_must_be_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = invoke("check")
    assert done.exit_code == 2
    assert "no project here" in done.output
    missing = invoke("check", "nothing.yaml")
    assert (missing.exit_code, "there is no such file" in missing.output) == (2, True)
