"""Run the cases of a suite that have no row yet; journal each as it ends; write the summary.

``run_case`` makes the row of a case in a worker process, even after an exception.
"""

from __future__ import annotations

import contextlib
import functools
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from navfw.errors import InputError, SimulationError
from navfw.guard.plugin_guard import error_text
from navfw.missions.outcome import Cause, Outcome
from navfw.missions.session import MissionResult
from navfw.plugins import Registry, default_registry
from navfw.process.atomic import atomic_file
from navfw.process.interruption import INTERRUPTED, deferred
from navfw.process.process_resources import peak_memory_mb, return_freed_memory
from navfw.recording.run_folder import RunFolder
from navfw.suite.case import RECORDINGS, Case, KeptRuns
from navfw.suite.run_row import RunKey, RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_summary import summarize
from navfw.suite.taught_maps import driven_session
from navfw.suite.worker_pool import WorkerFailure, WorkerPool, stop_requested


class Engine(Protocol):
    """Where cases are driven: a ``WorkerPool`` or a ``DaskEngine``."""

    @property
    def capacity(self) -> int:
        """Number of cases that run at the same time, at least 1."""

    def run(self, cases: Iterable[Case], /) -> Iterator[tuple[Case, RunRow | WorkerFailure]]:
        """Drive all cases; yield each with its result, in the order of completion."""


def engine_for(
    cases: Sequence[Case], scheduler: str | None, workers: int, limit: float, memory: float
) -> contextlib.AbstractContextManager[Engine]:
    """Return the engine for ``cases``: a Dask ``scheduler`` address, else ``workers`` processes.

    ``limit`` [s] and ``memory`` [MB] bound a run's wall time and its process's memory.

    Raises:
        MissingExtraError: Dask is not installed.

    """
    if scheduler is None:
        return WorkerPool(run_case, workers, limit, memory=memory)
    from navfw.suite.dask_engine import DaskEngine

    return DaskEngine(scheduler, cases, limit, memory)


def answered_row(case: Case, answer: RunRow | WorkerFailure) -> RunRow:
    """Turn an engine's answer for ``case`` into a row; a failure gives the outcome ``fault``."""
    return case.fault(answer.reason, answer.cause) if isinstance(answer, WorkerFailure) else answer


@dataclass(frozen=True)
class SuiteResult:
    """The rows of a suite in the plan's order, and their summary.

    ``complete`` is whether no run is missing, ``interrupted`` whether Ctrl-C or SIGTERM ended it.
    ``unsaved`` is the reason why table and summary could not be written; "" if they were.
    """

    rows: tuple[RunRow, ...]
    summary: dict[str, Any]
    complete: bool
    unsaved: str = ""
    interrupted: bool = False

    @property
    def exit_code(self) -> int:
        """0: success; 1: results missing or a plugin failed; 3: nothing saved; 130: interrupted."""
        if self.unsaved:
            return 3
        if self.interrupted:
            return INTERRUPTED
        failed = self.summary["died"] or self.summary["plugin_faults"]
        return 0 if self.complete and not failed else 1


def run_suite(
    plan: SuitePlan,
    out: SuiteFolder,
    engine: Engine,
    *,
    keep: KeptRuns = "failed",
    record: KeptRuns = "none",
    have: Sequence[RunRow] = (),
    on_row: Callable[[Case, RunRow], object] = lambda case, row: None,
) -> SuiteResult:
    """Run all cases of ``plan`` that have no row with a result in ``have`` yet.

    ``keep`` and ``record`` say for which runs pictures and recordings are kept. ``on_row`` is
    called with every run as it ends, after it was written to the journal of ``out``. A run whose
    process died is driven again, once, after all others. Ctrl-C, SIGTERM, or a folder that cannot
    be written end the suite early. At the end the table in ``out`` contains all runs that have
    ended, unless it cannot be written (``SuiteResult.unsaved``).

    Raises:
        SimulationError: all worker processes die before any completes a run, or none can be
            started.

    """
    rows = {row.key: row for row in have if row.has_result}
    died = {row.key for row in have if row.repeatable}
    pictures = out.pictures.absolute()
    cases = [
        replace(case, pictures=pictures, keep=keep, record=record)
        for case in plan.cases
        if case.key not in rows
    ]
    revisions, unsaved, interrupted = out.about()["revisions"], "", False
    with deferred():  # the engine alone is interrupted, while it waits for runs
        try:
            while cases:
                again = []
                for case, answer in engine.run(cases):
                    row = replace(answered_row(case, answer), attempts=1 + (case.key in died))
                    if row.outcome == Outcome.CANCELLED:
                        continue
                    out.journal.add(case.content, row)
                    if row.repeatable:
                        died.add(row.key)
                        again.append(case)
                    else:
                        rows[row.key] = row
                        on_row(case, row)
                cases = again
        except KeyboardInterrupt:
            interrupted = True
        except InputError as error:  # of the journal
            unsaved = str(error)
        finally:
            done = _result(plan, rows, revisions)
            try:
                out.save(done.rows, done.summary)
            except (InputError, OSError) as error:
                unsaved = unsaved or str(error)
    return replace(done, unsaved=unsaved, interrupted=interrupted)


def _result(plan: SuitePlan, by_key: dict[RunKey, RunRow], revisions: list[str]) -> SuiteResult:
    order = {case.key: case.index for case in plan.cases}
    # rows of other seeds, from earlier runs of the suite into the same table, come last
    rows = sorted(by_key.values(), key=lambda row: order.get(row.key, len(order)))
    complete = order.keys() <= by_key.keys()
    summary = {
        "suite": plan.suite,
        "complete": complete,
        **summarize(rows, plan.expect),
        **({"skipped": dict(plan.skipped)} if plan.skipped else {}),
        "revisions": revisions,
    }
    return SuiteResult(tuple(rows), summary, complete)


# --- in a worker process --------------------------------------------------------------------------


def run_case(case: Case) -> RunRow:
    """Run ``case`` and return its row; an exception gives a row with the outcome fault.

    Raises:
        SimulationError: the simulator cannot start or cannot write its temporary files.

    """
    began = time.process_time()
    return_freed_memory()  # of the run before
    try:
        session = driven_session(case, _registry())
        result = session.run(_stop_on_request, record=case.record != "none")
        row = _keep(RunRow.of(case.columns, result), case, result)
        return replace(
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
        return case.fault(error_text(error), Cause.EXCEPTION)


def _keep(row: RunRow, case: Case, result: MissionResult) -> RunRow:
    """Write picture and recording of the run if they are kept; the row names the picture."""
    if row.outcome == Outcome.CANCELLED:
        return row
    from navfw.missions.run_report import draw_trajectory, write_run

    name = case.key.file_name(generated=bool(case.family))
    if _kept(case.record, row):
        with _losing_no_result(), RunFolder(case.pictures.with_name(RECORDINGS) / name) as folder:
            for missing in write_run(result, folder):
                sys.stderr.write(f"{folder.target}: {missing}\n")
    if _kept(case.keep, row):
        file = case.pictures / f"{name}.png"
        with _losing_no_result():
            with atomic_file(file) as unfinished:
                draw_trajectory(result, unfinished)
            return replace(row, picture=f"{case.pictures.name}/{file.name}")
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
