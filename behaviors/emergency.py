"""Emergency: prohibit forward motion while contact is imminent or the wheels are blocked."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

HOLD = 0.6
"""Hold time [s]."""
MAX_TIME = 4.0
"""Longest duration of an alarm [s]."""


class Emergency(RuledBehavior):
    """Prohibits every forward command during an alarm, and reverses a little (METHOD 3.7).

    The alarm is held for a short time after its cause has gone (hysteresis).
    """

    name: ClassVar[str] = "emergency"

    class Params(RuledBehavior.Params):
        """The alarm, and the reaction to it."""

        threshold: float = Field(
            0.5, gt=0.0, lt=1.0, description="degree from which there is an alarm"
        )
        reverse: float = Field(0.12, ge=0.0, le=1.0, description="distance [m]")

    params: Params

    def reset(self) -> None:
        """End any alarm."""
        self._began: float | None = None
        self._until = -math.inf
        self._origin = (0.0, 0.0)

    def propose(self, context: Context) -> Proposal:
        """Prohibit all forward commands and desire to reverse in an alarm; otherwise nothing."""
        verdict = self.rules.evaluate(contact=self._contact(context), stalled=context.stalled)
        self._watch(context, verdict.degree("alarm") > self.params.threshold)
        commands = context.commands
        if self._began is None:
            nothing = commands.zeros()
            return Proposal(0.0, nothing, nothing, "no alarm", explain=verdict.explain)
        distance = math.hypot(context.pose.x - self._origin[0], context.pose.y - self._origin[1])
        backwards = commands.v < 0.0 if distance < self.params.reverse else commands.v == 0.0
        standing = 0.3 * (commands.v == 0.0)  # if reversing is not possible
        speed = np.maximum(backwards * 1.0, standing)
        return Proposal(
            applicability=1.0,
            desirability=commands.product(speed, commands.turning(0.0)),
            prohibition=commands.forward(),
            reason="the wheels are blocked" if context.stalled > 0.4 else "contact is imminent",
            explain=verdict.explain,
        )

    def _contact(self, context: Context) -> float:
        """Return the time to contact on the present course over the time needed to stop."""
        v = context.twist.v
        if v < 0.05:
            return 5.0
        free = float(context.arcs.free[context.commands.nearest(context.twist)])
        stopping = v / self.robot.max_brake + 0.15
        return min(5.0, free / v / stopping)

    def _watch(self, context: Context, alarmed: bool) -> None:
        """Begin, prolong or end the alarm."""
        if alarmed:
            if self._began is None:
                self._began = context.time
                self._origin = (context.pose.x, context.pose.y)
            self._until = context.time + HOLD
        if self._began is None:
            return
        too_long = context.time - self._began > MAX_TIME
        if context.time > self._until or too_long:
            self._began = None
