"""Emergency: forbid driving forward while contact is imminent or the wheels are held."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class Emergency(RuledBehavior):
    """Inhibits every forward command when alarmed, and backs away a little (METHOD 3.7).

    The alarm holds for a moment after its cause has gone, so that it does not flicker.
    """

    name: ClassVar[str] = "emergency"

    class Params(RuledBehavior.Params):
        """How an alarm is answered."""

        threshold: Annotated[
            float, Field(gt=0.0, lt=1.0, description="alarm from which it takes over")
        ] = 0.5
        hold: Annotated[float, Field(ge=0.0, le=10.0, description="an alarm lasts [s]")] = 0.6
        backing: Annotated[float, Field(ge=0.0, le=1.0, description="way to back away [m]")] = 0.12
        patience: Annotated[
            float, Field(gt=0.0, le=20.0, description="longest alarm in one go [s]")
        ] = 4.0

    params: Params

    def reset(self) -> None:
        """No alarm."""
        self._began: float | None = None
        self._until = -math.inf
        self._origin = (0.0, 0.0)

    def propose(self, context: Context) -> Proposal:
        """Forbid all forward commands while the alarm lasts, otherwise nothing."""
        verdict = self.rules.evaluate(contact=self._contact(context), stalled=context.stalled)
        self._watch(context, verdict.degree("alarm") > self.params.threshold)
        commands = context.commands
        if self._began is None:
            nothing = commands.zeros()
            return Proposal(0.0, nothing, nothing, "nothing to fear", explain=verdict.explain)
        way = math.hypot(context.pose.x - self._origin[0], context.pose.y - self._origin[1])
        backwards = commands.v < 0.0 if way < self.params.backing else commands.v == 0.0
        standing = 0.3 * (commands.v == 0.0)  # when there is no known way back
        speed = np.maximum(backwards * 1.0, standing)
        return Proposal(
            applicability=1.0,
            desirability=commands.product(speed, commands.turning(0.0)),
            prohibition=commands.forward(),
            reason="the wheels are held" if context.stalled > 0.4 else "contact is imminent",
            explain=verdict.explain,
        )

    def _contact(self, context: Context) -> float:
        """Time until contact on the present course over the time needed to stop."""
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
            self._until = context.time + self.params.hold
        if self._began is None:
            return
        too_long = context.time - self._began > self.params.patience
        if context.time > self._until or too_long:
            self._began = None
