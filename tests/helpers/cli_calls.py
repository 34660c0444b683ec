"""Calls of the command line, in this process or in one of its own, and files for them to read."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from processes import Done, python
from typer.main import get_command
from typer.testing import CliRunner, Result

from navfw.cli import app

PROGRAM = "import sys; sys.argv[0] = 'navfw'; from navfw.cli import main; main()"


def invoke(*words: object) -> Result:
    """The result of ``navfw`` with ``words``, called in this process."""
    return CliRunner().invoke(app, [str(word) for word in words])


def answer(*words: object) -> Any:
    """What ``navfw`` answers to ``words`` with ``--json``."""
    result = invoke(*words, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def refusal(*words: object) -> str:
    """What ``navfw`` says when it refuses ``words``."""
    result = invoke(*words)
    assert result.exit_code == 2, result.output
    return result.stderr


def output(*words: object) -> str:
    """What ``navfw`` prints with ``words``, which must succeed."""
    result = invoke(*words)
    assert result.exit_code == 0, result.output
    return result.stdout


def sole_refusal(*words: object) -> str:
    """The ``refusal`` of ``words`` that print nothing on stdout, and no traceback."""
    result = invoke(*words)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert "Traceback" not in result.stderr
    return result.stderr


def commands(group: Any = None, words: tuple[str, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every command and group, after the words that call it."""
    group = group or get_command(app)
    yield words, group
    if hasattr(group, "commands"):
        for name in group.list_commands(None):
            yield from commands(group.get_command(None, name), (*words, name))


def navfw(*words: str, **environment: str) -> Done:
    """The result of ``navfw`` with ``words`` in a process of its own."""
    return python(PROGRAM, *words, env=environment)


def put_file(folder: Path, name: str, content: str | bytes) -> Path:
    """Write ``content`` to the file ``name`` below ``folder``, and its folders; the file."""
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return file


def put_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write the ``texts`` to ``folder``, each to the file that its key names."""
    for name, text in texts.items():
        put_file(folder, name, text)
