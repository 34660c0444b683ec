"""Git for tests that need a repository."""

from __future__ import annotations

import subprocess
from pathlib import Path


def git(folder: Path, *words: str, check: bool = True) -> str:
    """What git prints when called in ``folder``, as an author of its own."""
    who = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    files = ["-c", "protocol.file.allow=always"]
    done = subprocess.run(  # noqa: S603 - words of our own
        ["git", "-C", str(folder), *who, *files, *words],  # noqa: S607
        capture_output=True,
        text=True,
        check=check,
        timeout=30,
    )
    return done.stdout.strip()
