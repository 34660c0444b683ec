"""The watchdog: a time limit for every call of a plugin, and the heartbeat that shows it.

Wall time must not decide what the robot does from tick to tick, or runs would not repeat. So the
limit is far above the run time of any correct plugin, and a plugin that exceeds it has failed.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]
import ctypes
import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

GRACE = 5.0
"""Wall time [s] beyond a call's deadline after which the supervisor ends the process: the interval
timer ends a call of Python code within a fraction of it."""

MAX_GAP = 1.0
"""Longest wall time [s] between two looks that counts: in a longer one the process, or the whole
machine, was stopped (Ctrl-Z, suspended), and so were the plugins."""


class _Heartbeat(ctypes.Structure):
    """The shared memory.

    ``deadline`` [s, monotonic] is infinite between two calls. It is written in one piece, so that
    no half of it is read. ``call`` is the one in progress, or the last.
    """

    _fields_ = (("deadline", ctypes.c_double), ("call", ctypes.c_char * 120))
    deadline: float
    call: bytes


HEARTBEAT_SIZE = ctypes.sizeof(_Heartbeat)
"""Size of the shared memory [byte]."""

_own: _Heartbeat | None = None


def set_memory(memory: Any) -> None:
    """Write the calls of this process to ``memory``, a shared writable buffer; None: nowhere."""
    global _own  # noqa: PLW0603 - one supervisor watches one process
    _own = None if memory is None else _Heartbeat.from_buffer(memory)
    end_call()


def begin_call(call: str, deadline: float) -> None:
    """Tell the supervisor that ``call`` is in progress until ``deadline`` [s, monotonic]."""
    if _own is not None:
        _own.call = call.encode()[:120]
        _own.deadline = deadline


def postpone(seconds: float) -> None:
    """Move the deadline of the call in progress by ``seconds``; between two calls, nothing."""
    if _own is not None:
        _own.deadline += seconds


def end_call() -> None:
    """Tell the supervisor that no call is in progress; the last one stays readable."""
    if _own is not None:
        _own.deadline = math.inf


class HeartbeatMonitor:
    """The supervisor's side: whether the process that writes to ``memory`` is to be ended."""

    def __init__(self, memory: Any) -> None:
        self._read = _Heartbeat.from_buffer(memory)
        self._looked = math.inf
        self._overdue = 0.0

    @property
    def last_call(self) -> str:
        """The call in progress, or the last one."""
        return self._read.call.decode(errors="replace")

    @property
    def plugin(self) -> str:
        """Kind and name of the plugin that is being called; "" between two calls."""
        return self.last_call if self._read.deadline < math.inf else ""

    def overdue(self, now: float) -> bool:
        """Whether the process is to be ended at ``now`` [s, monotonic]; to be asked every 0.2 s.

        The call must have been beyond its deadline for GRACE seconds of the supervisor's own looks:
        after a pause of both processes the deadline lies in the past without any call being late.
        """
        if now <= self._read.deadline:
            self._overdue = 0.0
        else:
            self._overdue += min(max(now - self._looked, 0.0), MAX_GAP)
        self._looked = now
        return self._overdue > GRACE


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

    Works only in the main thread, and only between two steps of the interpreter. What it cannot
    end, a supervising process ends (``HeartbeatMonitor``).
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

    def end(self) -> bool:
        """End the call in progress; whether it was beyond its deadline."""
        late = time.monotonic() > self._deadline
        self._deadline = math.inf
        end_call()
        return late

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Raise PluginTimeout inside this context in a call beyond its deadline.

        Inside, ``active`` is true. A timer that was set before goes on afterwards. Installing the
        timer takes some 20 us.
        """
        self.active, before = True, self.active
        try:
            in_main = threading.current_thread() is threading.main_thread()
            with self._alarm() if in_main and not before else nullcontext():
                yield
        finally:
            self.active = before

    @contextmanager
    def _alarm(self) -> Iterator[None]:
        """The interval timer and its handler."""
        _listen_to_numba()
        left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
        began = time.monotonic()
        # ``signal.signal`` looks handlers up in an enumeration, which takes ten times all else here
        handler = _signal.signal(signal.SIGALRM, self._ring)
        signal.siginterrupt(signal.SIGALRM, False)
        self._rang, self._cpu = began, time.process_time()
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
