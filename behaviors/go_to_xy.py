"""Go to XY: the goal-seeking behaviour; it follows the aim toward PAPFIS' waypoint."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class GoToXY(RuledBehavior):
    """Turns toward the next point on the way to the waypoint and drives there."""

    name: ClassVar[str] = "go_to_xy"

    class Params(RuledBehavior.Params):
        """How strongly the goal counts."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.8

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and the speed that the rules give for the aim."""
        nothing = context.commands.zeros()
        if context.local_goal is None or context.waypoint is None:
            return Proposal(0.0, nothing, nothing, "nowhere to go")
        bearing = math.degrees(context.local_goal.bearing)
        left = context.waypoint_distance if context.waypoint.final else math.inf
        verdict = self.rules.evaluate(bearing=bearing, distance=min(left, 2.0))
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands),
            prohibition=nothing,
            reason=f"{context.waypoint.label} is {context.waypoint_distance:.1f} m away, "
            f"aim {bearing:+.0f} deg",
            explain=verdict.explain,
        )
