"""Drives the runs of a trial in worker processes, a few at a time, so that it can be pruned."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from navfw.suite.case import Case, Job
from navfw.suite.case_rows import fault_row
from navfw.suite.case_worker import run_job
from navfw.suite.run_table import RunRow
from navfw.suite.worker_pool import WorkerFailure, WorkerPool
from navfw.tune.tuning import Drive

__all__ = ["driver"]


@contextlib.contextmanager
def driver(workers: int, limit: float) -> Iterator[Drive]:
    """A ``Drive`` by ``workers`` processes; a run may take ``limit`` [s] of wall-clock time.

    A run that dies with its process counts as a fault.
    """
    with WorkerPool(run_job, workers, limit) as pool:

        def drive(cases: Sequence[Case]) -> Iterator[RunRow]:
            for first in range(0, len(cases), workers):
                jobs = [Job(case, Path(), "none") for case in cases[first : first + workers]]
                rows = {job.case.index: _row(job.case, result) for job, result in pool.run(jobs)}
                yield from (rows[job.case.index] for job in jobs)

        yield drive


def _row(case: Case, result: RunRow | WorkerFailure) -> RunRow:
    if isinstance(result, WorkerFailure):
        return fault_row(case, result.reason, result.cause)
    return result
