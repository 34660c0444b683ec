"""Run jobs in worker processes, which are single-threaded, replaceable and isolated.

Processes are spawned, not forked, so that no state of this process leaks into a run. Each has its
own pipe, so that the job of a dead process is known (an executor would lose all jobs).
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from multiprocessing import connection, resource_tracker
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from navfw.errors import SimulationError
from navfw.missions.outcome import Cause
from navfw.process.interruption import (
    check_interrupted,
    interrupt_blocked,
    interruptible,
    unblock_interrupt,
)
from navfw.process.last_trace import dump_trace, ended_after, keep_trace, last_call
from navfw.process.process_resources import peak_memory_mb

_RECYCLE = 100
"""Number of jobs after which a process is replaced: the simulator's libraries leak memory."""

PERIOD = 0.5
"""Period [s] of checking for an interruption."""

_LOOK_PERIOD = 0.25
"""Period [s] in which a worker checks its memory and whether its parent lives."""

GRACE = 10.0
"""Time [s] that a worker has to end its job after a request to stop."""

_OVER_MEMORY = 86
"""Exit code of a worker that has exceeded its limit of memory."""

_LIBRARIES = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMEXPR_NUM", "NUMBA_NUM", "VECLIB_MAXIMUM")
_SINGLE_THREADED = {f"{library}_THREADS": "1" for library in _LIBRARIES}
_SINGLE_THREADED["OPENCV_FOR_THREADS_NUM"] = "1"
"""Environment variables that limit numerical libraries to one thread."""

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

_Flag = ctypes.c_byte
"""Shared by all processes. An Event has a lock, which a dying process would keep."""

_stop: _Flag | None = None


@dataclass(frozen=True, slots=True)
class WorkerFailure:
    """The reason why a job has no result: its process died, took too long or too much memory."""

    reason: str
    cause: Cause = Cause.PROCESS_DIED


def stop_requested() -> bool:
    """Whether the user has asked to stop the suite; False outside of worker processes."""
    return _stop is not None and _stop.value != 0


@dataclass
class WorkerPool(Generic[JobT, ResultT]):
    """Runs jobs in ``workers`` processes; a context manager, which ends them on exit.

    ``work``, called with each job, is a function of a module (it is pickled by name). A job that
    takes longer than ``limit`` [s] of wall-clock time is ended with its process, and so is one
    whose process exceeds ``memory`` [MB] of resident memory. ``recycle`` jobs end a process.
    """

    work: Callable[[JobT], ResultT]
    workers: int
    limit: float
    recycle: int = _RECYCLE
    memory: float = math.inf
    _done: int = field(init=False, default=0)
    _flag: _Flag = field(init=False)
    _all: list[_Worker] = field(init=False, default_factory=list)
    _cleanup: contextlib.ExitStack = field(init=False, default_factory=contextlib.ExitStack)

    def __enter__(self) -> Self:
        self._flag = multiprocessing.get_context("spawn").RawValue(_Flag, 0)
        # else the first process starts it, and unblocks SIGINT; of a killed pool it would warn
        with _environment({"PYTHONWARNINGS": "ignore:resource_tracker"}):
            resource_tracker.ensure_running()
        self._cleanup.enter_context(_environment(_SINGLE_THREADED))
        return self

    def __exit__(self, *exception: object) -> None:
        self._cleanup.close()
        self._flag.value, end = 1, time.monotonic() + GRACE
        for worker in self._all:
            worker.close(end)

    @property
    def capacity(self) -> int:
        """Number of jobs that run at the same time."""
        return self.workers

    def run(self, jobs: Iterable[JobT]) -> Iterator[tuple[JobT, ResultT | WorkerFailure]]:
        """Run all jobs and yield each with its result, in the order of completion.

        Raises:
            SimulationError: several processes have died, and none has completed a job, or none can
                be started.
            KeyboardInterrupt: the user interrupted; raised after the workers have stopped and
                the jobs finished by then have been yielded.

        """
        waiting, failed, end = deque(jobs), 0, math.inf  # the time by which all have to stop
        busy: dict[connection.Connection, tuple[_Worker, JobT]] = {}
        while busy or (waiting and end == math.inf):
            while waiting and len(busy) < self.workers and end == math.inf:
                worker = self._begun(waiting[0], {worker for worker, _ in busy.values()})
                busy[worker.pipe] = (worker, waiting.popleft())
            try:
                with interruptible():
                    finished = connection.wait(busy, PERIOD)
                    check_interrupted()
            except KeyboardInterrupt:
                self._flag.value, end = 1, time.monotonic() + GRACE
                continue
            if time.monotonic() > end:
                for worker, _ in busy.values():
                    worker.process.kill()
            for pipe in finished:
                worker, job = busy.pop(pipe)  # type: ignore[call-overload] # one of its keys
                result = worker.result()
                if isinstance(result, WorkerFailure):
                    failed += 1
                    if end < math.inf:
                        continue
                    if not self._done and failed > self.workers + 2:
                        raise SimulationError(f"all worker processes die: {result.reason}")
                else:
                    self._done += 1
                yield job, result
        if end < math.inf:
            raise KeyboardInterrupt

    def _begun(self, job: JobT, busy: set[_Worker]) -> _Worker:
        """Return a worker that has begun the ``job``: one that is idle, or a new one."""
        for worker in [worker for worker in self._all if worker not in busy]:
            if worker.jobs < self.recycle and worker.begin(job):
                return worker
            self._all.remove(worker)
            worker.close(time.monotonic() + GRACE)
        try:
            worker = _Worker(self._flag, self.work, self.limit, self.memory)
        except OSError as error:  # no memory, or too many processes
            what = f"no worker process can be started: {error.strerror or error}"
            raise SimulationError(f"{what}; take fewer --workers") from error
        self._all.append(worker)
        worker.begin(job)  # of one that has died already, the result tells
        return worker


class _Worker:
    """A process that does one job after the other."""

    def __init__(
        self, stop: _Flag, work: Callable[[Any], Any], limit: float, memory: float
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.limit, self.memory = limit, memory
        self.jobs, self.began = 0, 0.0
        # by name, as Windows opens no NamedTemporaryFile twice
        handle, self._file = tempfile.mkstemp(prefix="navfw-trace-")
        self.trace = os.fdopen(handle, encoding="utf-8", errors="replace")
        arguments = (theirs, stop, work, limit, memory, self._file)
        self.process = context.Process(target=_serve, args=arguments)
        try:
            with interrupt_blocked():  # until it ignores Ctrl-C
                self.process.start()
        finally:
            theirs.close()

    def begin(self, job: object) -> bool:
        """Whether the job could be sent: not if the process has died between two jobs."""
        self.jobs, self.began = self.jobs + 1, time.monotonic()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.pipe.send(job)
            return True
        return False

    def result(self) -> Any:
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            self.process.join()
            what, cause = "the process of the run ended without a result", Cause.PROCESS_DIED
            if self.process.exitcode == _OVER_MEMORY:
                what = f"exceeded the limit of {self.memory:g} MB of memory"
                cause = Cause.TOO_MUCH_MEMORY
            elif time.monotonic() - self.began >= self.limit:
                what = f"exceeded the wall-clock limit of {self.limit:g} s"
                cause = Cause.TOO_LONG
            call = last_call(self.trace.read())
            return WorkerFailure(f"{call}: {what}" if call else what, cause)

    def close(self, end: float) -> None:
        """End the process; by force if it has not ended by ``end`` [s, monotonic]."""
        self.pipe.close()
        self.process.join(max(0.0, end - time.monotonic()))
        self.process.kill()
        self.process.join()
        self.process.close()
        self.trace.close()
        Path(self._file).unlink()


@contextlib.contextmanager
def _environment(wanted: Mapping[str, str]) -> Iterator[None]:
    """Processes started inside have these variables."""
    before = {name: os.environ[name] for name in wanted if name in os.environ}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name in wanted:
            del os.environ[name]
        os.environ.update(before)


# --- in the worker -------------------------------------------------------------------------------


def _serve(
    pipe: connection.Connection,
    stop: _Flag,
    work: Callable[[Any], Any],
    limit: float,
    memory: float,
    trace: str,
) -> None:
    """Do the jobs that come through the ``pipe``, until it is closed."""
    global _stop  # noqa: PLW0603 - the only state of a worker process
    _stop = stop
    keep_trace(open(trace, "w", encoding="utf-8"))  # noqa: SIM115, PTH123 - for all of its life
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    unblock_interrupt()
    threading.Thread(target=_watch, args=(memory,), daemon=True).start()
    with contextlib.suppress(EOFError, OSError):  # the pool is closed, or its process has ended
        while True:
            job = pipe.recv()
            try:
                with ended_after(limit):
                    answer = work(job)
            except BaseException as error:  # also sys.exit of a plugin
                answer = WorkerFailure(f"{type(error).__name__}: {error}")
            pipe.send(answer)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # threads that plugins left behind would keep the process


def _watch(memory: float) -> None:
    """End this process when its parent has ended, or when it has more than ``memory`` [MB]."""
    parent = multiprocessing.parent_process()
    while parent is None or parent.is_alive():
        time.sleep(_LOOK_PERIOD)
        if peak_memory_mb() > memory:
            dump_trace()
            os._exit(_OVER_MEMORY)
    os._exit(1)
