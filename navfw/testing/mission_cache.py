"""Keeps runs of missions in pytest's cache.

The key of an entry is a hash of the code of navfw, the versions of all installed packages, the kind
of machine, the files of the project that a run may read (its world, this mission, all maps, stacks,
robots, behaviours and plugins), and the case with its seed. A run that read any other file is not
stored. An entry is a JSON file; if it cannot be read, it counts as absent.
"""

from __future__ import annotations

import inspect
import os
import sysconfig
from contextlib import suppress
from dataclasses import fields, replace
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from pydantic import create_model
from pydantic_core import to_json

from navfw.config.input_file import read_input_text, real_path, traced_inputs
from navfw.config.lookup import find, find_mission, project_folder
from navfw.errors import InputError
from navfw.process.atomic import atomic_file
from navfw.process.target_lock import TargetLock
from navfw.recording.provenance import (
    code_fingerprint,
    files_fingerprint,
    files_in,
    fingerprint,
    machine_kind,
    navfw_files,
)
from navfw.recording.run_observers import RunLog, RunLogger
from navfw.testing.mission_case import MissionCase
from navfw.testing.mission_run import MissionRun, drive

_EMPTY = RunLogger().log()
_COLUMNS = {f.name: getattr(_EMPTY, f.name) for f in fields(_EMPTY)}
_COLUMNS = {name: empty for name, empty in _COLUMNS.items() if isinstance(empty, np.ndarray)}
"""The fields of a log that are arrays with a row per tick, each without rows."""
_OF_LOG: dict[str, Any] = get_type_hints(RunLog) | dict.fromkeys(_COLUMNS, list)
_OF_RUN: dict[str, Any] = {
    name: hint
    for name, hint in get_type_hints(MissionRun).items()
    if name not in {"case", "folder", "cached", "driven"}
}
_STORED: Any = create_model("Run", **_OF_RUN | {"log": create_model("Log", **_OF_LOG)})
"""The schema of a stored run."""


def store_run(run: MissionRun, file: Path) -> None:
    """Write a run to ``file`` as JSON, all numbers with all digits.

    Raises:
        OSError: the file cannot be written.

    """
    plain = {name: getattr(run, name) for name in _STORED.model_fields}
    file.write_bytes(to_json(plain, inf_nan_mode="constants", fallback=lambda item: item.tolist()))


def read_run(file: Path, case: MissionCase, folder: Path) -> MissionRun | None:
    """Read the run of ``case`` from ``file``; None if there is none, or it is damaged."""
    try:
        values = vars(_STORED.model_validate_json(read_input_text(file)))
        log = vars(values.pop("log"))
        for name, empty in _COLUMNS.items():
            log[name] = np.array(log[name], empty.dtype).reshape(-1, *empty.shape[1:])
        return MissionRun(**values, log=RunLog(**log), case=case, folder=folder, cached=True)
    except Exception:  # numpy and pydantic raise errors of many kinds for damaged files
        return None


WAIT = 900.0
"""Longest wall time [s] to wait for another process that drives the same mission."""

MAX_ENTRIES = 2000
"""Largest number of runs in the cache; the oldest are removed."""

_OF_PROJECT = ("maps", "stacks", "robots", "behaviors", "plugins")
"""Folders of a project whose files any run may read."""


def _inputs(case: MissionCase) -> tuple[str, list[Path]]:
    """Return the hash of the inputs of ``case``, and the files and folders that it covers.

    Raises:
        InputError: there is no such world or mission, or a file of the project cannot be read.

    """
    world = real_path(find("world", case.world).parent)
    mission = real_path(find_mission(case.world, case.mission))
    project = project_folder()
    folders = [] if project is None else [real_path(project) / name for name in _OF_PROJECT]
    of_world = [file for file, inside in files_in(world) if "missions" not in inside.parts]
    of_project = [file for folder in folders for file, _ in files_in(folder)]
    files = [mission, *of_world, *of_project]
    content = files_fingerprint((str(file), file) for file in files)
    key = fingerprint([*map(str, (project, world, *case.inputs)), _installed(), content])
    installed = (Path(sysconfig.get_path(name)) for name in ("purelib", "platlib"))
    return key, [*files, *folders, *navfw_files().values(), *installed]


@cache
def _installed() -> str:
    """Return the hash of navfw's code and files, of all installed versions, and of the machine."""
    versions = {dist.name: dist.version for dist in metadata.distributions()}
    return fingerprint([code_fingerprint(), versions, machine_kind()])


class MissionCache:
    """The runs driven in this pytest session, and those stored in ``folder`` (None: no cache).

    With ``fresh``, all missions are driven, even if the folder has them. When it is made, it
    removes the oldest files in the folder beyond MAX_ENTRIES.
    """

    def __init__(self, folder: Path | None, fresh: bool = False) -> None:
        self.folder = folder
        self.fresh = fresh
        self.runs: dict[tuple[object, ...], MissionRun] = {}
        with suppress(OSError):
            entries = folder.glob("*.json") if folder else ()
            by_age = sorted(entries, key=lambda entry: entry.stat().st_mtime, reverse=True)
            for entry in by_age[MAX_ENTRIES:]:
                entry.unlink()

    def run(self, case: MissionCase, folder: Path) -> MissionRun:
        """Return the run of ``case``: from this session, from the folder, or driven and stored.

        If several processes need the same run, one drives it, and the others wait for it.
        ``folder`` is where the test may save the run folder.

        Raises:
            InputError: the mission cannot be driven.

        """
        if case.inputs not in self.runs:
            self.runs[case.inputs] = self._stored_or_driven(case, folder)
        return replace(self.runs[case.inputs], case=case, folder=folder)

    def _stored_or_driven(self, case: MissionCase, folder: Path) -> MissionRun:
        if self.folder is None:
            return MissionRun.of(drive(case), case, folder)
        key, covered = _inputs(case)
        entry, claim = self.folder / f"{key}.json", TargetLock(self.folder / f"{key}.claim")
        with suppress(InputError, OSError):
            claim.acquire(WAIT)
        try:
            if not self.fresh and (stored := read_run(entry, case, folder)) is not None:
                with suppress(OSError):
                    os.utime(entry)
                return stored
            with traced_inputs() as files:
                result = drive(case)
            run, plugins = (
                MissionRun.of(result, case, folder),
                result.session.stack.resolved.plugins,
            )
            code = [Path(inspect.getfile(plugin)) for plugin in plugins]
            # what pyproject.toml says is the folder of the project, which is in the hash
            read = [f for f in (*files, *code) if f.name != "pyproject.toml"]
            if all(any(real_path(f).is_relative_to(place) for place in covered) for f in read):
                with suppress(InputError, OSError), atomic_file(entry) as unfinished:
                    store_run(run, unfinished)  # what is not stored costs no test
            return run
        finally:
            claim.release()
