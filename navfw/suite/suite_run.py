"""Runs a suite: all cases without a row, with table and summary saved on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from navfw.errors import InputError
from navfw.interruption import deferred
from navfw.missions.outcome import Outcome
from navfw.suite.case import Case, Job, KeptPictures
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
"""Shortest time [s] between two saves of the table: at most this work is lost by a power cut."""

LIMIT = 900.0
"""Default wall-clock limit of a run [s]."""


@dataclass(frozen=True)
class SuiteResult:
    """The rows of a suite in the plan's order, their summary, and whether no run is missing.

    ``unsaved`` is why table and summary could not be written at the end; "" if they were.
    """

    rows: tuple[RunRow, ...]
    summary: dict[str, Any]
    complete: bool
    unsaved: str = ""

    @property
    def exit_code(self) -> int:
        """0: success; 1: runs have no result, or a plugin failed; 3: the table is not written."""
        if self.unsaved:
            return 3
        failed = self.summary["died"] or self.summary["plugin_faults"]
        return 0 if self.complete and not failed else 1


def run_suite(
    plan: SuitePlan,
    out: SuiteFolder,
    *,
    workers: int = 1,
    keep: KeptPictures = "failed",
    have: Sequence[RunRow] = (),
    limit: float = LIMIT,
    work: Callable[[Job], RunRow] = run_job,
    on_row: Callable[[Case, RunRow], None] | None = None,
) -> SuiteResult:
    """Run all cases of ``plan`` that have no row in ``have`` yet.

    ``on_row`` is called with every run as it ends. Ctrl-C, SIGTERM, or a table that cannot be
    written end the suite early. The table in ``out`` is valid and contains all runs that have
    ended, unless it cannot be written (``SuiteResult.unsaved``).

    Raises:
        SimulationError: every worker process dies before it completes a run.

    """
    table = _TableKeeper(plan, out, have)
    jobs = [
        Job(case, out.pictures.absolute(), keep)
        for case in plan.cases
        if case.key not in table.rows
    ]
    with deferred():  # the pool alone is interrupted, while it waits for runs
        try:
            with WorkerPool(work, max(1, min(workers, len(jobs))), limit) as pool:
                for job, result in pool.run(jobs):
                    row = _row(job.case, result)
                    if row.outcome == Outcome.CANCELLED:
                        continue
                    table.add(row)
                    if on_row is not None:
                        on_row(job.case, row)
        except (KeyboardInterrupt, InputError):
            pass  # the suite is incomplete, and its last result says why it is not saved
        finally:
            done = table.finish()
    return done


def _row(case: Case, result: RunRow | WorkerFailure) -> RunRow:
    if isinstance(result, RunRow):
        return result
    cause = Cause.TOO_LONG if result.too_long else Cause.PROCESS_DIED
    return fault_row(case, result.reason, cause)


class _TableKeeper:
    """Holds the rows, and saves table and summary every SAVE_PERIOD."""

    def __init__(self, plan: SuitePlan, out: SuiteFolder, have: Sequence[RunRow]) -> None:
        self.plan = plan
        self.out = out
        self._revisions = out.revisions
        self.rows: dict[RunKey, RunRow] = {row.key: row for row in have}
        self._saved = time.monotonic()

    def add(self, row: RunRow) -> None:
        self.rows[row.key] = row
        if time.monotonic() - self._saved >= SAVE_PERIOD:
            done = self._result()
            self.out.save(done.rows, done.summary)
            self._saved = time.monotonic()

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
