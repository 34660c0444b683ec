"""Revision and machine of a result: kinds of checkout, configurations that name programs."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from cli_calls import put_files
from processes import run

from navfw.config import lookup
from navfw.recording import GitCheckout, code_revision, git_revision, machine_kind


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


def touch(file: Path) -> None:
    """Let git look into the file: its time is another than in the index."""
    os.utime(file, (1_000_000_000, 1_000_000_000))


def monitor(repository: Path, program: Path) -> None:
    git(repository, "config", "core.fsmonitor", str(program))


def included(repository: Path, program: Path, key: str = "include.path") -> None:
    (repository / "more").write_text(f"[core]\n\tfsmonitor = {program}\n")
    git(repository, "config", key, "../more")


def included_by_folder(repository: Path, program: Path) -> None:
    included(repository, program, "includeIf.gitdir:**.path")


def clean_filter(repository: Path, program: Path, key: str = "filter.evil.clean") -> None:
    git(repository, "config", key, str(program))
    (repository / ".gitattributes").write_text("*.txt filter=evil\n")


def filter_process(repository: Path, program: Path) -> None:
    clean_filter(repository, program, "filter.evil.process")


def hook(repository: Path, program: Path, folder: str = ".git/hooks") -> None:
    (repository / folder).mkdir(exist_ok=True)
    (repository / folder / "post-index-change").symlink_to(program)


def hooks_path(repository: Path, program: Path) -> None:
    hook(repository, program, "elsewhere")
    git(repository, "config", "core.hooksPath", "elsewhere")


def ssh_command(repository: Path, program: Path) -> None:
    """A partial clone without its tree: git would fetch it, by ssh."""
    git(repository, "config", "core.repositoryFormatVersion", "1")
    git(repository, "config", "extensions.partialClone", "origin")
    git(repository, "config", "remote.origin.url", "ssh://example.invalid/x")
    git(repository, "config", "remote.origin.promisor", "true")
    git(repository, "config", "core.sshCommand", str(program))
    tree = git(repository, "rev-parse", "HEAD^{tree}")
    (repository / ".git" / "objects" / tree[:2] / tree[2:]).unlink()


def submodule(repository: Path, program: Path) -> None:
    other = commit(repository.parent / "other")
    git(repository, "submodule", "--quiet", "add", str(other), "part")
    git(repository, "commit", "-qm", "second")
    git(repository / "part", "config", "core.fsmonitor", str(program))


def other_programs(repository: Path, program: Path) -> None:
    """Settings that only other commands of git obey."""
    for key in ("alias.status", "alias.ls-files"):
        git(repository, "config", key, f"!{program}")
    keys = """
        diff.external diff.evil.textconv diff.evil.command gpg.program credential.helper
        core.pager core.editor core.gitProxy uploadpack.packObjectsHook
    """
    for key in keys.split():
        git(repository, "config", key, str(program))
    (repository / ".gitattributes").write_text("*.txt diff=evil\n")


Trap = Callable[[Path, Path], None]
SPRUNG_BY_STATUS: list[Trap] = [monitor, included, included_by_folder, clean_filter]
SPRUNG_BY_STATUS += [filter_process, hook, hooks_path, ssh_command, submodule]


@pytest.mark.parametrize("trap", [*SPRUNG_BY_STATUS, other_programs], ids=lambda t: t.__name__)
def test_nothing_that_a_configuration_names_is_executed(trap: Trap, repository: Path) -> None:
    marker = repository.parent / "executed"
    program = repository.parent / "program"
    program.write_text(f"#!/bin/sh\ntouch {marker}\n")
    program.chmod(0o755)
    trap(repository, program)
    head = (repository / ".git" / "refs" / "heads" / "main").read_text().strip()
    fetched = trap is not ssh_command  # what is missing is not fetched
    marker.unlink(missing_ok=True)
    touch(repository / "a.txt")
    assert git_revision(repository) == (head if fetched else None)
    assert GitCheckout.around(repository) is not None
    (repository / "a.txt").write_text("two\n")
    assert git_revision(repository) == (f"{head}-dirty" if fetched else None)
    assert not marker.exists()
    if trap in SPRUNG_BY_STATUS:  # else this test would prove nothing
        (repository / "a.txt").write_text("one\n")
        touch(repository / "a.txt")  # git refreshes the file's times, and writes the index
        git(repository, "status", "--porcelain", check=False)
        assert marker.exists()


def test_a_worktree_has_its_own_commit_and_changes(repository: Path, tmp_path: Path) -> None:
    first = git(repository, "rev-parse", "HEAD")
    tree = tmp_path / "tree"
    git(repository, "worktree", "add", "-q", "-b", "side", str(tree))
    (tree / "a.txt").write_text("two\n")
    assert git_revision(tree) == f"{first}-dirty"
    git(tree, "commit", "-qam", "second")
    assert git_revision(tree) == git(tree, "rev-parse", "HEAD") != first
    assert git_revision(repository) == first


def test_a_submodule_has_its_own_commit_which_counts_outside(
    repository: Path, tmp_path: Path
) -> None:
    other = commit(tmp_path / "other")
    git(repository, "submodule", "--quiet", "add", str(other), "part")
    git(repository, "commit", "-qm", "second")
    part, head = repository / "part", git(repository, "rev-parse", "HEAD")
    assert git_revision(part) == git(other, "rev-parse", "HEAD")
    (part / "a.txt").write_text("two\n")
    assert str(git_revision(part)).endswith("-dirty")
    assert git_revision(repository) == head
    git(part, "commit", "-qam", "third")
    assert git_revision(repository) == f"{head}-dirty"


@pytest.mark.parametrize(
    "words",
    [
        ("pack-refs", "--all"),
        ("gc", "-q"),
        ("checkout", "-q", "--detach"),
        ("update-index", "--split-index"),
        ("update-index", "--index-version", "4"),
        ("symbolic-ref", "refs/heads/alias", "refs/heads/main"),
    ],
    ids=" ".join,
)
def test_other_forms_of_refs_and_index(repository: Path, words: tuple[str, ...]) -> None:
    git(repository, *words)
    if words[0] == "symbolic-ref":
        git(repository, "symbolic-ref", "HEAD", words[1])
    head = git(repository, "rev-parse", "HEAD")
    assert git_revision(repository) == head
    (repository / "a.txt").write_text("two\n")
    git(repository, "add", "a.txt")
    assert git_revision(repository) == f"{head}-dirty"


def test_no_commit_no_checkout_and_a_folder_that_anyone_may_write_to_have_no_revision(
    repository: Path,
) -> None:
    assert git_revision(repository.parent) is None
    git(repository.parent, "init", "-q")
    assert git_revision(repository.parent) is None
    assert git_revision(repository) is not None
    repository.chmod(0o1777)
    assert git_revision(repository) is None


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("HEAD", "ref: ../../secret"),
        ("HEAD", "ref: refs/../../secret"),
        ("HEAD", "\0"),
        ("HEAD", "ref: refs/heads/\0"),
        ("refs/heads/main", "ref: refs/heads/main"),
        ("index", "torn"),
        ("objects", None),
        ("HEAD", None),
    ],
)
def test_a_damaged_repository_has_no_revision(
    repository: Path, name: str, text: str | None
) -> None:
    damaged = repository / ".git" / name
    damaged.rename(repository.parent / "secret")
    if text is not None:
        damaged.write_text(text)
    assert git_revision(repository) is None


def test_a_link_that_leads_nowhere_and_a_pipe_have_no_revision(repository: Path) -> None:
    link = repository / "below" / ".git"
    link.parent.mkdir()
    for text in ("gitdir: ", "gitdir: ../gone", "gitdir: \0", "something else"):
        link.write_text(text)
        assert git_revision(link.parent) is None
    link.unlink()
    assert git_revision(link.parent) is not None
    (repository / ".git" / "HEAD").unlink()
    os.mkfifo(repository / ".git" / "HEAD")
    assert git_revision(repository) is None


def test_a_checkout_of_another_user_is_not_looked_at(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert git_revision(repository) is not None
    monkeypatch.setattr(os, "geteuid", lambda: repository.stat().st_uid + 1)
    assert GitCheckout.around(repository) is None
    monkeypatch.chdir(repository)
    (repository / "navfw.toml").touch()
    assert code_revision() == "navfw 0.1.0"


@pytest.mark.parametrize("foreign", [".", ".git", ".git/objects", "below"])
def test_one_part_of_another_user_is_enough(
    repository: Path, foreign: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (repository / "below").mkdir()
    assert GitCheckout.around(repository / "below") is not None
    theirs = (repository / foreign).resolve()

    def owned(path: Path) -> bool:
        return path.resolve() != theirs

    monkeypatch.setattr(lookup, "owned_by_user", owned)
    monkeypatch.setattr("navfw.recording.provenance.owned_by_user", owned)
    assert GitCheckout.around(repository / "below") is None


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
