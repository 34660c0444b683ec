"""Where the robot was a moment ago: frames come late, and belong where they were taken."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import attrgetter

from navfw.signals import Odometry

__all__ = ["OdometryHistory"]

#: Frames older than this [s] have no place any more.
MEMORY = 3.0


class OdometryHistory:
    """The odometry of the last few seconds."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._past: deque[Odometry] = deque()

    def add(self, odometry: Odometry) -> None:
        """Keep the newest."""
        self._past.append(odometry)
        while odometry.time - self._past[0].time > MEMORY:
            self._past.popleft()

    def at(self, time: float) -> Odometry:
        """The last odometry not later than ``time`` [s], or the oldest that is remembered.

        Raises:
            IndexError: nothing is remembered.

        """
        index = bisect_right(self._past, time + 1e-9, key=attrgetter("time"))
        return self._past[max(index - 1, 0)]
