"""Identify the code and the machine that a result was measured with."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from navfw.config.extras import pybullet_version
from navfw.config.input_file import read_input, real_path
from navfw.config.lookup import project_folder, shipped_folder
from navfw.process.process_resources import usable_cores

_SHIPPED = ("worlds", "maps", "behaviors")
"""The folders that ship with navfw beside its code."""

_LIBRARIES = ("navfw", "numpy", "numba", "opencv-python-headless", "scipy", "networkx")
"""Libraries that a result depends on."""

DIRTY = "-dirty"
"""Suffix of a revision whose tracked files have uncommitted changes."""

_GIT_TIMEOUT = 5.0
"""Longest time [s] that git may take."""


def code_revision() -> str:
    """Return the git revision of the project around the working folder, else of navfw's source.

    If git does not know either, navfw's version, as in ``navfw 0.1.0``.
    """
    source = Path(__file__).parents[1] / "__init__.py"
    project = project_folder()
    if project is not None:
        revision = git_revision(project)
    else:
        # an installed copy may lie inside another repository, which does not track it
        tracked = _git(source.parent, "ls-files", "--error-unmatch", "--", source.name)
        revision = git_revision(source.parent) if tracked else None
    return revision or f"navfw {metadata.version('navfw')}"


def git_revision(folder: Path) -> str | None:
    """Return the hash of the commit checked out around ``folder``; None without git or a commit.

    ``-dirty`` is appended when tracked files have uncommitted changes, except those in ``docs`` and
    ``benchmarks/results*``: no run reads them, and results are written there between runs.
    """
    revision = _git(folder, "rev-parse", "--verify", "HEAD")
    words = ("status", "--porcelain", "--untracked-files=no", "--ignore-submodules=dirty")
    excluded = ":(top,exclude)docs", ":(top,exclude)benchmarks/results*"
    changes = _git(folder, *words, "--", ":(top)", *excluded)
    if revision is None or changes is None:
        return None
    return revision + (DIRTY if changes else "")


def machine_kind() -> dict[str, Any]:
    """Return processor model, usable cores, Python version and operating system; no host name."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text(encoding="utf-8").splitlines() if about.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": (models or [platform.processor()])[0] or platform.machine(),
        "cores": usable_cores(),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def library_versions() -> dict[str, str]:
    """Return the versions of Python and of libraries that results depend on, and the processor."""
    versions = {name: metadata.version(name) for name in _LIBRARIES}
    python = {"python": platform.python_version(), "machine": platform.machine()}
    return {**python, **versions, "pybullet": pybullet_version()}


def fingerprint(value: Any) -> str:
    """Return the SHA-256 (hex) of JSON data, which does not depend on the order of keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def files_fingerprint(files: Iterable[tuple[str, Path]]) -> str:
    """Return one fingerprint (hex) of the names and contents of files.

    Raises:
        ConfigError: one of them cannot be read.

    """
    return fingerprint({name: hashlib.sha256(read_input(file)).hexdigest() for name, file in files})


def files_in(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield each file below ``folder`` and its relative path, sorted, without Python's caches."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder)
        if "__pycache__" not in inside.parts and file.is_file():
            yield file, inside


def files_of(places: Mapping[str, Path]) -> Iterator[tuple[str, Path]]:
    """Yield name and path of each file in ``places``, which are files or folders by their names."""
    for name, place in places.items():
        if place.is_file():
            yield name, place
        for file, inside in files_in(place):
            yield f"{name}/{inside.as_posix()}", file


def navfw_files() -> dict[str, Path]:
    """Return the folders, by name, of navfw's code and shipped files that results depend on."""
    shipped = {name: shipped_folder() / name for name in _SHIPPED}
    return {"navfw": real_path(__file__).parents[1], **shipped}


@cache
def code_fingerprint() -> str:
    """Return the fingerprint (hex) of all ``navfw_files``, computed once per process."""
    return files_fingerprint(files_of(navfw_files()))


def _git(folder: Path, *words: str) -> str | None:
    """Return git's output about the repository around ``folder``; None without git, or if it fails.

    No hook and no file system monitor of the repository is executed, and its index stays unchanged.
    """
    git = shutil.which("git")
    if git is None:
        return None
    quiet = ("-c", "core.fsmonitor=false", "-c", f"core.hooksPath={os.devnull}")
    try:
        done = subprocess.run(  # noqa: S603 - fixed words, no shell
            [git, "-C", folder, "--no-optional-locks", *quiet, *words],
            env={key: value for key, value in os.environ.items() if not key.startswith("GIT_")},
            capture_output=True,
            timeout=_GIT_TIMEOUT,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return os.fsdecode(done.stdout).strip()
