"""Runs a suite: all cases without a row, each journaled as it ends, with table and summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import Any, Protocol

from navfw.errors import InputError
from navfw.missions.outcome import Outcome
from navfw.process.interruption import INTERRUPTED, deferred
from navfw.suite.case import Case, Job, KeptRuns
from navfw.suite.case_worker import run_job
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_summary import summarize
from navfw.suite.worker_pool import WorkerFailure, WorkerPool

LIMIT = 900.0
"""Default wall-clock limit of a run [s]."""

MEMORY = 2000.0
"""Default limit [MB] of the memory of a run's process; usual ones have 400."""


class Engine(Protocol):
    """Runs jobs (``WorkerPool``, ``DaskEngine``)."""

    @property
    def capacity(self) -> int:
        """Number of jobs that run at the same time, at least 1."""

    def run(self, jobs: Iterable[Job], /) -> Iterator[tuple[Job, RunRow | WorkerFailure]]:
        """Each job with its result, in the order of completion."""


def engine_or_processes(
    engine: Engine | None,
    workers: int,
    *,
    limit: float = LIMIT,
    memory: float = MEMORY,
    work: Callable[[Job], RunRow] = run_job,
) -> AbstractContextManager[Engine]:
    """``engine``, which is entered already, or else ``workers`` processes of this machine."""
    if engine is not None:
        return nullcontext(engine)
    return WorkerPool(work, workers, limit, memory=memory)


def answered_row(case: Case, answer: RunRow | WorkerFailure) -> RunRow:
    """What an engine answers for ``case``, as a row."""
    return case.fault(answer.reason, answer.cause) if isinstance(answer, WorkerFailure) else answer


_EXPORT_PERIOD = 2.0
"""Shortest time [s] between two exports of table and summary; the journal has each run at once."""

_EXPORT_SHARE = 0.02
"""Largest share of the time that exports take: those of a large suite become rarer."""


@dataclass(frozen=True)
class SuiteResult:
    """The rows of a suite in the plan's order, their summary, and whether no run is missing.

    ``interrupted``: Ctrl-C or SIGTERM has ended it.
    ``unsaved`` is why table and summary could not be written at the end; "" if they were.
    """

    rows: tuple[RunRow, ...]
    summary: dict[str, Any]
    complete: bool
    unsaved: str = ""
    interrupted: bool = False

    @property
    def exit_code(self) -> int:
        """0: success; 1: runs have no result, or a plugin failed; 3: the table is not written.

        130: interrupted.
        """
        if self.unsaved:
            return 3
        if self.interrupted:
            return INTERRUPTED
        failed = self.summary["died"] or self.summary["plugin_faults"]
        return 0 if self.complete and not failed else 1


def run_suite(
    plan: SuitePlan,
    out: SuiteFolder,
    *,
    workers: int = 1,
    keep: KeptRuns = "failed",
    record: KeptRuns = "none",
    have: Sequence[RunRow] = (),
    limit: float = LIMIT,
    memory: float = MEMORY,
    work: Callable[[Job], RunRow] = run_job,
    on_row: Callable[[Case, RunRow], None] | None = None,
    engine: Engine | None = None,
) -> SuiteResult:
    """Run all cases of ``plan`` that have no row with a result in ``have`` yet.

    They run in ``workers`` processes of this machine, or by ``engine``, already entered.
    ``keep`` and ``record`` say of which runs pictures and recordings are kept.
    ``limit`` [s] and ``memory`` [MB] bound a run's wall time and its process's memory. ``on_row``
    is called with every run as it ends; by then it is in the journal of ``out``. A run that dies
    with its process is driven again, once, after all others. Ctrl-C, SIGTERM, or a folder that
    cannot be written end the suite early. The table in ``out`` is valid and contains all runs that
    have ended, unless it cannot be written (``SuiteResult.unsaved``).

    Raises:
        SimulationError: every worker process dies before it completes a run, or none can be
            started.

    """
    table = _SuiteTable(plan, out, have)
    jobs = [
        Job(case, out.pictures.absolute(), keep, record)
        for case in plan.cases
        if case.key not in table.rows
    ]
    drives = engine_or_processes(engine, workers, limit=limit, memory=memory, work=work)
    unsaved, interrupted = "", False
    with deferred():  # the engine alone is interrupted, while it waits for runs
        try:
            with drives as runner:
                while jobs:
                    jobs = _drive(runner.run(jobs), table, on_row)
        except KeyboardInterrupt:
            interrupted = True
        except InputError as error:  # of the journal, or of the exported files
            unsaved = str(error)
        finally:
            done = table.finish()
    return replace(done, unsaved=done.unsaved or unsaved, interrupted=interrupted)


def _drive(
    results: Iterable[tuple[Job, RunRow | WorkerFailure]],
    table: _SuiteTable,
    on_row: Callable[[Case, RunRow], None] | None,
) -> list[Job]:
    """Put the runs that have ended into the table; returns those to drive again."""
    again = []
    for job, result in results:
        attempts = 1 + (job.case.key in table.died)
        row = replace(answered_row(job.case, result), attempts=attempts)
        if row.outcome == Outcome.CANCELLED:
            continue
        table.add(job.case, row)
        if row.repeatable:
            again.append(job)
        elif on_row is not None:
            on_row(job.case, row)
    return again


class _SuiteTable:
    """Holds the rows; each goes to the journal at once, table and summary are exported later.

    ``died`` are the runs that died with their process for the first time, and have no other row.
    """

    def __init__(self, plan: SuitePlan, out: SuiteFolder, have: Sequence[RunRow]) -> None:
        self.plan = plan
        self.out = out
        self.rows = {row.key: row for row in have if row.has_result}
        self.died = {row.key for row in have if row.repeatable}
        self._revisions = list(out.about().get("revisions", []))
        self._next_export = time.monotonic() + _EXPORT_PERIOD

    def add(self, case: Case, row: RunRow) -> None:
        self.out.journal.add(case.content, row)
        if row.repeatable:
            self.died.add(row.key)
            return
        self.rows[row.key] = row
        began = time.monotonic()
        if began >= self._next_export:
            done = self._result()
            self.out.save(done.rows, done.summary)
            ended = time.monotonic()
            self._next_export = ended + max(_EXPORT_PERIOD, (ended - began) / _EXPORT_SHARE)

    def finish(self) -> SuiteResult:
        done = self._result()
        try:
            self.out.save(done.rows, done.summary)
            self.out.tidy()
        except (InputError, OSError) as error:
            return replace(done, unsaved=str(error))
        return done

    def _result(self) -> SuiteResult:
        order = {case.key: case.index for case in self.plan.cases}
        # rows of other seeds, from earlier runs of the suite into the same table, come last
        rows = sorted(self.rows.values(), key=lambda row: order.get(row.key, len(order)))
        complete = all(key in self.rows for key in order)
        summary = {
            "suite": self.plan.suite,
            "complete": complete,
            **summarize(rows, self.plan.expect),
            **({"skipped": dict(self.plan.skipped)} if self.plan.skipped else {}),
            "revisions": self._revisions,
        }
        return SuiteResult(tuple(rows), summary, complete)
