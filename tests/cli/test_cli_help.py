"""Help of every command, proposals for unknown ones, and the libraries that commands import."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
import typer.main
from cli_calls import invoke
from processes import printed

from navfw.cli import PANELS, app


def commands(group: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command and group with the words that call it."""
    yield words, group
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*words, name))


def squeezed(text: str) -> str:
    """``text`` without white space: lines are broken anywhere."""
    return "".join(text.split())


@pytest.mark.parametrize(
    ("words", "command"),
    [pytest.param(*c, id=" ".join(c[0])) for c in commands(typer.main.get_command(app))],
)
def test_help_is_whole(words: tuple[str, ...], command: Any) -> None:
    done = invoke(*words, "--help")
    assert done.exit_code == 0
    shown = squeezed(done.stdout)
    texts = [
        command.help or "",
        *(getattr(option, "help", None) or "" for option in command.params),
    ]
    assert [text for text in texts if squeezed(text) not in shown] == []
    assert "<bool>" not in done.stdout


def test_every_command_is_in_one_panel() -> None:
    listed = [command for panel in PANELS.values() for command in panel]
    assert sorted(listed) == sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
    assert len(listed) <= 18
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
    done = invoke(*words)
    assert done.exit_code == 2
    unknown = next(word for word in words if word not in {"list", "map"})
    message = f"No such command {unknown!r}. Did you mean {meant}?"
    assert message in " ".join(done.stderr.split())


def test_nothing_is_proposed_for_a_word_that_no_command_has() -> None:
    assert invoke("xyzzy").stderr.endswith("Error: No such command 'xyzzy'.\n")


LARGE = {"cv2", "matplotlib", "networkx", "numba", "numpy", "pybullet", "scipy", "skfuzzy"}
MODELS = {"pydantic", "ruamel"}

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
        ("list robots", LARGE - {"numpy"}),
        ("list plugins --json", {"pybullet", "skfuzzy", "matplotlib"}),
    ],
)
def test_a_command_imports_none_of_the_libraries(command: str, libraries: set[str]) -> None:
    assert imported_by(command) & libraries == set()
