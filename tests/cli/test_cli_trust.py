"""``navfw trust``, ``--trust`` and the question: no plugin of a project is executed unasked."""

import os
import sys
from pathlib import Path

import pytest
from cli_calls import PROGRAM, commands, invoke, navfw, output, put_files, sole_refusal
from plugins_samples import GOOD
from terminals import Terminal

from navfw.config.project_trust import TRUST_VARIABLE, trust_file, trusted_folders
from navfw.missions import prepare
from navfw.plugins import default_registry

TOUCH = "from pathlib import Path\nPath(__file__).with_name('executed').touch()\n"
PLUGINS = ("list", "plugins", "--kind", "behavior")


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project around the working folder, whose plugin leaves a file when it is imported."""
    monkeypatch.delenv(TRUST_VARIABLE)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = tmp_path / "my robot"
    hover = TOUCH + GOOD.format(cls="Hover", name="hover")
    put_files(folder, {"navfw.toml": "", "behaviors/hover.py": hover})
    monkeypatch.chdir(folder)
    return folder


def executed(project: Path) -> bool:
    """Whether the project's plugin has been imported since the last call."""
    marker = project / "behaviors" / "executed"
    is_marked = marker.exists()
    marker.unlink(missing_ok=True)
    return is_marked


@pytest.mark.parametrize(
    "words",
    [
        PLUGINS,
        ("run", "empty", "straight"),
        ("suite", "rooms", "--seeds", "0:1"),
        ("world", "new", "no-such-family"),
    ],
)
def test_without_trust_nothing_is_executed_or_written(words: list[str], project: Path) -> None:
    said = sole_refusal(*words)
    assert said.startswith(f"navfw: {project}: not trusted, so its code is not executed: ")
    assert "behaviors/hover.py" in said
    assert not executed(project)
    assert sorted(path.name for path in project.iterdir()) == ["behaviors", "navfw.toml"]


def test_the_python_interface_is_refused_as_well(project: Path) -> None:
    for attempt in (default_registry, lambda: prepare("empty", "straight")):
        with pytest.raises(Exception, match="not trusted, so its code is not executed"):
            attempt()
    assert not executed(project)


def test_folders_that_the_caller_names_need_no_trust(project: Path, tmp_path: Path) -> None:
    os.chdir(tmp_path)
    assert "hover" in default_registry([project / "behaviors"]).names("behavior")
    assert executed(project)


@pytest.mark.parametrize("words", [("--trust", *PLUGINS), (*PLUGINS, "--trust")])
def test_the_option_trusts_for_one_command(words: list[str], project: Path) -> None:
    assert "hover" in output(*words)
    assert executed(project)
    assert invoke(*PLUGINS).exit_code == 2
    assert not trust_file().exists()


def test_every_command_has_the_option() -> None:
    without = {
        words
        for words, command in commands()
        if not hasattr(command, "commands")
        and not any("--trust" in parameter.opts for parameter in command.params)
    }
    assert without == {("trust",)}


def test_trust_is_given_listed_and_taken_back(project: Path, tmp_path: Path) -> None:
    assert invoke("trust", "--list").stdout == "No project is trusted.\n"
    os.chdir(tmp_path)
    said = output("trust", "my robot")
    assert said.startswith(f"trusted: {project}\n")
    assert "  behaviors/hover.py\n" in said
    assert not executed(project)
    assert invoke("trust", "--list").stdout == f"{project}\n"
    os.chdir(project)
    output(*PLUGINS)
    assert executed(project)
    assert invoke("trust", "--remove", ".").stdout == f"no longer trusted: {project}\n"
    assert invoke(*PLUGINS).exit_code == 2
    assert not executed(project)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("trust",), "expected DIR"),
        (("trust", ".", "--list"), "expected DIR"),
        (("trust", "--remove", "--list"), "expected DIR"),
        (("trust", "--remove", "."), "unknown trusted folder"),
        (("trust", "nowhere"), "nowhere: expected a folder with navfw.toml"),
        (("trust", "/"), "/: expected a folder with navfw.toml"),
    ],
)
def test_wrong_use_of_trust(words: list[str], message: str, project: Path) -> None:
    assert message in sole_refusal(*words)


def on_terminal(answer: str) -> tuple[int, str]:
    """Exit code and screen of ``navfw list plugins`` with that answer."""
    with Terminal([sys.executable, "-c", PROGRAM, *PLUGINS]) as terminal:
        terminal.press(answer)
        return terminal.ended(), terminal.text()


@pytest.mark.parametrize("answer", ["\n", "\x04"])
def test_any_answer_but_yes_on_a_terminal_is_a_no(answer: str, project: Path) -> None:
    code, shown = on_terminal(answer)
    assert code == 2
    assert f"The project in '{project}' has code" in " ".join(shown.split())
    assert "\n  behaviors/hover.py\n" in shown
    assert shown.count("[y/N]") == 1
    assert "navfw trust" in shown
    assert not executed(project)
    assert not trust_file().exists()


@pytest.mark.thorough
def test_a_yes_on_a_terminal_is_asked_for_once(project: Path) -> None:
    code, shown = on_terminal("y\n")
    assert code == 0, shown
    assert "hover" in shown
    assert executed(project)
    assert trusted_folders() == [str(project)]
    assert invoke(*PLUGINS).exit_code == 0  # without a terminal: it need not ask


def test_help_and_completion_execute_nothing(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(TRUST_VARIABLE, "1")
    for words in (["--help"], ["--version"], [], ["run", "--help"], ["map", "check", "--help"]):
        invoke(*words)
        assert not executed(project), words
    navfw(_NAVFW_COMPLETE="complete_bash", COMP_WORDS="navfw run ", COMP_CWORD="2")
    assert not executed(project)
    assert invoke(*PLUGINS).exit_code == 0
    assert executed(project)  # else this test would prove nothing
