"""Avoid: obstacle avoidance; it judges every command by what lies along its arc."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class Avoid(RuledBehavior):
    """Forbids commands without room to stop, dislikes those that pass close or go blind."""

    name: ClassVar[str] = "avoid"

    class Params(RuledBehavior.Params):
        """What counts as room to stop."""

        latency: Annotated[
            float, Field(ge=0.0, le=2.0, description="from seeing to braking [s]")
        ] = 0.3
        braking: Annotated[
            float, Field(gt=0.0, le=5.0, description="deceleration counted on [m/s^2]")
        ] = 0.8
        spare: Annotated[
            float, Field(ge=0.0, le=1.0, description="free length wanted at any speed [m]")
        ] = 0.06
        weight: Annotated[
            float, Field(gt=0.0, le=1.0, description="applicability beside a thing")
        ] = 0.6

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Prohibit and desire by the reserve, insight and clearance of every arc."""
        p, commands, arcs = self.params, context.commands, context.arcs
        v = np.abs(commands.v)
        needed = v**2 / (2.0 * p.braking) + v * p.latency + p.spare
        needed[v == 0.0] = 1e-3  # turning on the spot needs no room
        verdict = self.rules.evaluate_all(
            reserve=arcs.free / needed[:, None],
            insight=arcs.observed / needed[:, None],
            pace=commands.product(v, np.ones_like(commands.w)),
            clearance=arcs.clearance,
        )
        nearest = float(context.ranges.free.min())
        return Proposal(
            applicability=p.weight * min(1.0, max(0.25, 1.5 - nearest / 0.6)),
            desirability=verdict.values("desire"),
            prohibition=verdict.values("forbid"),
            reason=f"nearest thing {nearest:.2f} m off",
            explain=verdict.explain,
        )
