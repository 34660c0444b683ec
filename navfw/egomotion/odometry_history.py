"""Odometry of the last seconds: a frame is processed later than it was taken."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import attrgetter

from navfw.signals import Odometry

#: Time [s] for which odometry is kept. An older frame is assigned the oldest entry.
MEMORY = 3.0


class OdometryHistory:
    """The odometry of the last ``MEMORY`` seconds, queried by time."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Delete all entries."""
        self._past: deque[Odometry] = deque()

    def add(self, odometry: Odometry) -> None:
        """Append the newest odometry and delete entries older than ``MEMORY``."""
        self._past.append(odometry)
        while odometry.time - self._past[0].time > MEMORY:
            self._past.popleft()

    def at(self, time: float) -> Odometry:
        """The newest odometry not later than ``time`` [s], or the oldest entry if all are later.

        Raises:
            IndexError: the history is empty.

        """
        index = bisect_right(self._past, time + 1e-9, key=attrgetter("time"))
        return self._past[max(index - 1, 0)]
