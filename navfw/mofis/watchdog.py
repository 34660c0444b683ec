"""The watchdog: a time limit for every call of a behaviour.

Wall time must not decide what the robot does from tick to tick, or runs would not repeat. So the
limit is far above the run time of any correct behaviour. A behaviour that exceeds it has failed,
and is suspended for some simulated time before it is called again.
"""

from __future__ import annotations

import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["BehaviorTimeout", "Watchdog", "time_limit"]

FIRST_LIMIT = 60.0
"""Wall time limit of the first call in a run [s]: it may have to compile kernels."""

LIMIT = 10.0
"""Wall time limit of every other call [s]: some ten thousand times the usual run time."""

SUSPENSION, LONGEST_SUSPENSION = 0.5, 16.0
"""Simulated time [s] of the suspension after the first time-out, doubled each time, and its
bound."""


class BehaviorTimeout(BaseException):
    """A behaviour exceeded its time limit.

    Not an Exception, so that a behaviour that catches all exceptions does not catch this one.
    """


class Watchdog:
    """Limits the time of calls by the behaviour's name, and suspends behaviours that exceed it."""

    def __init__(self, limit: float = LIMIT, first_limit: float = FIRST_LIMIT) -> None:
        self._limit = limit
        self._first_limit = first_limit
        self._arm: Callable[[float], object] = _unarmed
        self.reset()

    def reset(self) -> None:
        """Back to the start of a run: nothing is suspended."""
        self._called: set[str] = set()
        self._suspended: dict[str, tuple[float, float]] = {}

    def admits(self, name: str, time: float) -> bool:
        """Whether ``name`` may be called at simulated ``time`` [s]."""
        return name not in self._suspended or time >= self._suspended[name][0]

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Within this context ``watching`` limits the time of calls."""
        with _alarm() as arm:
            self._arm = arm
            try:
                yield
            finally:
                self._arm = _unarmed

    @contextmanager
    def watching(self, name: str, time: float) -> Iterator[None]:
        """Limit the time of a call within this context.

        Raises:
            BehaviorTimeout: the call exceeded the limit; ``name`` is then suspended.

        """
        try:
            self._arm(self._limit if name in self._called else self._first_limit)
            try:
                yield
            finally:
                self._arm(0.0)
        except BehaviorTimeout:
            duration = SUSPENSION
            if name in self._suspended:
                duration = min(2.0 * self._suspended[name][1], LONGEST_SUSPENSION)
            self._suspended[name] = (time + duration, duration)
            raise
        self._called.add(name)


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise BehaviorTimeout in what is done within this, once it takes longer [s, wall].

    Works only in the main thread of a system with interval timers (not Windows), and only between
    two steps of the interpreter: a call of compiled code that does not return cannot be ended. A
    timer that was set before goes on afterwards.
    """
    with _alarm() as arm:
        arm(seconds)
        yield


@contextmanager
def _alarm() -> Iterator[Callable[[float], object]]:
    """A function that arms the alarm: BehaviorTimeout after that many seconds; 0 disarms it.

    One handler serves many calls: installing it costs more than most calls take.
    """
    if not hasattr(signal, "setitimer") or (
        threading.current_thread() is not threading.main_thread()
    ):
        yield _unarmed
        return
    limit = 0.0

    def ring(number: int, frame: object) -> None:
        del number, frame
        raise BehaviorTimeout(f"no result within {limit:g} s")

    def arm(seconds: float) -> None:
        nonlocal limit
        limit = seconds
        signal.setitimer(signal.ITIMER_REAL, seconds)

    left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
    begun = clock.monotonic()
    handler = signal.signal(signal.SIGALRM, ring)
    try:
        yield arm
    finally:
        arm(0.0)
        signal.signal(signal.SIGALRM, handler)
        if left:
            left = max(left - (clock.monotonic() - begun), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, left, interval)


def _unarmed(seconds: float) -> None:
    """There is no alarm to arm."""
    del seconds
