"""Revision and machine of a result: kinds of checkout, configurations that name programs."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from cli_calls import put_files
from processes import run

from navfw.recording import code_revision, machine_kind
from navfw.recording.provenance import git_revision


def git(folder: Path, *words: str, check: bool = True) -> str:
    """What git prints when called in ``folder``, as an author of its own."""
    who = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    files = ["-c", "protocol.file.allow=always"]
    return run(["git", "-C", folder, *who, *files, *words], check=check).stdout.strip()


def commit(folder: Path, *options: str, files: Sequence[str] = ("a.txt",)) -> Path:
    """A new repository with these files committed."""
    put_files(folder, dict.fromkeys(files, "one\n"))
    git(folder, "init", "-q", "-b", "main", *options)
    git(folder, "add", ".")
    git(folder, "commit", "-qm", "first")
    return folder


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    return commit(tmp_path / "repository")


def test_no_monitor_of_the_repository_is_executed(repository: Path, tmp_path: Path) -> None:
    marker, program = tmp_path / "executed", tmp_path / "program"
    program.write_text(f"#!/bin/sh\ntouch {marker}\n")
    program.chmod(0o755)
    git(repository, "config", "core.fsmonitor", str(program))
    assert git_revision(repository) is not None
    assert not marker.exists()
    git(repository, "status", "--porcelain", check=False)
    assert marker.exists(), "else this test would prove nothing"


def test_a_worktree_has_its_own_commit_and_changes(repository: Path, tmp_path: Path) -> None:
    first = git(repository, "rev-parse", "HEAD")
    tree = tmp_path / "tree"
    git(repository, "worktree", "add", "-q", "-b", "side", str(tree))
    (tree / "a.txt").write_text("two\n")
    assert git_revision(tree) == f"{first}-dirty"
    git(tree, "commit", "-qam", "second")
    assert git_revision(tree) == git(tree, "rev-parse", "HEAD") != first
    assert git_revision(repository) == first


def test_without_a_commit_or_a_repository_there_is_no_revision(repository: Path) -> None:
    assert git_revision(repository.parent) is None
    git(repository.parent, "init", "-q")
    assert git_revision(repository.parent) is None
    (repository / ".git" / "HEAD").write_text("damaged")
    assert git_revision(repository) is None


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return commit(tmp_path, files=("navfw.toml", "docs/page.md"))


def test_a_changed_tree_is_marked_dirty_except_for_docs(project: Path) -> None:
    head = git(project, "rev-parse", "HEAD")
    assert git_revision(project / "docs") == head
    (project / "docs" / "page.md").write_text("written between two runs")
    (project / "untracked.txt").touch()
    assert git_revision(project / "docs") == head
    (project / "navfw.toml").write_text("# changed")
    assert git_revision(project / "docs") == f"{head}-dirty"


def test_the_project_s_revision_takes_precedence_over_navfw_s_and_its_version(
    project: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project)
    assert code_revision() == git(project, "rev-parse", "HEAD")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert code_revision().startswith("navfw ") or len(code_revision().split("-")[0]) == 40
    monkeypatch.setattr("shutil.which", lambda _: None)  # without git
    assert code_revision() == "navfw 0.1.0"


def test_the_machine_kind_has_no_host_name() -> None:
    machine = machine_kind()
    assert set(machine) == {"processor", "cores", "python", "system"}
    assert machine["cores"] >= 1
    assert machine["processor"]
