"""The help of every command shows all that its options say: units, defaults, metavariables."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import typer.main
from typer.testing import CliRunner

from navfw.cli import app


def commands(found: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command and group with the words that call it."""
    yield words, found
    for name, command in getattr(found, "commands", {}).items():
        yield from commands(command, (*words, name))


def squeezed(text: str) -> str:
    """``text`` without white space: lines are broken anywhere."""
    return "".join(text.split())


@pytest.mark.parametrize(
    ("words", "command"),
    [pytest.param(*c, id=" ".join(c[0])) for c in commands(typer.main.get_command(app))],
)
def test_help_is_whole(words: tuple[str, ...], command: Any) -> None:
    done = CliRunner().invoke(app, [*words, "--help"])
    assert done.exit_code == 0
    shown = squeezed(done.stdout)
    texts = [command.help or "", *(getattr(each, "help", None) or "" for each in command.params)]
    assert [text for text in texts if squeezed(text) not in shown] == []
    assert "<bool>" not in done.stdout
