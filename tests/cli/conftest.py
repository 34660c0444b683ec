"""Working folders of commands: an empty one, and a new project."""

from pathlib import Path

import pytest
from cli_calls import output


@pytest.fixture
def folder(workdir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, in which all projects are trusted."""
    monkeypatch.setenv("NAVFW_TRUST", "1")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(workdir.with_name("config")))
    return workdir


@pytest.fixture
def project(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new project: the working folder, and trusted."""
    output("new", "project", "mine")
    monkeypatch.chdir(folder / "mine")
    return folder / "mine"
