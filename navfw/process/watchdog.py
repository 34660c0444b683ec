"""The watchdog: a time limit for every call of a plugin.

Wall time must not decide what the robot does from tick to tick, or runs would not repeat. So the
limit is far above the run time of any correct plugin, and a plugin that exceeds it has failed. Time
in which this process waited for a processor, on a busy machine, does not count.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]
import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from navfw.process.process_resources import processor_wait

PERIOD = 0.25
"""Period [s] in which a timer checks the time spent in the present call."""

MAX_GAP = 1.0
"""Longest wall time [s] between two checks that counts: in a longer one the process, or the whole
machine, was stopped (Ctrl-Z, suspended)."""


class PluginTimeout(BaseException):
    """A plugin exceeded its time limit.

    Not an Exception, so that a plugin that catches all exceptions does not catch this one.
    """


class Watchdog:
    """Interrupts a plugin call at its time limit.

    Calls stand between ``begin`` and ``end``; they are interrupted inside the context ``on_duty``,
    where ``active`` is true. It works only in the main thread, on systems with interval timers, and
    only between two steps of the interpreter: a call that hangs in compiled code lasts until the
    run's wall-clock limit (``navfw.process.last_trace``).
    """

    def __init__(self) -> None:
        self._limit = math.inf
        self._spent = 0.0
        self._looked = 0.0
        self._waited = 0.0
        self.active = False

    def begin(self, limit: float) -> None:
        """Begin a call, which may take ``limit`` [s] of wall time, except to compile kernels."""
        self._spent, self._looked, self._limit = 0.0, time.monotonic(), limit

    def end(self) -> None:
        """End the present call: it has no limit any more."""
        self._limit = math.inf

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Context that raises PluginTimeout in a call that exceeds its limit.

        Inside, ``active`` is True. A timer that was set before goes on afterwards. Installing the
        timer takes about 40 us.
        """
        self.active, before = True, self.active
        try:
            in_main = threading.current_thread() is threading.main_thread()
            can = in_main and hasattr(signal, "SIGALRM")
            with self._alarm() if can and not before else nullcontext():
                yield
        finally:
            self.active = before

    @contextmanager
    def _alarm(self) -> Iterator[None]:
        """The interval timer and its handler."""
        self._waited = processor_wait()
        left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
        began = time.monotonic()
        # ``signal.signal`` looks handlers up in an enumeration, which takes ten times all else here
        handler = _signal.signal(signal.SIGALRM, self._ring)
        signal.siginterrupt(signal.SIGALRM, False)
        signal.setitimer(signal.ITIMER_REAL, PERIOD, PERIOD)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            _signal.signal(signal.SIGALRM, handler)
            if left:
                left = max(left - (time.monotonic() - began), 1e-3)
                signal.setitimer(signal.ITIMER_REAL, left, interval)

    def _ring(self, number: int, frame: object) -> None:
        del number, frame
        now = time.monotonic()
        gap, self._looked = now - self._looked, now
        before, self._waited = self._waited, processor_wait()
        if not compiling():
            self._spent += min(max(gap - (self._waited - before), 0.0), MAX_GAP)
        if self._spent > self._limit:
            raise PluginTimeout(f"no result within {self._limit:g} s")


def compiling() -> bool:
    """Whether a kernel is being compiled in this process; it does not import numba."""
    numba = sys.modules.get("numba.core.compiler_lock")
    if numba is None or numba.global_compiler_lock.is_locked():  # by this thread
        return numba is not None
    lock = numba.global_compiler_lock._lock
    if lock.acquire(blocking=False):
        lock.release()
        return False
    return True
