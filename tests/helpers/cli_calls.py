"""Calls of the command line, in this process or in one of its own, and files for them to read."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from processes import Done, python
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


def navfw(*words: str, **environment: str) -> Done:
    """The result of ``navfw`` with ``words`` in a process of its own."""
    return python(PROGRAM, *words, env=environment)


def put_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write the ``texts`` to ``folder``, each to the file that its key names."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
