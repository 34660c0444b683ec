"""Jobs in worker processes: single-threaded, replaceable, isolated from each other.

Each worker is an executor with one process, so that the job of a dead process is known. Processes
are spawned, not forked, so that no state of this process leaks into a run.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import multiprocessing
import os
import signal
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext
from typing import Any, Generic, Self, TypeVar

from navfw.errors import SimulationError
from navfw.process.interruption import check_interrupted, interruptible
from navfw.process.last_trace import dump_trace, ended_after, keep_trace, last_call
from navfw.process.process_resources import peak_memory_mb
from navfw.suite.failure_causes import Cause

_RECYCLE = 100
"""Number of jobs after which a process is replaced: the simulator's libraries leak memory."""

PERIOD = 0.5
"""Period [s] of looking for a signal while workers are busy."""

_LOOK_PERIOD = 0.25
"""Period [s] in which a worker looks at its memory, its parent, and for a request to stop."""

GRACE = 10.0
"""Time [s] for a worker to end its job after a request to stop."""

_LIBRARIES = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMEXPR_NUM", "NUMBA_NUM", "VECLIB_MAXIMUM")
_SINGLE_THREADED = {f"{library}_THREADS": "1" for library in _LIBRARIES}
_SINGLE_THREADED["OPENCV_FOR_THREADS_NUM"] = "1"
"""Environment variables by which numerical libraries use one thread."""

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")


_Flag = ctypes.c_byte
"""Shared by all processes. An Event has a lock, which a dying process would keep."""

_stop: _Flag | None = None


@dataclass(frozen=True, slots=True)
class WorkerFailure:
    """A job whose process ended without a result, and why: died, too long, too much memory."""

    reason: str
    cause: Cause = Cause.PROCESS_DIED

    @property
    def repeatable(self) -> bool:
        """Whether another process may succeed: time does not get longer."""
        return self.cause is not Cause.TOO_LONG


def stop_requested() -> bool:
    """In a worker process: whether the user has stopped the suite."""
    return _stop is not None and _stop.value != 0


@dataclass
class WorkerPool(Generic[JobT, ResultT]):
    """A context manager; ``run`` yields each job with its result, in the order of completion.

    ``work`` is a function of a module (it is pickled by name). A job that takes longer than
    ``limit`` [s] of wall-clock time is ended with its process, and so is one whose process has more
    than ``memory`` [MB] of resident memory.
    """

    work: Callable[[JobT], ResultT]
    workers: int
    limit: float
    recycle: int = _RECYCLE
    memory: float = math.inf
    _done: int = field(init=False, default=0)
    _flag: _Flag = field(init=False)
    _slots: list[_WorkerSlot] = field(init=False, default_factory=list)
    _cleanup: contextlib.ExitStack = field(init=False, default_factory=contextlib.ExitStack)

    def __enter__(self) -> Self:
        context = multiprocessing.get_context("spawn")
        self._flag = stop = context.RawValue(_Flag, 0)
        # else the first process starts it, and unblocks SIGINT; of a killed pool it would warn
        with _environment({"PYTHONWARNINGS": "ignore:resource_tracker"}):
            resource_tracker.ensure_running()
        self._cleanup.enter_context(_environment(_SINGLE_THREADED))
        self._cleanup.callback(setattr, stop, "value", 1)
        for _ in range(self.workers):
            file = tempfile.NamedTemporaryFile("r", errors="replace", prefix="navfw-trace-")
            trace = self._cleanup.enter_context(file)
            self._slots.append(_WorkerSlot(context, stop, self.recycle, self.memory, trace))
        return self

    def __exit__(self, *exception: object) -> None:
        self._cleanup.close()
        for slot in self._slots:
            slot.close()

    @property
    def capacity(self) -> int:
        """Number of jobs that run at the same time."""
        return self.workers

    def run(self, jobs: Iterable[JobT]) -> Iterator[tuple[JobT, ResultT | WorkerFailure]]:
        """Run all jobs; may be called again with others.

        Raises:
            SimulationError: several processes have died, and none has completed a job, or none can
                be started.
            KeyboardInterrupt: of the user; raised once the workers have stopped, and what they had
                finished by then has been yielded.

        """
        waiting = deque(jobs)
        busy: dict[Future[ResultT], tuple[_WorkerSlot, JobT]] = {}
        idle = list(self._slots)
        failed, stopping = 0, False
        while busy or (waiting and not stopping):
            while not stopping and idle and waiting:
                slot, job = idle.pop(), waiting.popleft()
                busy[slot.submit(self.work, job, self.limit)] = (slot, job)
            try:
                with interruptible():
                    finished, _ = wait(busy, PERIOD, return_when=FIRST_COMPLETED)
                    check_interrupted()
            except KeyboardInterrupt:
                stopping = True
                self._flag.value = 1  # the workers end within GRACE
                continue
            for future in finished:
                slot, job = busy.pop(future)
                idle.append(slot)
                result = slot.result(future, self.limit)
                if stopping and isinstance(result, WorkerFailure):
                    continue
                failed += isinstance(result, WorkerFailure)
                self._done += not isinstance(result, WorkerFailure)
                if not self._done and failed > self.workers + 2:
                    assert isinstance(result, WorkerFailure)  # noqa: S101 - all results so far are failures
                    raise SimulationError(f"all worker processes die: {result.reason}")
                yield job, result
        if stopping:
            raise KeyboardInterrupt


class _WorkerSlot:
    """One worker: its process, which is replaced after _RECYCLE jobs or when it dies."""

    def __init__(
        self, context: SpawnContext, stop: _Flag, recycle: int, most: float, trace: Any
    ) -> None:
        self._context = context
        self._stop = stop
        self._recycle = recycle
        self._most = most
        self._exceeded = context.RawValue(_Flag, 0)
        self._jobs = 0
        self._began = 0.0
        self._executor: ProcessPoolExecutor | None = None
        self._trace = trace

    def submit(self, work: Callable[[Any], Any], job: object, limit: float) -> Future[Any]:
        if self._jobs >= self._recycle:
            self.close()
        if self._executor is None:
            self._jobs = 0
            self._exceeded.value = 0
            self._executor = ProcessPoolExecutor(
                1,
                mp_context=self._context,
                initializer=_begin,
                initargs=(self._stop, self._trace.name, self._most, self._exceeded),
            )
        self._jobs += 1
        self._began = time.monotonic()
        try:
            with _interrupt_blocked():  # a new process inherits it, until it ignores Ctrl-C
                return self._executor.submit(_limited, work, job, limit)
        except BrokenProcessPool:  # the process died between two jobs
            self.close()
            return self.submit(work, job, limit)
        except OSError as error:  # no memory, or too many processes
            what = f"no worker process can be started: {error.strerror or error}"
            raise SimulationError(f"{what}; take fewer --workers") from error

    def result(self, future: Future[Any], limit: float) -> Any:
        try:
            return future.result()
        except BrokenProcessPool:
            self.close()
            self._trace.seek(0)
            call = last_call(self._trace.read())
            who = f"{call}: " if call else ""
            if self._exceeded.value:
                what = f"{who}exceeded the limit of {self._most:g} MB of memory"
                return WorkerFailure(what, Cause.TOO_MUCH_MEMORY)
            if time.monotonic() - self._began >= limit:
                what = f"{who}exceeded the wall-clock limit of {limit:g} s"
                return WorkerFailure(what, Cause.TOO_LONG)
            return WorkerFailure(f"{who}the process of the run ended without a result")
        except Exception as error:  # raised by the job, or a result that cannot be pickled
            return WorkerFailure(f"{type(error).__name__}: {error}")

    def close(self) -> None:
        if self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)
            self._executor = None


@contextlib.contextmanager
def _interrupt_blocked() -> Iterator[None]:
    """Block SIGINT; it arrives at the end."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


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


def _begin(stop: _Flag, trace: str, most: float, exceeded: _Flag) -> None:
    """Set up a worker process: it ignores Ctrl-C, and ends when its parent ends.

    Also, with ``exceeded`` set, when it has more than ``most`` [MB] of memory.
    """
    global _stop  # noqa: PLW0603 - the only state of a worker process
    _stop = stop
    keep_trace(open(trace, "w", encoding="utf-8"))  # noqa: SIM115, PTH123 - for all of its life
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_watch, args=(stop, most, exceeded), daemon=True).start()


def _watch(stop: _Flag, most: float, exceeded: _Flag) -> None:
    """End this process when its parent has ended, or GRACE after a request to stop.

    Also when it has more than ``most`` [MB] of memory, or when its main thread has ended: threads
    that plugins left behind do not.
    """
    parent = multiprocessing.parent_process()
    while threading.main_thread().is_alive() and (parent is None or parent.is_alive()):
        time.sleep(_LOOK_PERIOD)
        if peak_memory_mb() > most:
            exceeded.value = 1
            dump_trace()
            break
        if stop.value:
            time.sleep(GRACE)
            break
    os._exit(1)


def _limited(work: Callable[[Any], Any], job: object, limit: float) -> object:
    with ended_after(limit):
        return work(job)
