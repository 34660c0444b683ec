"""One run in a worker process: from a case to a row of the table, even after an exception."""

from __future__ import annotations

import dataclasses
import functools
import re
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from navfw.atomic import atomic_file
from navfw.errors import InputError, SimulationError
from navfw.missions.outcome import Outcome
from navfw.missions.session import MissionResult
from navfw.process_memory import peak_memory_mb
from navfw.suite.case import Case, Job
from navfw.suite.case_rows import case_columns, fault_row
from navfw.suite.failure_causes import Cause, classify
from navfw.suite.failure_symptoms import collect_symptoms
from navfw.suite.run_statistics import barn_score, sct
from navfw.suite.run_table import RunRow
from navfw.suite.worker_pool import stop_requested

if TYPE_CHECKING:
    from navfw.missions.runner import Progress
    from navfw.plugins import Registry

__all__ = ["picture_name", "row_of", "run_job"]


def run_job(job: Job) -> RunRow:
    """Run ``job`` and return its row; an exception gives a row with the outcome fault.

    Raises:
        SimulationError: the simulator cannot be started, or its temporary files not be written.

    """
    case = job.case
    try:
        _one_thread()
        session = case.session(_registry())
        result = session.run(_stop_on_request)
        return _with_picture(row_of(case, result), job, result)
    except InputError as error:
        return fault_row(case, str(error), Cause.BAD_INPUT)
    except MemoryError:
        return fault_row(case, "the machine has no memory left", Cause.TOO_MUCH_MEMORY)
    except SimulationError:
        raise  # of this machine now, not of the case: the run has no result
    except Exception as error:
        traceback.print_exc(file=sys.stderr)
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(where.filename).name}:{where.lineno}"
        return fault_row(case, f"{type(error).__name__}: {error} ({place})", Cause.EXCEPTION)


def row_of(case: Case, result: MissionResult) -> RunRow:
    """The row of a run with a result."""
    summary = result.summary()
    spec = result.session.mission.spec
    good = result.outcome.succeeded
    time, shortest = summary["sim_time_s"], summary["shortest_path_m"]
    numbers = {
        name: summary[name]
        for name in (
            "outcome",
            "reason",
            "behavior",
            "sim_time_s",
            "wall_time_s",
            "real_time_factor",
            "path_length_m",
            "shortest_path_m",
            "spl",
            "min_clearance_m",
            "clearance_p05_m",
            "collisions",
            "distance_to_goal_m",
            "estimate_error_m",
            "emergencies",
            "command_hash",
        )
    }
    return RunRow(
        **case_columns(case),
        **numbers,
        plugin_faults=len(result.uninvited_faults),
        cause=_cause(result),
        collision_cause=summary["collision_cause"] or "",
        sct=sct(good, time, shortest, spec.robot.max_v),
        barn_score=barn_score(good, result.metrics.traversal_s, spec.success.reference or shortest),
        memory_mb=round(peak_memory_mb(), 1),
    )


def _cause(result: MissionResult) -> str:
    """The cause of a failure; "" for a run that succeeded or was cancelled."""
    if result.outcome.succeeded or result.outcome is Outcome.CANCELLED:
        return ""
    try:
        return str(classify(collect_symptoms(result)) or "")
    except Exception:  # a failed classification does not invalidate the result
        traceback.print_exc(file=sys.stderr)
        return str(Cause.UNKNOWN)


def picture_name(case: Case) -> str:
    """A file name that is unique among the runs of the table and tells which run it is."""
    where = () if case.family else (case.world_name, case.mission_name)
    which = (case.variant,) if case.variant else (case.stack_name,)
    parts = dict.fromkeys((case.entry, *where, *which, str(case.seed)))
    return re.sub(r"[^\w.+-]+", "_", "-".join(parts)) + ".png"


def _with_picture(row: RunRow, job: Job, result: MissionResult) -> RunRow:
    wanted = job.keep == "all" or (job.keep == "failed" and not row.succeeded)
    if not wanted or row.outcome == Outcome.CANCELLED:
        return row
    from navfw.missions.run_report import draw

    file = job.pictures / picture_name(job.case)
    try:
        with atomic_file(file) as part:
            draw(result, part)
    except Exception:  # for example a full disk: the result is kept without its picture
        traceback.print_exc(file=sys.stderr)
        return row
    return dataclasses.replace(row, picture=f"{job.pictures.name}/{file.name}")


def _stop_on_request(progress: Progress) -> None:
    del progress
    if stop_requested():
        raise KeyboardInterrupt


@functools.cache
def _registry() -> Registry:
    """The plugins, imported once per process; each run builds a new stack from them."""
    from navfw.plugins import default_registry

    return default_registry()


@functools.cache
def _one_thread() -> None:
    import cv2

    cv2.setNumThreads(1)
