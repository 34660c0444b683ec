"""Drives the runs of a trial by an engine, a few at a time, so that it can be pruned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from navfw.suite.case import Case, Job
from navfw.suite.case_rows import row_of
from navfw.suite.run_engine import Engine
from navfw.suite.run_table import RunRow
from navfw.suite.worker_pool import WorkerFailure
from navfw.tune.tuning import Drive


def driver(engine: Engine) -> Drive:
    """A ``Drive`` by ``engine``: as many runs at once as it has places for.

    A run that dies with its process is driven again, once; then it counts as a fault.
    """

    def drive(cases: Sequence[Case]) -> Iterator[RunRow]:
        first = 0
        while first < len(cases):
            some = cases[first : first + engine.capacity]
            first += len(some)
            yield from _rows(engine, some)

    return drive


def _rows(engine: Engine, cases: Sequence[Case]) -> list[RunRow]:
    results = _results(engine, cases)
    again = [case for case in cases if _died(results[case.index])]
    results |= _results(engine, again)
    return [row_of(case, results[case.index]) for case in cases]


def _results(engine: Engine, cases: Sequence[Case]) -> dict[int, RunRow | WorkerFailure]:
    jobs = [Job(case, Path(), "none") for case in cases]
    return {job.case.index: result for job, result in engine.run(jobs)}


def _died(result: RunRow | WorkerFailure) -> bool:
    return isinstance(result, WorkerFailure) and result.repeatable
