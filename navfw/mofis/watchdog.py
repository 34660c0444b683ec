"""Ends questions that are not answered: a behaviour that hangs must not stop the robot's decisions.

The clock on the wall cannot decide what the robot does from tick to tick, or runs would not repeat.
So the patience here is far beyond what any sound behaviour takes, a behaviour that exhausts it has
failed like one that raises, and it rests in simulated time before it is asked again.
"""

from __future__ import annotations

import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["BehaviorTimeout", "Watchdog", "time_limit"]

FIRST_PATIENCE = 60.0
"""Wall time [s] for the first answer of a run, which may have to compile kernels."""

PATIENCE = 10.0
"""Wall time [s] for every other answer: some ten thousand times what one usually takes."""

REST, LONGEST_REST = 0.5, 16.0
"""Simulated time [s] without questions after the first failure to answer, doubled each time."""


class BehaviorTimeout(BaseException):
    """A behaviour gave no answer in time.

    Not an Exception, so that a behaviour that swallows whatever it raises cannot swallow this.
    """


class Watchdog:
    """Watches the answers of behaviours by name, and lets those rest that gave none."""

    def __init__(self, patience: float = PATIENCE, first: float = FIRST_PATIENCE) -> None:
        self._patience = patience
        self._first = first
        self._arm: Callable[[float], object] = _unarmed
        self.reset()

    def reset(self) -> None:
        """A new run: everybody is asked."""
        self._answered: set[str] = set()
        self._rests: dict[str, tuple[float, float]] = {}

    def admits(self, name: str, time: float) -> bool:
        """Whether ``name`` is to be asked at simulated ``time`` [s]."""
        return name not in self._rests or time >= self._rests[name][0]

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """What is asked within this is given its limit in time; outside nobody is hurried."""
        with _alarm() as arm:
            self._arm = arm
            try:
                yield
            finally:
                self._arm = _unarmed

    @contextmanager
    def watching(self, name: str, time: float) -> Iterator[None]:
        """Ask within this; raises BehaviorTimeout when there is no answer in time."""
        try:
            self._arm(self._patience if name in self._answered else self._first)
            try:
                yield
            finally:
                self._arm(0.0)
        except BehaviorTimeout:
            rest = min(2.0 * self._rests[name][1], LONGEST_REST) if name in self._rests else REST
            self._rests[name] = (time + rest, rest)
            raise
        self._answered.add(name)


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise BehaviorTimeout in what is done within this, once it takes longer [s, wall].

    Only in the main thread of a system with interval timers (not Windows), and only between two
    steps of Python: one call that never returns from C cannot be ended. A timer that somebody else
    has set goes on afterwards.
    """
    with _alarm() as arm:
        arm(seconds)
        yield


@contextmanager
def _alarm() -> Iterator[Callable[[float], object]]:
    """What is given raises BehaviorTimeout so many seconds after its last call; 0 means never.

    One alarm serves many questions: to put up the handler costs more than most answers.
    """
    if not hasattr(signal, "setitimer") or (
        threading.current_thread() is not threading.main_thread()
    ):
        yield _unarmed
        return
    patience = 0.0

    def ring(number: int, frame: object) -> None:
        del number, frame
        raise BehaviorTimeout(f"no answer within {patience:g} s")

    def arm(seconds: float) -> None:
        nonlocal patience
        patience = seconds
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
    """No alarm is there to be set."""
    del seconds
