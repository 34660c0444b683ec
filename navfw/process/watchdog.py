"""The watchdog: a time limit for every call of a plugin.

Wall time must not decide what the robot does from tick to tick, or runs would not repeat. So the
limit is far above the run time of any correct plugin, and a plugin that exceeds it has failed.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from navfw.process.heartbeat import MAX_GAP, begin_call, end_call, postpone

PERIOD = 0.25
"""Period [s] in which the interval timer compares the time with the deadline."""


_COMPILE_LIMIT = 1800.0
"""Wall time [s] granted to the compilation of one kernel: on a busy machine some take a minute."""


class PluginTimeout(BaseException):
    """A plugin exceeded its time limit.

    Not an Exception, so that a plugin that catches all exceptions does not catch this one.
    """


class Watchdog:
    """Ends the plugin call in progress at its deadline, while it is ``active``.

    Works only in the main thread of a system with interval timers (not Windows), and only between
    two steps of the interpreter. What it cannot end, a supervising process ends
    (``navfw.process.heartbeat``).
    """

    def __init__(self) -> None:
        self._limit = math.inf
        self._deadline = math.inf
        self._compiled = 0.0
        self._rang = self._cpu = 0.0
        self.active = False

    def begin(self, call: str, limit: float) -> None:
        """Begin ``call``, which may take ``limit`` [s] of wall time besides compiling kernels."""
        self._limit = limit
        self._compiled = _compilation.total
        self._deadline = time.monotonic() + limit
        begin_call(call, self._deadline)

    def end(self) -> None:
        """End the call in progress."""
        self._deadline = math.inf
        end_call()

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Raise PluginTimeout inside this context in a call beyond its deadline.

        Inside, ``active`` is true. A timer that was set before goes on afterwards.
        """
        self.active, before = True, self.active
        try:
            with self._alarm() if not before and _can_alarm() else nullcontext():
                yield
        finally:
            self.active = before

    @contextmanager
    def _alarm(self) -> Iterator[None]:
        """The interval timer and its handler."""
        _listen_to_numba()
        left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
        began = time.monotonic()
        handler = signal.signal(signal.SIGALRM, self._ring)
        signal.siginterrupt(signal.SIGALRM, False)
        self._rang, self._cpu = began, time.process_time()
        signal.setitimer(signal.ITIMER_REAL, PERIOD, PERIOD)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, handler)
            if left:
                left = max(left - (time.monotonic() - began), 1e-3)
                signal.setitimer(signal.ITIMER_REAL, left, interval)

    def _ring(self, number: int, frame: object) -> None:
        del number, frame
        self._exclude_pause()
        compiled = _compilation.total - self._compiled
        if not _compilation.active and time.monotonic() > self._deadline + compiled:
            raise PluginTimeout(f"no result within {self._limit:g} s")

    def _exclude_pause(self) -> None:
        """Postpone the deadline by the time for which the process was stopped (Ctrl-Z).

        Compiled code delays the alarm as well, but it takes computing time.
        """
        now, cpu = time.monotonic(), time.process_time()
        pause = now - self._rang - max(cpu - self._cpu, MAX_GAP)
        if pause > 0.0:
            self._deadline += pause
            postpone(pause)
        self._rang, self._cpu = now, cpu


def _can_alarm() -> bool:
    in_main = threading.current_thread() is threading.main_thread()
    return in_main and hasattr(signal, "setitimer")


class _Compilation:
    """Numba's compilation of kernels: the ``total`` wall time [s], and whether it is ``active``."""

    def __init__(self) -> None:
        self.total = 0.0
        self.listening = False
        self._depth = 0
        self._began = 0.0

    @property
    def active(self) -> bool:
        return self._depth > 0

    def begin(self) -> None:
        """A compilation begins, perhaps within another one."""
        if self._depth == 0:
            self._began = time.monotonic()
            postpone(_COMPILE_LIMIT)
        self._depth += 1

    def end(self) -> None:
        """A compilation ends."""
        self._depth -= 1
        if self._depth == 0:
            spent = time.monotonic() - self._began
            self.total += spent
            postpone(spent - _COMPILE_LIMIT)


_compilation = _Compilation()


def compiling() -> bool:
    """Whether a kernel is being compiled while a watchdog is on duty in this process."""
    return _compilation.active


def _listen_to_numba() -> None:
    """Register for numba's events once it has been imported; it is not imported for that."""
    if "numba" not in sys.modules or _compilation.listening:
        return
    from numba.core.event import Event, Listener, register

    class CompilationListener(Listener):
        """Hands events over."""

        def on_start(self, event: Event) -> None:
            _compilation.begin()

        def on_end(self, event: Event) -> None:
            _compilation.end()

    register("numba:compile", CompilationListener())  # type: ignore[no-untyped-call]
    _compilation.listening = True
