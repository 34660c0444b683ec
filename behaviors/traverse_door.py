"""Traverse door: through the middle of the gap, straight."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class TraverseDoor(RuledBehavior):
    """Steers for the way through a door at hand and slows down where it is narrow."""

    name: ClassVar[str] = "traverse_door"

    class Params(RuledBehavior.Params):
        """When a door is at hand."""

        near: Annotated[
            float, Field(gt=0.0, le=5.0, description="distance of the door from which [m]")
        ] = 1.2
        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.5

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire to turn toward the gap, and to drive when it is ahead."""
        waypoint, aim = context.waypoint, context.local_goal
        nothing = context.commands.zeros()
        if waypoint is None or aim is None or waypoint.kind != "door":
            return Proposal(0.0, nothing, nothing, "no door to go through")
        if context.waypoint_distance > self.params.near or not aim.reachable:
            return Proposal(0.0, nothing, nothing, f"{waypoint.label} is not at hand")
        spare = min(waypoint.width - 2.0 * self.robot.radius, 1.0)
        # the aim follows the gap as it is seen, the waypoint as the map and odometry have it
        verdict = self.rules.evaluate(bearing=math.degrees(aim.bearing), spare=max(spare, 0.0))
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands),
            prohibition=nothing,
            reason=f"through {waypoint.label}, {waypoint.width:.2f} m wide",
            explain=verdict.explain,
        )
