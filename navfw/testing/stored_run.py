"""A run of a mission on disk: ``run.json``, and the log of its ticks as one array, ``log.npy``."""

from __future__ import annotations

import json
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from numpy.lib import format as npy
from pydantic import TypeAdapter

from navfw.config.input_file import open_input, read_input_text
from navfw.recording.run_log import RunLog
from navfw.testing.mission_run import DrivenRun

RUN, _LOG = "run.json", "log.npy"
FILES = (RUN, _LOG)
"""The files of a stored run."""

MAX_BYTES = 64_000_000
"""Largest size of one file [byte]: the log of a run of 2 h has 45 MB."""

_COLUMNS = ("time", "true", "estimate", "commands", "leader", "emergency", "sight", "confidence")
_ENDS = (1, 4, 7, 9, 10, 11, 12)
"""The columns of ``log.npy`` are those of the log side by side; here each part's end."""

_WIDTH = 13


def store_run(run: DrivenRun, folder: Path) -> None:
    """Write a run to ``folder``, all numbers with all digits.

    Raises:
        OSError: the disk.

    """
    parts = {name: _dumped(DrivenRun, name, getattr(run, name)) for name in _names(DrivenRun)}
    parts |= {name: _dumped(RunLog, name, getattr(run.log, name)) for name in _names(RunLog)}
    (folder / RUN).write_text(json.dumps(parts), encoding="utf-8")
    columns = [np.asarray(getattr(run.log, name), dtype=np.float64) for name in _COLUMNS]
    np.save(folder / _LOG, np.column_stack(columns), allow_pickle=False)


def read_run(folder: Path) -> DrivenRun | None:
    """The run stored in ``folder``; None if there is none, or it is damaged."""
    try:
        parts = json.loads(read_input_text(folder / RUN, MAX_BYTES))
        with open_input(folder / _LOG, MAX_BYTES) as stream:
            rows = npy.read_array(stream, allow_pickle=False)
        if rows.ndim != 2 or rows.shape[1] != _WIDTH or rows.dtype != np.float64:
            return None
        log = {name: _loaded(RunLog, name, parts[name]) for name in _names(RunLog)}
        columns = dict(zip(_COLUMNS, np.split(rows, _ENDS, axis=1), strict=True))
        log |= {name: columns[name] for name in ("true", "estimate", "commands")}
        log |= {name: columns[name][:, 0] for name in ("time", "confidence")}
        log["leader"] = columns["leader"][:, 0].astype(np.int16)
        log["emergency"] = columns["emergency"][:, 0].astype(np.bool_)
        log["sight"] = columns["sight"][:, 0].astype(np.int8)
        run = {name: _loaded(DrivenRun, name, parts[name]) for name in _names(DrivenRun)}
        return DrivenRun(log=RunLog(**log), **run)
    except Exception:  # numpy, json and pydantic raise errors of many kinds for damaged files
        return None


@cache
def _names(kind: type) -> tuple[str, ...]:
    """The fields of a dataclass that are plain data; the others are columns of the log."""
    return tuple(f.name for f in fields(kind) if f.name not in {*_COLUMNS, "log"})


@cache
def _adapter(kind: type, name: str) -> TypeAdapter[Any]:
    return TypeAdapter(get_type_hints(kind)[name])


def _dumped(kind: type, name: str, value: object) -> object:
    return _adapter(kind, name).dump_python(
        value, mode="json", warnings=False, fallback=lambda found: found.tolist()
    )


def _loaded(kind: type, name: str, data: object) -> Any:
    return _adapter(kind, name).validate_python(data)
