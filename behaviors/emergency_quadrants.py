"""Emergency by quadrants: stop and turn at a near object ahead without floor in front."""

from __future__ import annotations

import math
from typing import ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

MAX_TIME = 4.0
"""Longest duration of an alarm [s]."""
MAX_AGE = 0.6
"""Age from which a percept is void [s]."""
REPEAT_TIME = 8.0
"""Time for which the side of a turn is kept [s]."""


class EmergencyQuadrants(RuledBehavior):
    """Prohibits forward commands during an alarm, and turns on the spot to the freer side.

    A turning camera has no depth, so the turn is completed before the next percept counts.
    """

    name: ClassVar[str] = "emergency_quadrants"

    class Params(RuledBehavior.Params):
        """The alarm, and the turn."""

        threshold: float = Field(
            0.5, gt=0.0, lt=1.0, description="degree from which there is an alarm"
        )
        turn: float = Field(1.0, gt=0.0, le=3.2, description="turn after an alarm [rad]")

    params: Params

    def reset(self) -> None:
        """End any alarm."""
        self._target: float | None = None
        self._began = 0.0
        self._ended = -math.inf
        self._way = 1.0

    def propose(self, context: Context) -> Proposal:
        """Prohibit all forward commands until the turn is complete; otherwise nothing."""
        distances, commands = context.quadrant_distances, context.commands
        fresh = distances is not None and distances.age <= MAX_AGE
        verdict = self.rules.evaluate(
            ahead=distances.ahead if distances is not None and fresh else 1.0,
            floor=distances.floor if distances is not None and fresh else 1.0,
            stalled=context.stalled,
        )
        if self._target is None and verdict.degree("alarm") > self.params.threshold:
            self._begin(context)
        left = self._left(context)
        if left is None:
            nothing = commands.zeros()
            return Proposal(0.0, nothing, nothing, "no alarm", explain=verdict.explain)
        return Proposal(
            applicability=1.0,
            desirability=commands.on_the_spot(self._way * 0.8, width=0.4),
            prohibition=commands.forward(),
            reason=f"turning {'left' if self._way > 0.0 else 'right'} away from a near object",
            explain=verdict.explain,
        )

    def _begin(self, context: Context) -> None:
        """Choose the side: that of a recent turn, else the freer one, else the waypoint's."""
        if context.time - self._ended > REPEAT_TIME:
            distances = context.quadrant_distances
            freer = 0.0 if distances is None else distances.left - distances.right
            side = freer if abs(freer) > 0.1 else context.waypoint_bearing
            self._way = 1.0 if side >= 0.0 else -1.0
        self._began = context.time
        self._target = context.pose.yaw + self._way * self.params.turn

    def _left(self, context: Context) -> float | None:
        """Return the remaining turn [rad]; None without an alarm."""
        if self._target is None:
            return None
        left = context.turn_to(self._target)
        too_long = context.time - self._began > MAX_TIME
        if left * self._way < 0.1 or too_long:
            self._target, self._ended = None, context.time
            return None
        return left
