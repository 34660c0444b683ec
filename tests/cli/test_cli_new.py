"""``navfw new project``: what it writes passes, and nothing is ever overwritten."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from docs_pages import ROOT, blocks_of
from typer.testing import CliRunner, Result

from navfw.cli import app


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, in which all projects are trusted."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NAVFW_TRUST", "1")
    return tmp_path


def navfw(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


def test_a_new_project_is_sound(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = navfw("new", "project", "mine")
    assert done.exit_code == 0, done.output
    written = {str(p.relative_to("mine")) for p in Path("mine").rglob("*") if p.is_file()}
    assert {line.strip() for line in done.stdout.splitlines()[1:-1]} == written
    assert {"navfw.toml", ".gitignore", "behaviors/cautious.py", "README.md"} <= written
    monkeypatch.chdir(folder / "mine")
    checked = navfw("check")
    assert (checked.exit_code, checked.stdout) == (0, "5 checked, 0 wrong\n")


def test_every_file_of_a_new_project_has_its_schema_in_the_editor(folder: Path) -> None:
    navfw("new", "project", "mine")
    project = folder / "mine"
    wired = json.loads((project / ".vscode/settings.json").read_text())["yaml.schemas"]
    schemas = {path.relative_to(project) for path in project.glob(".vscode/schemas/*.json")}
    assert {Path(name) for name in wired} == schemas
    found = {path: name for name, pattern in wired.items() for path in project.glob(pattern)}
    files = {path for path in project.rglob("*.yaml") if ".github" not in path.parts}
    assert set(found) == files
    for path, name in found.items():
        known = json.loads((project / name).read_text())["properties"]
        assert set(yaml.safe_load(path.read_text())) <= set(known), path


def test_an_empty_folder_is_taken_and_another_is_not(folder: Path) -> None:
    (folder / "empty").mkdir()
    assert navfw("new", "project", "empty").exit_code == 0
    (folder / "mine").mkdir()
    (folder / "mine/notes.txt").write_text("keep")
    done = navfw("new", "project", "mine")
    assert done.exit_code == 2
    assert "mine: contains 'notes.txt', so it is not replaced; choose another DIR" in done.output
    assert [path.name for path in (folder / "mine").iterdir()] == ["notes.txt"]


def test_no_project_within_a_project(folder: Path) -> None:
    navfw("new", "project", "mine")
    for inside in ("mine/second", "mine/a/b"):
        done = navfw("new", "project", inside)
        assert done.exit_code == 2
        assert "is within the project mine; choose a folder outside of it" in done.output
        assert not (folder / "mine" / inside).exists()


def test_a_folder_that_cannot_be_written(folder: Path) -> None:
    (folder / "file").write_text("keep")
    done = navfw("new", "project", "file/mine")
    assert (done.exit_code, "file/mine: cannot be written" in done.output) == (2, True)
    assert [path.name for path in folder.iterdir()] == ["file"]


def test_a_file_in_the_way(folder: Path) -> None:
    (folder / "mine").write_text("keep")
    done = navfw("new", "project", "mine")
    assert (done.exit_code, "expected a folder, got a file" in done.output) == (2, True)
    assert (folder / "mine").read_text() == "keep"


@pytest.mark.slow
def test_five_commands_lead_to_an_edited_behaviour_that_passes(folder: Path) -> None:
    """Those of the README, typed in a shell by a user with a home of his own."""
    (block,) = (b for b in blocks_of(ROOT / "README.md") if "navfw new project" in b.text)
    lines = re.findall(r"^\$ (.*)$", block.text, re.MULTILINE)
    assert len(lines) == 5
    environment = {key: value for key, value in os.environ.items() if key != "NAVFW_TRUST"}
    environment |= {
        "HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder / "config"),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    done = subprocess.run(  # noqa: S603 - commands of our own page
        ["/bin/sh", "-ec", "\n".join(lines)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "IF ahead IS very little" in (folder / "my-robot/behaviors/cautious.yaml").read_text()
    assert "2 passed" in done.stdout
