"""Help, completion and standard output of every command, and the libraries that it imports."""

import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from cli_calls import commands, invoke, navfw, output, put_file, refusal
from processes import Done, printed, run

from navfw.cli import PANELS
from navfw.cli.installed_commands import installed_commands
from navfw.config import list_files


def squeezed(text: str) -> str:
    """``text`` without white space: lines are broken anywhere."""
    return "".join(text.split())


@pytest.mark.parametrize(
    ("words", "command"), [pytest.param(*c, id=" ".join(c[0])) for c in commands()]
)
def test_help_is_whole(words: tuple[str, ...], command: Any) -> None:
    shown = squeezed(output(*words, "--help"))
    texts = [getattr(part, "help", None) or "" for part in (command, *command.params)]
    assert [text for text in texts if squeezed(text) not in shown] == []
    assert "<bool>" not in shown


def test_every_command_is_in_one_panel() -> None:
    listed = [command for panel in PANELS.values() for command in panel] + list(
        installed_commands()
    )
    assert sorted(listed) == sorted(words[0] for words, _ in commands() if len(words) == 1)
    assert len(listed) <= 22
    shown = invoke("--help").stdout
    assert [command for command in listed if f"\n  {command} " not in shown] == []


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rnu"], "'run'"),
        (["worlds"], "'list worlds'"),
        (["pulgins"], "'list plugins'"),
        (["missions", "office"], "'list missions'"),
        (["generate", "rooms"], "'world new'"),
        (["import", "a.sdf"], "'world import'"),
        (["plan", "office"], "'map plan'"),
        (["compare", "a", "b"], "'report'"),
        (["learn", "situations"], "'map learn-landmarks', 'map learn-situations'"),
        (["map", "learn"], "'learn-landmarks', 'learn-situations'"),
        (["list", "wrlds"], "'worlds'"),
    ],
)
def test_an_unknown_command_is_answered_by_the_nearest(words: list[str], meant: str) -> None:
    unknown = next(word for word in words if word not in {"list", "map"})
    message = f"No such command {unknown!r}. Did you mean {meant}?"
    assert message in " ".join(refusal(*words).split())


def test_nothing_is_proposed_for_a_word_that_no_command_has() -> None:
    assert invoke("xyzzy").stderr.endswith("Error: No such command 'xyzzy'.\n")


LARGE = {"cv2", "matplotlib", "networkx", "numba", "numpy", "pybullet", "scipy", "skfuzzy"}
MODELS = {"pydantic", "yaml"}

COMMAND = """
import contextlib, io, json, sys
from navfw.cli import app
with contextlib.redirect_stdout(io.StringIO()) as shown:
    try:
        app(sys.argv[1].split())
    except SystemExit as end:
        assert not end.code, shown.getvalue()
assert shown.getvalue()
print(json.dumps(sorted(sys.modules)))
"""


def imported_by(command: str) -> set[str]:
    """The modules that a process has imported after ``command``."""
    return set(json.loads(printed(COMMAND, command).splitlines()[-1]))


@pytest.mark.parametrize(
    ("command", "libraries"),
    [
        ("--version", LARGE | MODELS),
        ("--help", LARGE | MODELS),
        ("run --help", LARGE),
        ("list plugins", LARGE),
        ("list worlds", LARGE),
        ("list missions office", LARGE),
        ("list maps", LARGE),
        ("list stacks --json", LARGE),
        ("list robots", LARGE - {"numpy", "networkx"}),  # which checks the trees of URDFs
        ("list plugins --json", {"pybullet", "skfuzzy", "matplotlib"}),
    ],
)
def test_a_command_imports_none_of_the_libraries(command: str, libraries: set[str]) -> None:
    assert imported_by(command) & libraries == set()


# --- completion in bash --------------------------------------------------------------------------


def completed(line: str) -> list[str]:
    """The completions of the last word of ``line``, as navfw gives them to bash."""
    last = str(len(line.split(" ")) - 1)
    done = navfw(_NAVFW_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=last)
    assert done.stderr == ""
    return done.stdout.split()


LINES = {
    "navfw run of": ["office"],
    "navfw run office lobby": ["lobby-to-lab"],
    "navfw run nowhere lo": [],
    "navfw run office patrol --stack land": ["landmarks"],
    "navfw run office patrol --robot hus": ["husky"],
    "navfw run office patrol --set avo": ["avoid.", "avoid_quadrants."],
    "navfw suite bod": ["bodies"],
    "navfw map show pap": ["paper-room"],
    "navfw run ": [file.name for file in list_files("world")],
    "navfw run office patrol --stack ": [file.name for file in list_files("stack")],
    "navfw suite rooms --robot ": [file.name for file in list_files("robot")],
}


@pytest.mark.parametrize("line", LINES)
def test_names_are_completed(line: str) -> None:
    assert completed(line) == LINES[line]


def test_bash_completes_by_the_installed_script(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    text = f"#!{sys.executable}\nfrom navfw.cli import main\nmain()\n"
    put_file(tmp_path, "navfw", text).chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    script = """
    navfw --show-completion bash > script && source script
    COMP_WORDS=(navfw run office lobby) COMP_CWORD=3
    $(complete -p navfw | sed 's/.*-F \\([^ ]*\\).*/\\1/') navfw lobby office
    printf '%s\\n' "${COMPREPLY[@]}"
    """
    environment = {"HOME": str(tmp_path), "PATH": path, "_NAVFW_COMPLETE": None}
    done = run([bash, "-ec", script], env=environment, cwd=tmp_path)
    assert done.stdout.split() == ["lobby-to-lab"], done.stderr


# --- standard output that is full, closed, or read by nobody -------------------------------------


NAVFW = [sys.executable, "-m", "navfw", "--version"]

full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")


def shell(redirection: str) -> Done:
    return run(["/bin/sh", "-c", f'"$@" {redirection}', "sh", *NAVFW])


@full
def test_a_full_device_is_told() -> None:
    done = shell("> /dev/full")
    assert done.returncode == 1
    assert done.stderr == "navfw: cannot write the output: No space left on device\n"


@full
def test_a_full_device_for_both_streams_ends_with_1() -> None:
    assert shell("> /dev/full 2> /dev/full").returncode == 1


def test_a_reader_that_has_seen_enough_gets_no_message() -> None:
    assert shell("| head -c 0").stderr == ""


def test_closed_streams_are_no_error() -> None:
    done = shell(">&-")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert shell(">&- 2>&-").returncode == 0
