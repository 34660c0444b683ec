"""How closely to look out for movers: the search for them is the dearest part of the loop."""

from __future__ import annotations

import math
from collections.abc import Sequence

from navfw.signals import MovingObject

__all__ = ["DetectionSchedule"]

CALM = 2.0
"""When nothing has moved by itself for so long [s], all is calm."""
NEAR = 0.9
"""Movers nearer than this [m] are looked for over a shorter time."""


class DetectionSchedule:
    """Every frame is searched while something moves; while all is calm, every other at a glance.

    Who comes into view is then met with some frames later. ``closely`` it is never calm.
    """

    def __init__(self, closely: bool = False) -> None:
        self._closely = closely
        self.reset()

    def reset(self) -> None:
        """As if nothing had ever moved."""
        self._moved_at = -math.inf
        self._spared = False
        self._nearest = math.inf

    @property
    def near(self) -> bool:
        """Whether the last frame searched showed a mover that is near."""
        return self._nearest < NEAR

    def calm(self, now: float) -> bool:
        """Whether a glance at the frame of ``now`` [s] will do, unless it shows something."""
        return not self._closely and now - self._moved_at > CALM

    def searches(self, now: float) -> bool:
        """Whether to search the frame of ``now`` [s], the next one."""
        self._spared = self.calm(now) and not self._spared
        return not self._spared

    def saw(self, movers: Sequence[MovingObject], now: float) -> None:
        """Take note of the ``movers`` found in the frame of ``now`` [s]."""
        if movers:
            self._moved_at = now
        self._nearest = min((mover.distance for mover in movers), default=math.inf)
