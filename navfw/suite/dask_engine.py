"""The runs of a suite on the workers of a Dask scheduler: a cluster, or this machine."""

from __future__ import annotations

import contextlib
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Self

from navfw.config.extras import extra_imports
from navfw.errors import InputError, SimulationError
from navfw.process.atomic import atomic_file
from navfw.process.interruption import check_interrupted, interruptible
from navfw.suite.case import Job
from navfw.suite.case_worker import run_job
from navfw.suite.job_package import JobPackage, worker_identity
from navfw.suite.run_journal import RunRow
from navfw.suite.worker_pool import WorkerFailure

PERIOD = 0.5
"""Period [s] of looking for an interruption."""

CONNECT_TIME = 15.0
"""Longest time [s] to wait for the scheduler's answer."""

_WORKER_TIME = 60.0
"""Longest time [s] to wait for a worker, at the beginning and when all have gone."""

AHEAD = 3
"""Number of runs given to Dask at once per thread of its workers."""


@dataclass
class DaskEngine:
    """A context manager; ``run`` yields each job with its result, in the order of completion.

    A run whose worker is lost is driven again by Dask on another one.

    Raises:
        MissingExtraError: Dask is not installed.
        InputError: the scheduler cannot be reached or has no workers; a worker has another version
            of navfw, Python or a library, or lacks a plugin.

    """

    address: str
    package: JobPackage
    limit: float
    memory: float
    work: Callable[[Job], RunRow] = run_job
    _name: str = field(init=False, default="")
    _client: Any = field(init=False, default=None)

    def __enter__(self) -> Self:
        with extra_imports("dask", key="--engine"):
            import distributed
        connect: Any = distributed.Client  # has no types
        security: Any = distributed.Security
        try:
            arguments = security().get_connection_args("client")
            if self.address.startswith("tls://") and arguments["ssl_context"] is None:
                what = "tls:// needs certificates: set distributed.comm.tls in Dask's configuration"
                raise InputError(what, key="--scheduler")
            self._client = connect(self.address, timeout=CONNECT_TIME, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            what = f"no scheduler of Dask answers at {self.address} ({type(error).__name__})"
            help_ = "start one with dask scheduler, or correct the address"
            raise InputError(f"{what}; {help_}", key="--scheduler") from None
        try:
            self._prepare()
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            self._client.unregister_worker_plugin(self._name)
        self._client.close()

    @property
    def capacity(self) -> int:
        """Number of threads of all workers now; 1 while there are none."""
        return max(1, self._threads)

    @property
    def _threads(self) -> int:
        return sum(self._client.nthreads().values())

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, RunRow | WorkerFailure]]:
        """Run all jobs; may be called again with others.

        Raises:
            SimulationError: scheduler or workers are gone, or a worker has another version.
            KeyboardInterrupt: of the user; what had not ended is cancelled.

        """
        import distributed

        wait: Any = distributed.wait  # has no types
        waiting, futures = deque(jobs), dict[Any, Job]()
        seen = time.monotonic()
        while waiting or futures:
            threads = self._threads
            seen = time.monotonic() if threads else seen
            if time.monotonic() - seen > _WORKER_TIME:
                raise SimulationError(f"{self.address} has no workers left; {_RESUME}")
            for _ in range(min(len(waiting), max(AHEAD * threads, 1) - len(futures))):
                job = waiting.popleft()
                futures[self._submitted(job)] = job
            try:
                with interruptible():
                    with self._client.as_current(), contextlib.suppress(TimeoutError):
                        wait(list(futures), timeout=PERIOD, return_when="FIRST_COMPLETED")
                    check_interrupted()
            except KeyboardInterrupt:
                self._client.cancel(list(futures), force=True)
                raise
            for future in [future for future in futures if future.done()]:
                job = futures.pop(future)
                yield job, self._result(future, job)

    def _prepare(self) -> None:
        """Compare the workers with this machine, and send them the files."""
        try:
            self._client.wait_for_workers(1, timeout=_WORKER_TIME)
        except TimeoutError:
            what = f"{self.address} has no workers; start some with dask worker {self.address}"
            raise InputError(what, key="--scheduler") from None
        try:
            identities = self._client.run(worker_identity)
        except Exception as error:
            what = f"a worker of {self.address} cannot import this navfw: {error}"
            raise InputError(f"{what}; install the same version there", key="--scheduler") from None
        for address, theirs in sorted(identities.items()):
            _compare(address, theirs, worker_identity())

        from navfw.suite.dask_worker import PackageOnWorker

        work = f"{self.work.__module__}:{self.work.__qualname__}"
        plugin = PackageOnWorker(self.package, work, self.limit, self.memory)
        self._name = plugin.name
        self._client.register_plugin(plugin)

    def _submitted(self, job: Job) -> Any:
        from navfw.suite.dask_worker import drive

        key = f"navfw-{job.case.index}-{uuid.uuid4().hex}"
        return self._client.submit(drive, self._name, self.package.packed(job), key=key, pure=False)

    def _result(self, future: Any, job: Job) -> RunRow | WorkerFailure:
        if future.status == "error":
            error = future.exception()
            if isinstance(error, SimulationError):
                raise SimulationError(f"{self.address}: {error}; {_RESUME}")
            return WorkerFailure(f"{type(error).__name__}: {error}")
        if future.status != "finished":
            what = f"the connection to the scheduler at {self.address} is lost"
            raise SimulationError(f"{what}; {_RESUME}")
        answer = future.result()
        if answer.picture is not None:
            with atomic_file(job.pictures / answer.row.picture.rpartition("/")[2]) as unfinished:
                unfinished.write_bytes(answer.picture)
        row: RunRow | WorkerFailure = answer.row
        return row


_RESUME = "--resume drives the rest"


def _compare(address: str, theirs: dict[str, str], ours: dict[str, str]) -> None:
    """Raise InputError at the first difference; a worker may have more plugins."""
    lacking = set(ours["plugins"].split(", ")) - {"", *theirs["plugins"].split(", ")}
    if lacking:
        names = ", ".join(islice(sorted(lacking), 5))
        what = f"the worker {address} lacks the plugin {names}; install its package there"
        raise InputError(what, key="--scheduler")
    for name, value in ours.items():
        if name != "plugins" and theirs.get(name) != value:
            what = f"the worker {address} has {name} {theirs.get(name)}, here it is {value}"
            raise InputError(f"{what}; install the same there", key="--scheduler")
