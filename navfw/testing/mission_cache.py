"""Runs of missions as plain data, of a result or in pytest's cache.

An entry of the cache belongs to the code of navfw, the versions of all installed packages, the kind
of machine, the files of the project that a run may read (its world, this mission, all maps, stacks,
robots, behaviours and plugins), and the case with its seed. A run that read any other file is not
stored. An entry is JSON and arrays without pickles; one that cannot be read counts as absent.
"""

from __future__ import annotations

import inspect
import os
import re
import shutil
import sysconfig
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cache
from importlib import metadata, util
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from pydantic import ConfigDict, create_model

from navfw.config.input_file import open_input, read_input_text, real_path, traced_inputs
from navfw.config.lookup import find, find_mission, project_folder
from navfw.errors import InputError
from navfw.missions.outcome import MissionVerdict
from navfw.missions.run_result import RunResult
from navfw.missions.session import MissionResult
from navfw.numerics import Array
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
from navfw.recording.run_observers import RunLog, RunLogger
from navfw.testing.mission_case import MissionCase

_RUN_FILE, _LOG_FILE = "run.json", "log.npz"
"""The files of a stored run: plain data, and the arrays of the log of its ticks."""
_FILES = re.compile(r"run\.json|log\.npz")

_EMPTY = RunLogger().log()
_COLUMNS = [f.name for f in fields(_EMPTY) if isinstance(getattr(_EMPTY, f.name), np.ndarray)]
"""What of a log is an array with a row per tick."""


@dataclass(frozen=True, kw_only=True)
class DrivenRun(RunResult):
    """What a test may ask of a run, as plain data: its result, and more.

    ``stack`` is the name of the stack that drove; ``stack_named`` tells whether the mission names
    one. ``faults`` are those of plugins, each with file and line, that the mission's events did not
    inject; a test fails of ``objections`` unless its marker says ``allow_faults=True``.
    ``behaviors`` are the names of all behaviours of the stack, ``places`` x, y [m] of the map's
    places by name. ``explanation`` is that of the last command (``Stack.explain``). ``log`` has one
    row per control tick.
    """

    stack: str
    stack_named: bool
    verdict: MissionVerdict
    behaviors: tuple[str, ...]
    places: Mapping[str, tuple[float, float]]
    explanation: dict[str, Any]
    log: RunLog

    @classmethod
    def of(cls, result: MissionResult) -> DrivenRun:
        """The data of a result, right after the run."""
        session = result.session
        plain = {one.name: getattr(result, one.name) for one in fields(RunResult)}
        places = session.mission.topo_map.places.values()
        return cls(
            **{**plain, "faults": session.uninvited(result.faults)},
            stack=session.stack_file.stem,
            stack_named=session.mission.spec.stack is not None,
            verdict=result.verdict,
            behaviors=tuple(session.stack.mofis.behaviors),
            places={place.name: (place.x, place.y) for place in places},
            explanation=session.stack.explain(),
            log=result.log,
        )

    @property
    def path(self) -> Array:
        """(n, 3) true poses x, y [m], yaw [rad] in the map, one per control tick."""
        return self.log.true

    @property
    def commands(self) -> Array:
        """(n, 3) time [s], v [m/s], w [rad/s], one per control tick."""
        return self.log.command_stream


def drive(case: MissionCase) -> MissionResult:
    """Drive the mission of ``case``; it is recorded where the extra record is installed.

    Raises:
        InputError: the mission cannot be driven.
        KeyboardInterrupt: the user has stopped the run.

    """
    result = case.prepare().run(record=util.find_spec("foxglove") is not None)
    if result.outcome == "cancelled":  # caught by the runner; pytest has to stop as well
        raise KeyboardInterrupt
    return result


_LOG = "log_"
"""Beginning of the names of what the log has beside its columns."""
_FIELDS: Any = {
    f"{start}{name}": (hint, ...)
    for start, kind in (("", DrivenRun), (_LOG, RunLog))
    for name, hint in get_type_hints(kind).items()
    if name not in {*_COLUMNS, "log"}
}
_PLAIN: Any = create_model("Run", __config__=ConfigDict(ser_json_inf_nan="constants"), **_FIELDS)
"""All of a run but the columns of its log."""


def store_run(run: DrivenRun, folder: Path) -> None:
    """Write a run to ``folder``, all numbers with all digits.

    Raises:
        OSError: the disk.

    """
    of_log = {f.name: getattr(run.log, f.name) for f in fields(run.log)}
    logged = {f"{_LOG}{name}": value for name, value in of_log.items()}
    plain = _PLAIN.model_construct(**logged, **vars(run))
    text = plain.model_dump_json(warnings=False, fallback=lambda item: item.tolist())
    (folder / _RUN_FILE).write_text(text, encoding="utf-8")
    np.savez(folder / _LOG_FILE, **{name: of_log[name] for name in _COLUMNS})


def read_run(folder: Path) -> DrivenRun | None:
    """The run stored in ``folder``; None if there is none, or it is damaged."""
    try:
        values = vars(_PLAIN.model_validate_json(read_input_text(folder / _RUN_FILE)))
        with open_input(folder / _LOG_FILE) as stream:
            columns = np.load(stream, allow_pickle=False)
            of_log = {name: columns[name] for name in _COLUMNS}
        logged = {name: values.pop(name) for name in list(values) if name.startswith(_LOG)}
        of_log |= {name.removeprefix(_LOG): value for name, value in logged.items()}
        return DrivenRun(log=RunLog(**of_log), **values)
    except Exception:  # numpy and pydantic raise errors of many kinds for damaged files
        return None


WAIT = 900.0
"""Longest wall time [s] to wait for another process that drives the same mission."""

MAX_ENTRIES = 2000
"""Largest number of runs in the cache; the oldest are removed."""

_OF_PROJECT = ("maps", "stacks", "robots", "behaviors", "plugins")
"""Folders of a project whose files any run may read."""


def _inputs(case: MissionCase) -> tuple[str, list[Path]]:
    """The hash of the inputs of ``case``, and the files and folders that it covers.

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
    """The hash of navfw's code and files, of all installed versions, and of the machine."""
    versions = {dist.name: dist.version for dist in metadata.distributions()}
    return fingerprint([code_fingerprint(), versions, machine_kind()])


class MissionCache:
    """The runs of this session, and those in ``folder``, if there is one.

    ``fresh`` drives all missions, whether they are in the folder or not. Of the folder's runs the
    oldest beyond MAX_ENTRIES are removed first.
    """

    def __init__(self, folder: Path | None, fresh: bool = False) -> None:
        self.folder = folder
        self.fresh = fresh
        self.runs: dict[tuple[object, ...], DrivenRun] = {}
        self._last: tuple[tuple[object, ...], MissionResult | None] = ((), None)
        with suppress(OSError):
            folders = folder.iterdir() if folder else ()
            entries = [entry for entry in folders if entry.is_dir()]
            by_age = sorted(entries, key=lambda entry: entry.stat().st_mtime, reverse=True)
            for entry in by_age[MAX_ENTRIES:]:
                shutil.rmtree(entry, ignore_errors=True)

    def run(self, case: MissionCase) -> tuple[DrivenRun, MissionResult | None, bool]:
        """The run of ``case``: of this session, of the folder, or driven and stored.

        Also its result if it is the last one driven, as a recording may be large, and whether it
        comes from the folder. Of several processes that need the same run, one drives it, and the
        others wait for it.

        Raises:
            InputError: the mission cannot be driven.

        """
        key, stored = case.inputs, False
        if key not in self.runs:
            self.runs[key], result = self._stored_or_driven(case)
            stored = result is None
            if not stored:
                self._last = key, result
        return self.runs[key], self._last[1] if self._last[0] == key else None, stored

    def _stored_or_driven(self, case: MissionCase) -> tuple[DrivenRun, MissionResult | None]:
        """The run of ``case``, and its result if it was driven now."""
        if self.folder is None:
            result = drive(case)
            return DrivenRun.of(result), result
        key, covered = _inputs(case)
        entry, claim = self.folder / key, TargetLock(self.folder / f"{key}.claim")
        with suppress(InputError, OSError):
            claim.acquire(WAIT)
        try:
            if not self.fresh and (stored := read_run(entry)) is not None:
                with suppress(OSError):
                    os.utime(entry)
                return stored, None
            with traced_inputs() as files:
                result = drive(case)
            run, plugins = DrivenRun.of(result), result.session.stack.resolved.plugins
            code = [Path(inspect.getfile(plugin)) for plugin in plugins]
            # what pyproject.toml says is the folder of the project, which is in the hash
            read = [f for f in (*files, *code) if f.name != "pyproject.toml"]
            if all(any(real_path(f).is_relative_to(place) for place in covered) for f in read):
                with (
                    suppress(InputError, OSError),  # what is not stored costs no test
                    AtomicFolder(entry, _FILES, "cache_dir") as target,
                ):
                    store_run(run, target.path)
            return run, result
        finally:
            claim.release()
