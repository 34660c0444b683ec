"""What runs inside a worker of Dask: the files of a suite, and its runs in processes of their own.

A run needs a main thread, may hang or leak, and has limits of time and memory; so each thread of
Dask hands its runs to a process of a ``WorkerPool``. Only there the simulator is imported.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from distributed import Worker, WorkerPlugin, get_worker

from navfw.config.project_trust import TRUST_VARIABLE
from navfw.errors import SimulationError
from navfw.suite.case import Job
from navfw.suite.job_package import JobPackage, worker_identity
from navfw.suite.run_journal import RunRow
from navfw.suite.worker_pool import WorkerFailure, WorkerPool


@dataclass(frozen=True)
class RemoteResult:
    """A row, or why there is none, with the picture of the run as PNG."""

    row: RunRow | WorkerFailure
    picture: bytes | None = None


@dataclass(eq=False)
class PackageOnWorker(WorkerPlugin):
    """Unpacks the files of a suite on every worker, also on one that joins later.

    ``work`` is the function of a job, ``module:name``.
    """

    package: JobPackage
    work: str
    limit: float
    memory: float
    folder: Path = Path()

    def __post_init__(self) -> None:
        self.name = f"navfw-{self.package.key}"
        self.identity = worker_identity()
        self.idle: list[WorkerPool[Job, RemoteResult]] = []

    def setup(self, worker: Worker) -> None:
        """Unpack the files in the worker's own folder; its profiler would only see it wait."""
        self.folder = self.package.unpack(Path(worker.local_directory))
        for profile in _profiles(worker):
            profile.stop()

    def teardown(self, worker: Worker) -> None:
        """End the processes of the runs."""
        for profile in _profiles(worker):
            profile.start()
        while self.idle:
            self.idle.pop().__exit__(None, None, None)

    def run(self, job: Job) -> RemoteResult:
        """Drive a run in a process that is kept for the next one."""
        if self.identity != worker_identity():
            raise SimulationError("the worker has another version of navfw or of its libraries")
        process = multiprocessing.current_process()
        if process.daemon:  # as Dask's nanny starts it; a daemon may have no processes of its own
            process.daemon = False
        pool = self.idle.pop() if self.idle else self._new_pool()
        try:
            ((_, result),) = pool.run([self.package.unpacked(job, self.folder)])
        finally:
            self.idle.append(pool)
        return RemoteResult(result) if isinstance(result, WorkerFailure) else result

    def _new_pool(self) -> WorkerPool[Job, RemoteResult]:
        work = partial(_work_in_folder, self.work, self.folder)
        return WorkerPool(work, 1, self.limit, memory=self.memory).__enter__()


def _profiles(worker: Worker) -> list[Any]:
    """The callbacks that look at the worker's threads every 10 ms; 1.5 % of a core."""
    callbacks: Any = worker.periodic_callbacks
    return [callbacks[name] for name in ("profile", "profile-cycle") if name in callbacks]


def drive(name: str, job: Job) -> RemoteResult:
    """A task of Dask: one run on this worker, with the files of the package ``name``."""
    plugin: Any = get_worker().plugins.get(name)
    if plugin is None:
        raise SimulationError("the worker could not take the files of the suite; see its log")
    result: RemoteResult = plugin.run(job)
    return result


def _work_in_folder(name: str, unpacked: Path, job: Job) -> RemoteResult:
    """In the process of the run: its project is the unpacked one, trusted by who sent it."""
    os.environ[TRUST_VARIABLE] = "1"
    os.chdir(unpacked / "project")
    with tempfile.TemporaryDirectory(prefix="navfw-pictures-") as folder:
        pictures = Path(folder) / job.pictures.name
        pictures.mkdir(exist_ok=True)
        work: Callable[[Job], RunRow] = resolve_name(name)
        row = work(replace(job, pictures=pictures))
        picture = pictures / Path(row.picture).name if row.picture else None
        return RemoteResult(row, picture.read_bytes() if picture else None)
