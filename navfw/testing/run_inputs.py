"""All that goes into the run of a mission, and its hash."""

from __future__ import annotations

import hashlib
import inspect
import json
import sysconfig
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Self

from navfw.config.folder_files import files_in
from navfw.config.input_file import open_input
from navfw.config.lookup import find, find_mission, project_folder, shipped_folder
from navfw.recording.provenance import machine_kind
from navfw.stack import Stack
from navfw.testing.mission_case import MissionCase

MAX_BYTES = 1 << 28
"""Largest size of a file that goes into the hash [byte]."""

_PACKAGE = Path(__file__).parents[1]
_SHIPPED = ("worlds", "maps", "behaviors")
_OF_PROJECT = ("maps", "stacks", "robots", "behaviors", "plugins")
_MISSIONS = "missions"


@dataclass(frozen=True)
class RunInputs:
    """The hash ``key`` of a run's inputs, and the files and folders that it covers."""

    key: str
    covered: tuple[Path, ...]

    @classmethod
    def of(cls, case: MissionCase) -> Self:
        """The inputs of ``case``; those of the project around the working folder.

        Raises:
            InputError: there is no such world or mission, or a file of the project cannot be read.

        """
        world = find("world", case.world).parent.resolve()
        mission = find_mission(case.world, case.mission).resolve()
        project = project_folder()
        parts = [] if project is None else [project.resolve() / name for name in _OF_PROJECT]
        digest = hashlib.sha256(_installed().encode())
        digest.update(json.dumps([str(project), str(world), *map(str, case.inputs)]).encode())
        files = [mission, *_files([world], _MISSIONS), *_files(parts)]
        for file in files:
            _add(digest, file)
        return cls(digest.hexdigest(), (*files, *parts, _PACKAGE, *_shipped()))

    def cover(self, files: Iterable[Path], stack: Stack) -> bool:
        """Whether all ``files`` that a run read, and the code of its plugins, are in the hash."""
        code = (Path(inspect.getfile(plugin)) for plugin in stack.resolved.plugins)
        known = (*self.covered, *(Path(sysconfig.get_path(n)) for n in ("purelib", "platlib")))
        return all(
            any(file.resolve().is_relative_to(part) for part in known) for file in (*files, *code)
        )


def _shipped() -> list[Path]:
    return [shipped_folder().resolve() / name for name in _SHIPPED]


@cache
def _installed() -> str:
    """The hash of navfw's code and files, of all installed versions, and of the machine."""
    digest = hashlib.sha256()
    for file in _files([_PACKAGE, *_shipped()]):
        _add(digest, file)
    versions = {dist.name: dist.version for dist in metadata.distributions()}
    digest.update(json.dumps([versions, machine_kind()], sort_keys=True).encode())
    return digest.hexdigest()


def _files(folders: Iterable[Path], without: str = "") -> Iterator[Path]:
    """The files in ``folders``, but for those in a folder ``without``."""
    for folder in folders:
        yield from (file for file, inside in files_in(folder) if without not in inside.parts)


def _add(digest: hashlib._Hash, file: Path) -> None:
    digest.update(f"{file}\0".encode())
    with open_input(file, MAX_BYTES) as stream:
        digest.update(hashlib.sha256(stream.read()).digest())
