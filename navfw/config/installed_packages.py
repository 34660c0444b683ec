"""What other installed packages add to navfw by their entry points.

A package names its commands in the group ``navfw.commands``, its plugins in ``navfw.behaviors``,
``navfw.flows`` and so on, and, in ``navfw.files``, a package whose folder has stacks, suites, maps
and worlds in the same places as a project. They are imported only when used.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, EntryPoints, distributions
from importlib.util import find_spec
from pathlib import Path


@lru_cache(maxsize=1)
def all_points() -> EntryPoints:
    """Return the entry points of navfw's groups in all installed packages; cached."""
    # entry_points() parses those of all packages, which takes a tenth of the start of a command
    files = (file for path in sys.path for file in Path(path).glob("*.dist-info/entry_points.txt"))
    named = {file.parent for file in files if "[navfw." in file.read_text(encoding="utf-8")}
    return EntryPoints(point for at in sorted(named) for point in Distribution.at(at).entry_points)


def points_of(group: str) -> EntryPoints:
    """Return the entry points of a group."""
    return all_points().select(group=group)


def package_of(point: EntryPoint) -> str:
    """Return name and version of the package that has the entry point; "" if unknown."""
    return "" if point.dist is None else f"{point.dist.name} {point.dist.version}"


def source_of(point: EntryPoint) -> str:
    """Return the origin of a plugin as listings show it."""
    package = package_of(point)
    return f"entry point {point.group}" + (package and f" of {package}")


def is_installed(package: str) -> bool:
    """Whether the package of that name, as in ``pip install NAME``, is installed."""
    return next(iter(distributions(name=package)), None) is not None


def file_of(module: str) -> Path | None:
    """Return the source file of a module, found without importing it; None if there is none."""
    try:
        spec = find_spec(module)
    except Exception:
        return None
    return None if spec is None or not spec.origin else Path(spec.origin)


def file_folders() -> Iterator[Path]:
    """Yield the folders of data files that installed packages name in ``navfw.files``."""
    for point in points_of("navfw.files"):
        file = file_of(point.module)
        if file is not None:
            yield file.parent
