"""The watchdog: a time limit for every call of a plugin.

Wall time must not decide what the robot does from tick to tick, or runs would not repeat. So the
limit is far above the run time of any correct plugin, and a plugin that exceeds it has failed.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from navfw.guard.heartbeat import begin_call, end_call

__all__ = ["PluginTimeout", "Watchdog"]

PERIOD = 0.25
"""Period [s] in which the interval timer compares the time with the deadline."""


class PluginTimeout(BaseException):
    """A plugin exceeded its time limit.

    Not an Exception, so that a plugin that catches all exceptions does not catch this one.
    """


class Watchdog:
    """Ends the plugin call in progress at its deadline.

    Works only in the main thread of a system with interval timers (not Windows), and only between
    two steps of the interpreter. What it cannot end, a supervising process ends (``heartbeat``).
    """

    def __init__(self) -> None:
        self._limit = math.inf
        self._deadline = math.inf

    def begin(self, call: str, limit: float) -> None:
        """Begin ``call``, which may take ``limit`` [s] of wall time."""
        self._limit = limit
        self._deadline = time.monotonic() + limit
        begin_call(call, self._deadline)

    def end(self) -> None:
        """End the call in progress."""
        self._deadline = math.inf
        end_call()

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Raise PluginTimeout inside this context in a call beyond its deadline.

        A timer that was set before goes on afterwards.
        """
        if not hasattr(signal, "setitimer") or (
            threading.current_thread() is not threading.main_thread()
        ):
            yield
            return
        left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
        began = time.monotonic()
        handler = signal.signal(signal.SIGALRM, self._ring)
        signal.siginterrupt(signal.SIGALRM, False)
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
        if time.monotonic() > self._deadline:
            raise PluginTimeout(f"no result within {self._limit:g} s")
