"""What a result was measured with: revision and fingerprint of the code, kind of machine."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from navfw.config.folder_files import files_of
from navfw.config.input_file import read_input
from navfw.config.lookup import project_folder, shipped_folder
from navfw.recording.git_checkout import GitCheckout

_SHIPPED = ("worlds", "maps", "behaviors")
"""The folders that ship with navfw beside its code."""

_MAX_FILE = 1 << 28
"""Largest size of a file that has a fingerprint [byte]."""

DIRTY = "-dirty"
"""Suffix of a revision whose tracked files have uncommitted changes."""


def code_revision() -> str:
    """The git revision of the project around the working folder, else of navfw's own source.

    Without git, navfw's version, as in ``navfw 0.1.0``.
    """
    source = Path(__file__).parents[1] / "__init__.py"
    project = project_folder()
    if project is not None:
        found = git_revision(project)
    else:
        # an installed copy may lie inside another repository, which does not track it
        checkout = GitCheckout.around(source.parent)
        tracked = checkout is not None and checkout.tracks(source)
        found = git_revision(source.parent) if tracked else None
    return found or f"navfw {_version()}"


def git_revision(folder: Path) -> str | None:
    """The commit checked out around ``folder``; None without git, or if another user owns a part.

    ``-dirty`` is appended when tracked files have uncommitted changes, except those in ``docs`` at
    the top of the repository: no run reads them, and results are written there between runs.
    """
    checkout = GitCheckout.around(folder)
    if checkout is None:
        return None
    revision, changed = checkout.head(), checkout.changed(":(top)", ":(top,exclude)docs")
    if revision is None or changed is None:
        return None
    return revision + (DIRTY if changed else "")


def provenance(command: str, options: Mapping[str, object]) -> dict[str, Any]:
    """Command line with ``options`` spelt out, seed, revision and kind of machine; plain data.

    >>> provenance("navfw bench loop", {"world": "office", "seed": 0})["command"]
    'navfw bench loop --world office --seed 0'
    """
    words = (word for name, value in options.items() for word in (f"--{name}", str(value)))
    return {
        "command": f"{command} {shlex.join(words)}".rstrip(),
        "seeds": str(options.get("seed", "")),
        "revision": code_revision(),
        "machine": machine_kind(),
    }


def machine_kind() -> dict[str, Any]:
    """Processor model, usable cores, Python version and operating system; no host name."""
    return {
        "processor": _processor(),
        "cores": usable_cores(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def usable_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def fingerprint(value: Any) -> str:
    """The SHA-256 (hex) of plain data."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def files_fingerprint(files: Iterable[tuple[str, Path]]) -> str:
    """The fingerprint of files by name, each up to ``_MAX_FILE``.

    Raises:
        ConfigError: one of them cannot be read.

    """
    return fingerprint(
        {name: hashlib.sha256(read_input(file, _MAX_FILE)).hexdigest() for name, file in files}
    )


def navfw_files() -> dict[str, Path]:
    """The folders of navfw's own code and files that results depend on, by name."""
    shipped = {name: shipped_folder().resolve() / name for name in _SHIPPED}
    return {"navfw": Path(__file__).resolve().parents[1], **shipped}


@cache
def code_fingerprint() -> str:
    """The fingerprint of ``navfw_files``."""
    return files_fingerprint(files_of(navfw_files()))


def _processor() -> str:
    """The model name that the operating system reports; else the architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return (models or [platform.processor()])[0] or platform.machine()


def _version() -> str:
    from importlib import metadata

    return metadata.version("navfw")
