"""One run in a worker process: from a case to a row of the table, even after an exception."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

from navfw.errors import InputError, SimulationError
from navfw.missions.outcome import Outcome
from navfw.missions.session import MissionResult
from navfw.plugins import Registry, default_registry
from navfw.process.atomic import atomic_file
from navfw.process.process_resources import peak_memory_mb, return_freed_memory
from navfw.recording.run_folder import RunFolder
from navfw.suite.case import RECORDINGS, Job, KeptRuns
from navfw.suite.failure_causes import Cause
from navfw.suite.run_row import RunRow
from navfw.suite.worker_pool import stop_requested


def run_job(job: Job) -> RunRow:
    """Run ``job`` and return its row; an exception gives a row with the outcome fault.

    Raises:
        SimulationError: the simulator cannot be started, or its temporary files not be written.

    """
    case, began = job.case, time.process_time()
    return_freed_memory()  # of the run before
    try:
        session = case.session(_registry())
        result = session.run(_stop_on_request, record=job.record != "none")
        row = _keep(RunRow.of(case.columns, result), job, result)
        return dataclasses.replace(
            row,
            cpu_time_s=round(time.process_time() - began, 3),
            memory_mb=round(peak_memory_mb(), 1),
        )
    except InputError as error:
        return case.fault(str(error), Cause.BAD_INPUT)
    except MemoryError:
        return case.fault("the machine has no memory left", Cause.TOO_MUCH_MEMORY)
    except SimulationError:
        raise  # of this machine now, not of the case: the run has no result
    except Exception as error:
        traceback.print_exc(file=sys.stderr)
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(where.filename).name}:{where.lineno}"
        return case.fault(f"{type(error).__name__}: {error} ({place})", Cause.EXCEPTION)


def _keep(row: RunRow, job: Job, result: MissionResult) -> RunRow:
    """Write picture and recording of the run if they are kept; the row names the picture."""
    if row.outcome == Outcome.CANCELLED:
        return row
    from navfw.missions.run_report import draw, write_run

    name = job.case.key.file_name(generated=bool(job.case.family))
    if _kept(job.record, row):
        with _losing_no_result(), RunFolder(job.pictures.with_name(RECORDINGS) / name) as folder:
            for missing in write_run(result, folder):
                sys.stderr.write(f"{folder.target}: {missing}\n")
    if _kept(job.keep, row):
        file = job.pictures / f"{name}.png"
        with _losing_no_result():
            with atomic_file(file) as unfinished:
                draw(result, unfinished)
            return dataclasses.replace(row, picture=f"{job.pictures.name}/{file.name}")
    return row


@contextlib.contextmanager
def _losing_no_result() -> Iterator[None]:
    """Print an exception, for example of a full disk, instead of raising it."""
    try:
        yield
    except Exception:
        traceback.print_exc(file=sys.stderr)


def _kept(which: KeptRuns, row: RunRow) -> bool:
    return which == "all" or (which == "failed" and not row.succeeded)


def _stop_on_request(_: object) -> None:
    if stop_requested():
        raise KeyboardInterrupt


@functools.cache
def _registry() -> Registry:
    """The plugins, imported once per process, which has one thread; each run builds a new stack."""
    import cv2

    cv2.setNumThreads(1)
    return default_registry()
