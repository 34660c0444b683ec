"""The run of a mission as plain data: of a result, or stored on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from pydantic import TypeAdapter

from navfw.config.input_file import open_input, read_input_text
from navfw.missions.event_clock import EventRecord
from navfw.missions.outcome import MissionVerdict
from navfw.missions.run_metrics import RunMetrics
from navfw.missions.session import MissionResult
from navfw.recording.run_log import RunLog
from navfw.testing.mission_case import MissionCase

_RUN_FILE, _LOG_FILE = "run.json", "log.npz"
FILES = (_RUN_FILE, _LOG_FILE)
"""The files of a stored run: plain data, and the arrays of the log of its ticks."""

_COLUMNS = ("time", "true", "estimate", "commands", "leader", "emergency", "sight", "confidence")

_MAX_FILE = 64_000_000
"""Largest size of one file of a stored run [byte]: the log of a run of 2 h has 45 MB."""


@dataclass(frozen=True)
class DrivenRun:
    """What a test may ask of a run, as plain data.

    ``stack`` is the name of the stack that drove; ``stack_named`` tells whether the mission names
    one. ``faults`` are those of plugins that the mission's
    events did not inject, ``behaviors`` the names of all behaviours of the stack, ``places`` x, y
    [m] of the map's places by name. ``explanation`` is that of the last command
    (``Stack.explain``).
    """

    world: str
    mission: str
    stack: str
    stack_named: bool
    verdict: MissionVerdict
    metrics: RunMetrics
    faults: tuple[str, ...]
    events: tuple[EventRecord, ...]
    behaviors: tuple[str, ...]
    places: Mapping[str, tuple[float, float]]
    explanation: dict[str, Any]
    log: RunLog

    @classmethod
    def of(cls, result: MissionResult) -> DrivenRun:
        """The data of a result, right after the run."""
        session = result.session
        places = session.mission.topo_map.places.values()
        return cls(
            world=session.world_name,
            mission=session.mission_name,
            stack=session.stack_file.stem,
            stack_named=session.mission.spec.stack is not None,
            verdict=result.run.verdict,
            metrics=result.metrics,
            faults=tuple(result.uninvited_faults),
            events=result.run.events,
            behaviors=tuple(session.stack.mofis.behaviors),
            places={place.name: (place.x, place.y) for place in places},
            explanation=session.stack.explain(),
            log=result.run.log,
        )


def drive(case: MissionCase) -> MissionResult:
    """Drive the mission of ``case``, with a recording of its sensor readings.

    Raises:
        InputError: the mission cannot be driven.
        KeyboardInterrupt: the user has stopped the run.

    """
    result = case.prepare().run(record=True)
    if result.outcome == "cancelled":  # caught by the runner; pytest has to stop as well
        raise KeyboardInterrupt
    return result


def store_run(run: DrivenRun, folder: Path) -> None:
    """Write a run to ``folder``, all numbers with all digits.

    Raises:
        OSError: the disk.

    """
    values = {
        name: _adapter(kind, name).dump_python(
            getattr(owner, name), mode="json", warnings=False, fallback=lambda item: item.tolist()
        )
        for kind, owner in ((DrivenRun, run), (RunLog, run.log))
        for name in _plain_fields(kind)
    }
    (folder / _RUN_FILE).write_text(json.dumps(values), encoding="utf-8")
    np.savez(folder / _LOG_FILE, **{name: getattr(run.log, name) for name in _COLUMNS})


def read_run(folder: Path) -> DrivenRun | None:
    """The run stored in ``folder``; None if there is none, or it is damaged."""
    try:
        values = json.loads(read_input_text(folder / _RUN_FILE, _MAX_FILE))
        with open_input(folder / _LOG_FILE, _MAX_FILE) as stream:
            columns = np.load(stream, allow_pickle=False)
            arrays = {name: columns[name] for name in _COLUMNS}
        log = RunLog(**arrays, **_validated(RunLog, values))
        return DrivenRun(log=log, **_validated(DrivenRun, values))
    except Exception:  # numpy, json and pydantic raise errors of many kinds for damaged files
        return None


def _validated(kind: type, values: Mapping[str, object]) -> dict[str, Any]:
    """Those of ``values`` that are fields of a dataclass."""
    names = _plain_fields(kind)
    return {name: _adapter(kind, name).validate_python(values[name]) for name in names}


@cache
def _plain_fields(kind: type) -> tuple[str, ...]:
    """The fields of a dataclass that are plain data; the others are columns of the log."""
    return tuple(f.name for f in fields(kind) if f.name not in {*_COLUMNS, "log"})


@cache
def _adapter(kind: type, name: str) -> TypeAdapter[Any]:
    return TypeAdapter(get_type_hints(kind)[name])
