"""The revision and the kind of machine of a result."""

from __future__ import annotations

from pathlib import Path

import pytest
from git_samples import git

from navfw.recording import code_revision, git_revision, machine_kind


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    for name in ("navfw.toml", "docs/page.md"):
        (tmp_path / name).write_text("")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "first")
    return tmp_path


def test_a_changed_tree_is_marked_dirty_except_for_docs(repository: Path) -> None:
    head = git(repository, "rev-parse", "HEAD")
    assert git_revision(repository / "docs") == head
    (repository / "docs" / "page.md").write_text("written between two runs")
    (repository / "untracked.txt").touch()
    assert git_revision(repository / "docs") == head
    (repository / "navfw.toml").write_text("# changed")
    assert git_revision(repository / "docs") == f"{head}-dirty"


def test_the_project_s_revision_takes_precedence_over_navfw_s(
    repository: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(repository)
    assert code_revision() == git(repository, "rev-parse", "HEAD")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert code_revision().startswith("navfw ") or len(code_revision().split("-")[0]) == 40


def test_without_git_the_version_is_the_revision(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    assert code_revision() == "navfw 0.1.0"


def test_the_machine_kind_has_no_host_name() -> None:
    found = machine_kind()
    assert set(found) == {"processor", "cores", "python", "system"}
    assert found["cores"] >= 1
    assert found["processor"]
