"""Packages of ROS as folders: where they are looked for."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path


def package_roots(path: Path, folders: Iterable[str]) -> Iterator[Path]:
    """The folders that may have packages of ROS in them, for the file at ``path``.

    ``folders``, those of the environment's ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and
    those around the file.
    """
    yield from map(Path, folders)
    yield from map(Path, filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)))
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    yield from (Path(prefix) / "share" for prefix in prefixes)
    yield from path.absolute().parents


def package_folders(name: str, roots: Iterable[Path]) -> Iterator[Path]:
    """The folders that may be the package ``name``: in the roots, or a root of that name itself."""
    for root in roots:
        yield root / name
        if root.name == name:
            yield root
