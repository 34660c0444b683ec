"""Cruise: a steady speed, lower beside obstacles and at doors."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class Cruise(RuledBehavior):
    """Desires a steady speed at any turning rate, less beside obstacles and at doors."""

    name: ClassVar[str] = "cruise"

    class Params(RuledBehavior.Params):
        """The weight."""

        weight: float = Field(0.5, gt=0.0, le=1.0, description="applicability")

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the speed that the rules give for the surroundings."""
        commands = context.commands
        nothing = commands.zeros()
        if context.waypoint is None:
            return Proposal(0.0, nothing, nothing, "no waypoint")
        nearest = context.ranges.nearest(-1.2, 1.2)
        verdict = self.rules.evaluate(nearest=nearest, door=context.door_distance)
        speed = verdict.over("speed", commands.relative_v)
        return Proposal(
            applicability=self.params.weight,
            desirability=commands.product(speed, np.ones(commands.w.size)),
            prohibition=nothing,
            reason=f"nearest obstacle ahead or beside at {nearest:.2f} m",
            explain=verdict.explain,
        )
