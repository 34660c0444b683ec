"""The files of a folder, in an order that does not depend on the machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path


def files_in(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Each file below ``folder`` and its path inside of it, sorted, but for caches of Python."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder)
        if "__pycache__" not in inside.parts and file.is_file():
            yield file, inside


def files_of(places: Mapping[str, Path]) -> Iterator[tuple[str, Path]]:
    """The name and the path of each file in ``places``, files and folders by their names."""
    for name, place in places.items():
        if place.is_file():
            yield name, place
        for file, inside in files_in(place):
            yield f"{name}/{inside.as_posix()}", file
