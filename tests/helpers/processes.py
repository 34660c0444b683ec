"""Processes that tests start and wait for, with what they print as text."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

Done = subprocess.CompletedProcess[str]


def run(
    words: Sequence[object],
    *,
    cwd: Path | None = None,
    env: Mapping[str, str | None] | None = None,
    timeout: float = 300.0,
    check: bool = False,
) -> Done:
    """The ended process of a command; ``env`` is set in the environment beside what is there.

    A variable that is None in ``env`` is removed. With ``check`` the process must succeed.
    """
    environment = {**os.environ, **(env or {})}
    done = subprocess.run(  # noqa: S603 - the tests' own words
        [str(word) for word in words],
        cwd=cwd,
        env={name: value for name, value in environment.items() if value is not None},
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert not check or done.returncode == 0, done.stdout + done.stderr
    return done


def python(code: str, *words: object, **options: Any) -> Done:
    """The ended process of this Python with ``code``, which reads ``words``; options as ``run``."""
    return run([sys.executable, "-c", code, *words], **options)


def printed(code: str, *words: object, **options: Any) -> str:
    """What ``code`` prints in a process of its own, without the space around; it must succeed."""
    return python(code, *words, check=True, **options).stdout.strip()


def uv() -> str:
    """The uv that runs these tests, or any other."""
    local = Path(__file__).parents[2] / ".tools" / "uv" / "bin" / "uv"
    found = os.environ.get("UV") or shutil.which("uv")
    if found is None and not local.is_file():
        pytest.skip("needs uv")
    return found or str(local)
