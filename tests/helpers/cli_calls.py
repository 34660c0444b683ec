"""Calls of the command line, in this process or in one of its own, and files for them to read."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from typer.testing import CliRunner, Result

from navfw.cli import app

PROGRAM = "import sys; sys.argv[0] = 'navfw'; from navfw.cli import main; main()"


def invoke(*words: object) -> Result:
    """The result of ``navfw`` with ``words``, called in this process."""
    return CliRunner().invoke(app, [str(word) for word in words])


def navfw(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The result of ``navfw`` with ``words`` in a process of its own."""
    return subprocess.run(  # noqa: S603 - this Python, words of our own
        [sys.executable, "-c", PROGRAM, *words],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def put_files(folder: Path, texts: Mapping[str, str]) -> None:
    """Write the ``texts`` to ``folder``, each to the file that its key names."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
