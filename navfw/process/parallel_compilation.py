"""Compilation of kernels on all cores, by one process at a time for each cache folder.

Worker processes are forked, so that they need no imports. Each asks for a group of kernels, then
for the next, and ends when this process has ended.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from navfw.process.interruption import check_interrupted
from navfw.process.kernel_list import Kernel, groups_of, listed_kernels
from navfw.process.target_lock import TargetInUseError, TargetLock

PERIOD = 0.5
"""Wall time [s] between two reports while nothing is finished."""


@dataclass(frozen=True, slots=True)
class CompilationState:
    """``done`` of ``total`` kernels are compiled; ``now`` says what is being compiled."""

    done: int
    total: int
    now: str


Report = Callable[[CompilationState], object]


def compile_kernels(report: Report | None = None, *, loaded: bool = False) -> int:
    """Compile the listed kernels that are not compiled yet; returns their number.

    With ``loaded`` those of imported modules. ``report`` is called only if there are any, every
    ``PERIOD``. While another process compiles, this one waits and compiles nothing. In a process
    that may not have children, the kernels are compiled here, one after the other.

    Raises:
        KeyboardInterrupt: a signal has arrived; what was compiled by then is kept.

    """
    show = report or (lambda state: None)
    missing = [kernel for kernel in listed_kernels(loaded) if kernel.missing]
    if not missing:
        return 0
    folder = missing[0].cache_folder.parent / "kernels"
    lock = TargetLock(folder.absolute())
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # not writable: every process compiles for itself
            _wait_for(lock, missing, show)
            stack.callback(lock.release)
        missing = [kernel for kernel in missing if kernel.missing]
        groups = groups_of(missing)
        if multiprocessing.current_process().daemon:
            for kernel in missing:
                kernel.compile()
        else:
            _Workers(groups, show).run()
    return len(missing)


def _wait_for(lock: TargetLock, missing: Sequence[Kernel], show: Report) -> None:
    """Take the lock; meanwhile show what its holder has compiled."""
    while True:
        try:
            lock.acquire(PERIOD)
        except TargetInUseError:
            check_interrupted()
            done = sum(not kernel.missing for kernel in missing)
            show(CompilationState(done, len(missing), "by another process"))
        else:
            return


class _Workers:
    """Worker processes, one for each core, that compile ``groups``."""

    def __init__(self, groups: Sequence[Sequence[Kernel]], show: Report) -> None:
        self._groups = groups
        self._show = show
        self._total = sum(map(len, groups))
        self._done = 0
        self._next = 0
        self._busy: dict[Connection, int] = {}

    def run(self) -> None:
        """Compile all groups. What a worker that dies leaves is compiled when it is called."""
        context = multiprocessing.get_context("fork")
        processes = []
        try:
            for _ in range(min(_cores(), len(self._groups))):
                ours, theirs = context.Pipe()
                processes.append(context.Process(target=_work, args=(theirs, ours, self._groups)))
                processes[-1].start()
                theirs.close()
                self._give(ours)
            while self._busy:
                self._report()
                for connection in wait(list(self._busy), PERIOD):
                    self._take(connection)
                check_interrupted()
            self._report()
        except BaseException:
            for process in processes:
                process.terminate()
            raise
        finally:
            for process in processes:
                process.join()

    def _give(self, connection: Connection) -> None:
        """Give the next group to a worker, or end it."""
        if self._next == len(self._groups):
            connection.close()
            return
        self._busy[connection] = self._next
        connection.send(self._next)
        self._next += 1

    def _take(self, connection: Any) -> None:
        """Take in that a worker has finished its group, or has died."""
        group = self._groups[self._busy.pop(connection)]
        with contextlib.suppress(EOFError, OSError):
            connection.recv()
            self._done += len(group)
            self._give(connection)

    def _report(self) -> None:
        kernels = [self._groups[number][0].name for number in self._busy.values()]
        names = ", ".join(name.removeprefix("navfw.") for name in kernels)
        self._show(CompilationState(self._done, self._total, names))


def _cores() -> int:
    """The number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _work(connection: Connection, other: Connection, groups: Sequence[Sequence[Kernel]]) -> None:
    """Compile the groups that are asked for, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all: the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    other.close()
    with contextlib.suppress(EOFError, OSError):
        while True:
            number = connection.recv()
            for kernel in groups[number]:
                kernel.compile()
            connection.send(number)
