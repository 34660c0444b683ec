"""Traverse door: straight through the middle of the opening."""

from __future__ import annotations

import math
from typing import ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class TraverseDoor(RuledBehavior):
    """Steers through a near door, and slows down if it is narrow."""

    name: ClassVar[str] = "traverse_door"

    class Params(RuledBehavior.Params):
        """Distance and weight."""

        near: float = Field(1.2, gt=0.0, le=5.0, description="largest distance of the door [m]")
        weight: float = Field(0.5, gt=0.0, le=1.0, description="applicability")

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire to turn toward the local goal in the opening, and to drive when it is ahead."""
        waypoint, goal = context.waypoint, context.local_goal
        nothing = context.commands.zeros()
        if waypoint is None or goal is None or waypoint.kind != "door":
            return Proposal(0.0, nothing, nothing, "no door to go through")
        if context.waypoint_distance > self.params.near or not goal.reachable:
            return Proposal(0.0, nothing, nothing, f"{waypoint.label} is not near")
        spare = min(waypoint.width - 2.0 * self.robot.radius, 1.0)
        # the local goal follows the observed opening, the waypoint the map and odometry
        verdict = self.rules.evaluate(bearing=math.degrees(goal.bearing), spare=max(spare, 0.0))
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands),
            prohibition=nothing,
            reason=f"through {waypoint.label}, {waypoint.width:.2f} m wide",
            explain=verdict.explain,
        )
