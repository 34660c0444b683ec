"""The files of a folder, in an order that does not depend on the machine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path


def files_in(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Each file below ``folder`` and its path inside of it, sorted, but for caches of Python."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder)
        if "__pycache__" not in inside.parts and file.is_file():
            yield file, inside
