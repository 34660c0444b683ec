"""Trust in a project's code: what needs it, who gives it, where it is remembered."""

import contextlib
import os
from pathlib import Path

import pytest
from cli_calls import put_files

from navfw.config.project_trust import (
    MAX_NAMED,
    TRUST_VARIABLE,
    ProjectCode,
    asking,
    require_trust,
    trust,
    trust_file,
    trusting,
)
from navfw.errors import UntrustedCodeError


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with one plugin around the working folder; nothing is trusted."""
    monkeypatch.delenv(TRUST_VARIABLE)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = tmp_path / "my-robot"
    put_files(folder, {"navfw.toml": "", "behaviors/hover.py": ""})
    monkeypatch.chdir(folder)
    return folder


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
    assert not trust_file().exists()


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


def test_trust_is_remembered_by_real_path(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link = project.with_name("link")
    link.symlink_to(project)
    trust(link)
    require_trust()
    monkeypatch.chdir(link)
    require_trust()
    assert trust_file().read_text() == f"{project}\n"
    moved = project.with_name("moved")
    project.rename(moved)
    monkeypatch.chdir(moved)
    assert is_refused()


@pytest.mark.parametrize(
    ("value", "trusted"),
    [
        ("1", True),
        ("/elsewhere:{}", True),
        ("", False),
        ("yes", False),
        ("{}/behaviors", False),
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
    assert asked == 2 * [ProjectCode(project, (file,))]


def test_many_files_are_counted_and_unprintable_characters_are_not_shown(project: Path) -> None:
    for number in range(MAX_NAMED + 5):
        (project / "behaviors" / f"x{number:02d}.py").touch()
    (project / "behaviors" / "a\x1b[2K\r\u202e.py").touch()
    code = ProjectCode.around()
    assert code is not None
    first, *others, last = code.names()
    assert (first, last) == ("behaviors/a\\x1b[2K\\r\\u202e.py", "and 7 more")
    assert len(others) == MAX_NAMED - 1
