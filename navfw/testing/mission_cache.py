"""Runs of missions in pytest's cache, by the hash of all that goes into a run.

An entry belongs to the code of navfw, the versions of all installed packages, the kind of machine,
the files of the project that a run may read (its world, this mission, all maps, stacks, robots,
behaviours and plugins), and the case with its seed. A run that read any other file is not stored.
An entry is JSON and arrays without pickles; one that cannot be read counts as absent.
"""

from __future__ import annotations

import inspect
import os
import re
import shutil
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Self

from navfw.config.input_file import traced_inputs
from navfw.config.lookup import find, find_mission, project_folder
from navfw.errors import InputError
from navfw.missions.session import MissionResult
from navfw.process.atomic import AtomicFolder
from navfw.process.target_lock import TargetLock
from navfw.recording.provenance import (
    code_fingerprint,
    files_fingerprint,
    files_in,
    fingerprint,
    machine_kind,
    navfw_files,
)
from navfw.recording.run_folder import RESULT, RunFolder
from navfw.stack import Stack
from navfw.testing.driven_run import FILES, DrivenRun, drive, read_run, store_run
from navfw.testing.mission_case import MissionCase

WAIT = 900.0
"""Longest wall time [s] to wait for another process that drives the same mission."""

_MAX_ENTRIES, MAX_BYTES = 2000, 2_000_000_000
"""Bounds of the cache: number of runs, size of all files [byte]; the oldest are removed."""

_RUN = ".run"
"""Ending of the folder with the run folder of an entry."""


_OF_PROJECT = ("maps", "stacks", "robots", "behaviors", "plugins")
"""Folders of a project whose files any run may read."""


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
        folders = [] if project is None else [project.resolve() / name for name in _OF_PROJECT]
        of_world = [file for file, inside in files_in(world) if "missions" not in inside.parts]
        of_project = [file for folder in folders for file, _ in files_in(folder)]
        files = (mission, *of_world, *of_project)
        key = fingerprint(
            [
                *map(str, (project, world, *case.inputs)),
                _installed(),
                files_fingerprint((str(file), file) for file in files),
            ]
        )
        return cls(key, (*files, *folders, *navfw_files().values()))

    def cover(self, files: Iterable[Path], stack: Stack) -> bool:
        """Whether all ``files`` that a run read, and the code of its plugins, are in the hash."""
        code = (Path(inspect.getfile(plugin)) for plugin in stack.resolved.plugins)
        installed = (Path(sysconfig.get_path(name)) for name in ("purelib", "platlib"))
        covered = (*self.covered, *installed)
        return all(
            any(file.resolve().is_relative_to(place) for place in covered)
            for file in (*files, *code)
        )


@cache
def _installed() -> str:
    """The hash of navfw's code and files, of all installed versions, and of the machine."""
    versions = {dist.name: dist.version for dist in metadata.distributions()}
    return fingerprint([code_fingerprint(), versions, machine_kind()])


class MissionCache:
    """The runs in ``folder``; ``fresh`` drives all missions, whether they are there or not."""

    def __init__(self, folder: Path, fresh: bool = False) -> None:
        self.folder = folder
        self.fresh = fresh
        self._driven: set[str] = set()

    def run(self, case: MissionCase) -> tuple[DrivenRun, MissionResult | None]:
        """The run of ``case``: of the cache, or driven and stored; its result if it was driven.

        Of several processes that need the same run, one drives it, and the others wait for it.

        Raises:
            InputError: the mission cannot be driven.

        """
        inputs = RunInputs.of(case)
        with self._claimed(inputs.key):
            stored = None
            if not self.fresh or inputs.key in self._driven:
                stored = read_run(self.folder / inputs.key)
            if stored is not None:
                with suppress(OSError):
                    os.utime(self.folder / inputs.key)
                return stored, None
            with traced_inputs() as files:
                result = drive(case)
            run = DrivenRun.of(result)
            self._driven.add(inputs.key)
            if inputs.cover(files, result.session.stack):
                self._store(inputs.key, run)
            return run, result

    def run_folder(self, case: MissionCase) -> Path | None:
        """The run folder stored with the run of ``case``; None if there is none."""
        folder = self.folder / f"{RunInputs.of(case).key}{_RUN}"
        return folder if (folder / RESULT).is_file() else None

    def keep_run_folder(self, case: MissionCase, folder: Path) -> None:
        """Store a copy of a run folder with the run of ``case``; best effort."""
        key = RunInputs.of(case).key
        if (self.folder / key).is_dir():
            with (
                suppress(InputError, OSError),
                RunFolder(self.folder / f"{key}{_RUN}") as target,
            ):
                shutil.copytree(folder, target.path, dirs_exist_ok=True)

    def prune(self) -> None:
        """Remove the oldest entries beyond the bounds of the cache."""
        with suppress(OSError):
            entries = [entry for entry in self.folder.iterdir() if entry.is_dir()]
            by_age = sorted(entries, key=lambda entry: entry.stat().st_mtime, reverse=True)
            total = 0
            for number, entry in enumerate(by_age):
                total += sum(file.stat().st_size for file in entry.rglob("*") if file.is_file())
                if number >= _MAX_ENTRIES or total > MAX_BYTES:
                    shutil.rmtree(entry, ignore_errors=True)

    def _store(self, key: str, run: DrivenRun) -> None:
        """Store a run; a cache that cannot be written costs no test."""
        pattern = re.compile("|".join(re.escape(name) for name in FILES))
        with (
            suppress(InputError, OSError),
            AtomicFolder(self.folder / key, pattern, "cache_dir") as target,
        ):
            store_run(run, target.path)

    @contextmanager
    def _claimed(self, key: str) -> Iterator[None]:
        """Hold the claim to drive the run of ``key``, after waiting for another holder."""
        claim = TargetLock(self.folder / f"{key}.claim")
        with suppress(InputError, OSError):
            claim.acquire(WAIT)
        try:
            yield
        finally:
            claim.release()
