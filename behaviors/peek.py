"""Peek: a small safe motion to see, before going where nothing is known (METHOD 2.10, 2.12)."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class Peek(RuledBehavior):
    """Creeps toward an unseen aim with a slight weave: only a moving camera sees depth."""

    name: ClassVar[str] = "peek"

    class Params(RuledBehavior.Params):
        """How it looks."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.5
        weave: Annotated[
            float, Field(ge=0.0, le=1.0, description="share of the top turning rate")
        ] = 0.12
        period: Annotated[float, Field(gt=0.2, le=10.0, description="of the weave [s]")] = 1.6

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire to creep where the next stretch toward the aim has not been seen."""
        aim, ranges = context.local_goal, context.ranges
        nothing = context.commands.zeros()
        if aim is None:
            return Proposal(0.0, nothing, nothing, "nowhere to look")
        toward = int(np.cos(ranges.bearings - aim.bearing).argmax())
        seen = float(ranges.observed[toward])
        verdict = self.rules.evaluate(seen=min(seen, 2.0), bearing=math.degrees(aim.bearing))
        applicability = self.params.weight * verdict.degree("applicability")
        reason = f"seen {seen:.2f} m toward the aim"
        if applicability == 0.0:
            return Proposal(0.0, nothing, nothing, reason, verdict.explain)
        weave = self.params.weave * math.sin(2.0 * math.pi * context.time / self.params.period)
        turn = verdict.over("turn", context.commands.relative_w - weave)
        speed = verdict.over("speed", context.commands.relative_v)
        return Proposal(
            applicability=applicability,
            desirability=context.commands.product(speed, turn),
            prohibition=nothing,
            reason=reason,
            explain=verdict.explain,
        )
