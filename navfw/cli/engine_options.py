"""Options of commands that drive many runs: how many at once, their limits, and where."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from navfw.suite.case import Case
    from navfw.suite.run_engine import Engine


class EngineKind(StrEnum):
    """What drives the runs."""

    PROCESSES = "processes"
    DASK = "dask"


Workers = Annotated[int, typer.Option(min=1, max=256, help="Processes, each with one thread.")]
Limit = Annotated[float, typer.Option(min=1.0, help="Largest wall time of a run [s].")]
Memory = Annotated[float, typer.Option(min=100.0, help="Largest memory of a run's process [MB].")]
EngineName = Annotated[
    EngineKind, typer.Option("--engine", help="Processes of this machine, or a cluster of Dask.")
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Of --engine dask: tcp://HOST:PORT.")
]


def check_engine(engine: EngineKind, scheduler: str | None) -> None:
    """Raise typer.BadParameter unless an address is given for Dask, and for Dask alone."""
    if (engine is EngineKind.DASK) != (scheduler is not None):
        what = "needs --engine dask" if scheduler else "needs --scheduler tcp://HOST:PORT"
        raise typer.BadParameter(what, param_hint="--scheduler" if scheduler else "--engine dask")


@contextlib.contextmanager
def dask_engine(
    scheduler: str | None, cases: Sequence[Case], *, limit: float, memory: float
) -> Iterator[Engine | None]:
    """The engine at a scheduler of Dask; None without one.

    Raises:
        MissingExtraError: Dask is not installed.
        InputError: the scheduler cannot be reached, or its workers differ from this machine.

    """
    if scheduler is None:
        yield None
        return
    from navfw.suite.dask_engine import DaskEngine
    from navfw.suite.job_package import JobPackage

    package = JobPackage.of(cases)
    with DaskEngine(scheduler, package, limit=limit, memory=memory) as engine:
        yield engine
