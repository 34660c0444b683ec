"""Trust in a project's code: what needs it, who gives it, where it is remembered."""

import contextlib
import json
import os
from pathlib import Path

import pytest
from cli_calls import put_files

from navfw.config import (
    MAX_NAMED,
    TRUST_VARIABLE,
    ProjectCode,
    TrustFile,
    asking,
    require_trust,
    trusting,
)
from navfw.errors import ConfigError, InputError, UnknownNameError, UntrustedCodeError

STRANGER = 54321
"""A user id that owns none of the files."""


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with one plugin around the working folder; nothing is trusted."""
    monkeypatch.delenv(TRUST_VARIABLE)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = tmp_path / "my-robot"
    put_files(folder, {"navfw.toml": "", "behaviors/hover.py": ""})
    monkeypatch.chdir(folder)
    return folder


def trust(folder: Path) -> None:
    TrustFile().add(folder, folder.stat().st_uid)


def is_refused() -> bool:
    with contextlib.suppress(UntrustedCodeError):
        require_trust()
        return False
    return True


def test_a_project_with_plugins_is_refused_with_the_remedy(project: Path) -> None:
    with pytest.raises(UntrustedCodeError) as refused:
        require_trust()
    remedies = (f"navfw trust {project}", "--trust", f"{TRUST_VARIABLE}=1")
    for part in (str(project), "behaviors/hover.py", *remedies):
        assert part in str(refused.value)
    assert not TrustFile().path.exists()


def test_without_project_or_plugins_no_trust_is_needed(project: Path) -> None:
    (project / "navfw.toml").unlink()
    require_trust()
    (project / "navfw.toml").touch()
    (project / "behaviors" / "hover.py").rename(project / "behaviors" / "_helper.py")
    put_files(project, {"plugins/rules.yaml": ""})
    require_trust()
    put_files(project, {"plugins/flow.py": ""})
    with pytest.raises(UntrustedCodeError, match=r"plugins/flow\.py"):
        require_trust()


def test_trust_is_remembered_by_real_path_and_owner(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trust(project)
    require_trust()
    link = project.with_name("link")
    link.symlink_to(project)
    monkeypatch.chdir(link)
    require_trust()
    entries = [{"path": str(project), "owner": project.stat().st_uid}]
    assert json.loads(TrustFile().path.read_text()) == {"trusted": entries}
    assert TrustFile().path.stat().st_mode & 0o777 == 0o600
    moved = project.with_name("moved")
    project.rename(moved)
    monkeypatch.chdir(moved)
    assert is_refused()
    TrustFile().add(moved, STRANGER)
    assert is_refused()


def test_trust_is_taken_back_and_given_again(project: Path) -> None:
    trust(project)
    TrustFile().remove(project)
    assert TrustFile().folders() == ()
    assert is_refused()
    TrustFile().add(project, STRANGER)
    trust(project)
    assert [entry.owner for entry in TrustFile().folders()] == [project.stat().st_uid]
    with pytest.raises(UnknownNameError, match=f"did you mean '{project}'"):
        TrustFile().remove(project.with_name("my-robto"))


@pytest.mark.parametrize(
    ("value", "trusted"),
    [
        ("1", True),
        ("{}", True),
        ("/elsewhere:{}", True),
        ("", False),
        ("0", False),
        ("yes", False),
        (".", False),
        ("{}/behaviors", False),
        ("/", False),
    ],
)
def test_the_environment_variable(
    value: str, trusted: bool, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(TRUST_VARIABLE, value.format(project))
    assert is_refused() != trusted


def test_trusting_ends_with_its_context(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in (None, project):
        with trusting(folder):
            require_trust()
        assert TRUST_VARIABLE not in os.environ
        assert is_refused()
    with trusting(project.with_name("other")):
        assert is_refused()
    monkeypatch.setenv(TRUST_VARIABLE, "/elsewhere")
    with trusting(project):
        require_trust()
        assert os.environ[TRUST_VARIABLE] == f"/elsewhere:{project}"
    assert os.environ[TRUST_VARIABLE] == "/elsewhere"


def test_a_yes_is_remembered_and_a_no_is_not(project: Path) -> None:
    asked: list[ProjectCode] = []

    def answer(code: ProjectCode) -> bool:
        asked.append(code)
        return len(asked) > 1

    with asking(answer):
        assert is_refused()
        require_trust()
        require_trust()
    require_trust()
    file = project / "behaviors" / "hover.py"
    assert asked == 2 * [ProjectCode(project, project.stat().st_uid, (file,))]


@pytest.mark.parametrize("part", [".", "behaviors", "behaviors/hover.py"])
def test_code_that_anyone_may_write_to_is_not_trusted(part: str, project: Path) -> None:
    trust(project)
    (project / part).chmod(0o777)
    with asking(lambda _: True), pytest.raises(UntrustedCodeError, match="chmod o-w") as refused:
        require_trust()
    assert str(refused.value).startswith(str((project / part).resolve()))
    with trusting():
        require_trust()


def test_code_of_a_third_user_is_not_trusted(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = ProjectCode.around()
    assert code is not None
    assert code.unsafe_part() is None
    theirs = ProjectCode(code.folder, STRANGER, code.files)
    assert theirs.unsafe_part() is None  # the owner's, and this user's own files
    monkeypatch.setattr(os, "geteuid", lambda: STRANGER + 1)
    assert theirs.unsafe_part() == project


def test_many_files_are_counted_and_unprintable_characters_are_not_shown(project: Path) -> None:
    for number in range(MAX_NAMED + 5):
        (project / "behaviors" / f"x{number:02d}.py").touch()
    (project / "behaviors" / "a\x1b[2K\r\u202e.py").touch()
    code = ProjectCode.around()
    assert code is not None
    first, *others, last = code.names()
    assert (first, last) == ("behaviors/a?[2K??.py", "and 7 more")
    assert len(others) == MAX_NAMED - 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "trusted.json"),
        ('{"trusted": 3}', r"trusted\.json:1: trusted: expected a list"),
        ('{"trusted": [{"path": "/x"}]}', "owner: missing"),
        ('{"trusted": [{"path": "x", "owner": 0}]}', "path"),
        ("", "trusted.json"),
    ],
)
def test_a_damaged_file_of_trusted_folders_trusts_nothing(
    text: str, message: str, project: Path
) -> None:
    trust(project)
    TrustFile().path.write_text(text)
    with asking(lambda _: True), pytest.raises(ConfigError, match=message) as damaged:
        require_trust()
    assert str(damaged.value).endswith("correct or remove the file of trusted folders")
    with trusting():  # does not read it
        require_trust()


def test_a_file_that_others_may_write_to_trusts_nothing(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trust(project)
    file = TrustFile().path
    for part, mode in ((file, 0o666), (file.parent, 0o777)):
        before = part.stat().st_mode
        part.chmod(mode)
        with pytest.raises(ConfigError, match="some other user can write to it"):
            require_trust()
        part.chmod(before)
    require_trust()
    owner = project.stat().st_uid
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    with pytest.raises(ConfigError, match="some other user can write to it"):
        TrustFile().has(project, owner)


def test_a_configuration_folder_of_the_working_folder_is_ignored(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trust(project)
    (project / "navfw").mkdir()
    TrustFile().path.rename(project / "navfw" / "trusted.json")
    monkeypatch.setenv("XDG_CONFIG_HOME", ".")
    monkeypatch.setenv("HOME", str(project.with_name("home")))
    assert TrustFile().path == project.with_name("home") / ".config" / "navfw" / "trusted.json"
    assert is_refused()


def test_a_file_that_cannot_be_written_and_a_folder_that_cannot_be_written_down(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="rename the folder"):
        TrustFile().add(project / "a\x1bb", 0)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(project / "navfw.toml"))
    with pytest.raises(InputError, match="cannot be written"):
        trust(project)
