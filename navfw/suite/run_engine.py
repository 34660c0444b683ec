"""What drives the runs of a suite: processes of this machine, or a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

from navfw.suite.case import Case, Job
from navfw.suite.case_worker import run_job
from navfw.suite.run_table import RunRow
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
