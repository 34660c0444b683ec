"""Go to XY: goal seeking; it follows the local goal toward PAPFIS' waypoint."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class GoToXY(RuledBehavior):
    """Turns toward the local goal and drives there."""

    name: ClassVar[str] = "go_to_xy"

    class Params(RuledBehavior.Params):
        """The weight."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.8

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and the speed that the rules give for the local goal."""
        nothing = context.commands.zeros()
        if context.local_goal is None or context.waypoint is None:
            return Proposal(0.0, nothing, nothing, "no waypoint")
        bearing = math.degrees(context.local_goal.bearing)
        remaining = context.waypoint_distance if context.waypoint.final else math.inf
        verdict = self.rules.evaluate(bearing=bearing, distance=min(remaining, 2.0))
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands),
            prohibition=nothing,
            reason=f"{context.waypoint.label} is {context.waypoint_distance:.1f} m away, "
            f"local goal at {bearing:+.0f} deg",
            explain=verdict.explain,
        )
