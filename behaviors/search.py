"""Search: the composite behaviour of a robot with an uncertain position."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from navfw import Context, RuledComposite

MAX_TIME = 60.0
"""Longest duration of a search [s]."""


class Search(RuledComposite):
    """Travels while the position is certain; else looks around for landmarks, then explores.

    One turn on the spot, a stretch into unobserved space, another turn, and so on, until the belief
    is certain again. A search without success is suspended for a while: the robot travels on,
    unless it is lost.
    """

    name: ClassVar[str] = "search"

    class Params(RuledComposite.Params):
        """Thresholds and durations."""

        sigma: float = Field(
            0.6, gt=0.0, le=20.0, description="sigma of the position that is uncertain [m]"
        )
        stretch: float = Field(
            2.0, gt=0.0, le=50.0, description="distance explored between two turns [m]"
        )
        pause: float = Field(
            60.0, ge=0.0, le=3600.0, description="time until the next search after that [s]"
        )

    params: Params

    def reset(self) -> None:
        """End any search."""
        super().reset()
        self._since: float | None = None
        self._time = 0.0
        self._turned = self._driven = 0.0

    def inputs(self, context: Context) -> Mapping[str, float]:
        """Return the inputs of the rules: those of ``travel``, and the state of the search."""
        lost = context.belief.lost
        doubt = 2.0 if lost else context.belief.sigma / self.params.sigma
        searched = self._update(context, doubtful=doubt >= 1.0)
        return {
            "doubt": doubt,
            "looked": self._turned >= 2.0 * math.pi,
            # while lost there is no waypoint to travel to
            "searched": 0.0 if lost else searched / MAX_TIME,
            "idle": context.idle,
            "barred": context.barred,
            "corridor": context.ranges.corridor,
            "door": context.door_distance,
        }

    def _update(self, context: Context, *, doubtful: bool) -> float:
        """Update the turn and the distance driven; return the duration [s] of the search."""
        elapsed = context.time - self._time
        self._time = context.time
        if not doubtful:
            self._since = None
            self._turned = self._driven = 0.0
            return 0.0
        if self._since is None or context.time - self._since > MAX_TIME + (self.params.pause):
            self._since, elapsed = context.time, 0.0
            self._turned = self._driven = 0.0
        round_once = self._turned >= 2.0 * math.pi
        self._turned += 0.0 if round_once else abs(context.twist.w) * elapsed
        self._driven += abs(context.twist.v) * elapsed if round_once else 0.0
        if self._driven >= self.params.stretch:
            self._turned = self._driven = 0.0
        return context.time - self._since
