"""A whole suite: what is missing is run, the table grows, the summary follows."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from navfw.missions.outcome import Outcome
from navfw.suite.case import Case, Job, Keep
from navfw.suite.case_rows import fault_row
from navfw.suite.case_worker import run_job
from navfw.suite.failure_causes import Cause
from navfw.suite.run_table import RunKey, RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_summary import summarize
from navfw.suite.worker_pool import WorkerFailure, WorkerPool

__all__ = ["SuiteResult", "run_suite"]

SAVE_PERIOD = 2.0
"""Seconds between two writings of the table: what a power cut can cost."""

LIMIT = 900.0
"""Seconds of the clock on the wall that a run may take."""


@dataclass(frozen=True)
class SuiteResult:
    """What a suite gave: its rows in the plan's order, and whether any run is missing."""

    rows: tuple[RunRow, ...]
    summary: dict[str, Any]
    complete: bool


def run_suite(
    plan: SuitePlan,
    out: SuiteFolder,
    *,
    workers: int = 1,
    keep: Keep = "failed",
    have: Sequence[RunRow] = (),
    limit: float = LIMIT,
    work: Callable[[Job], RunRow] = run_job,
    tell: Callable[[Case, RunRow], None] | None = None,
) -> SuiteResult:
    """Run all cases of ``plan`` that are not among the rows it may already ``have``.

    ``tell`` hears of every run as it ends. A KeyboardInterrupt ends the evaluation early: the
    table in ``out`` then has all the runs that have ended, and is valid.

    Raises:
        InputError: the table cannot be written.
        SimulationError: no worker process stays alive.

    """
    keeper = _TableKeeper(plan, out, have)
    jobs = [Job(case, out.pictures, keep) for case in plan.cases if case.key not in keeper.rows]
    interrupted = False
    try:
        with WorkerPool(work, max(1, min(workers, len(jobs))), limit) as pool:
            for job, result in pool.run(jobs):
                row = _dead(job.case, result) if isinstance(result, WorkerFailure) else result
                if row.outcome == Outcome.CANCELLED:
                    continue
                keeper.add(row)
                if tell is not None:
                    tell(job.case, row)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        done = keeper.finish()
    assert done.complete or interrupted or not jobs  # noqa: S101 - every job gives a row
    return done


def _dead(case: Case, died: WorkerFailure) -> RunRow:
    return fault_row(case, died.reason, Cause.TOO_LONG if died.too_long else Cause.PROCESS_DIED)


class _TableKeeper:
    """Keeps the rows, and every now and then the files."""

    def __init__(self, plan: SuitePlan, out: SuiteFolder, have: Sequence[RunRow]) -> None:
        self.plan = plan
        self.out = out
        self.rows: dict[RunKey, RunRow] = {row.key: row for row in have}
        self._saved = time.monotonic()

    def add(self, row: RunRow) -> None:
        self.rows[row.key] = row
        if time.monotonic() - self._saved >= SAVE_PERIOD:
            self._save()

    def finish(self) -> SuiteResult:
        done = self._save()
        self.out.tidy()
        return done

    def _save(self) -> SuiteResult:
        order = {case.key: case.index for case in self.plan.cases}
        # rows of other seeds, from an earlier evaluation into the same table, come last
        rows = sorted(self.rows.values(), key=lambda row: order.get(row.key, len(order)))
        complete = all(key in self.rows for key in order)
        summary = {
            "suite": self.plan.suite,
            "complete": complete,
            **summarize(rows, self.plan.expect),
            **({"skipped": dict(self.plan.skipped)} if self.plan.skipped else {}),
            "revisions": self.out.revisions,
        }
        self.out.save(rows, summary)
        self._saved = time.monotonic()
        return SuiteResult(tuple(rows), summary, complete)
