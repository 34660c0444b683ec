"""Peek: creep and weave where the path ahead is unobserved (METHOD 2.10, 2.12)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

WEAVE = 0.12
"""Amplitude, share of the top turning rate."""


class Peek(RuledBehavior):
    """Creeps toward an unobserved local goal with a slight weave: depth needs a moving camera."""

    name: ClassVar[str] = "peek"

    class Params(RuledBehavior.Params):
        """Weight and weave."""

        weight: float = Field(0.5, gt=0.0, le=1.0, description="applicability")
        period: float = Field(1.6, gt=0.2, le=10.0, description="period [s]")

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire to creep if the next stretch toward the local goal is unobserved."""
        goal, ranges = context.local_goal, context.ranges
        nothing = context.commands.zeros()
        if goal is None:
            return Proposal(0.0, nothing, nothing, "no waypoint")
        toward = int(np.cos(ranges.bearings - goal.bearing).argmax())
        ahead = context.arcs.observed[context.commands.v > 0.0]
        observed = min(float(ranges.observed[toward]), float(ahead.max(initial=0.0)))
        verdict = self.rules.evaluate(
            observed=min(observed, 2.0), bearing=math.degrees(goal.bearing)
        )
        applicability = self.params.weight * verdict.degree("applicability")
        reason = f"{observed:.2f} m observed toward the local goal"
        if applicability == 0.0:
            return Proposal(0.0, nothing, nothing, reason, verdict.explain)
        weave = WEAVE * math.sin(2.0 * math.pi * context.time / self.params.period)
        turn = verdict.over("turn", context.commands.relative_w - weave)
        speed = verdict.over("speed", context.commands.relative_v)
        return Proposal(
            applicability=applicability,
            desirability=context.commands.product(speed, turn),
            prohibition=nothing,
            reason=reason,
            explain=verdict.explain,
        )
