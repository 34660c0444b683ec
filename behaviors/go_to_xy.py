"""Go to XY: goal seeking; it follows the local goal toward PAPFIS' waypoint."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

SPEED = 0.15
"""Speed [m/s] of a manoeuvre."""
TURN = 0.6
"""Angle [rad] off the point of a manoeuvre from which the turn is as quick as it may be."""
MIN_TURN = 0.4
"""Least turn on the spot of a manoeuvre, in units of the top turning rate."""
GEARS = {1: "ahead", 0: "turning on the spot", -1: "backing"}


class GoToXY(RuledBehavior):
    """Turns toward the local goal, the next point on the cheapest path, and drives there."""

    name: ClassVar[str] = "go_to_xy"

    class Params(RuledBehavior.Params):
        """The weight."""

        weight: float = Field(0.8, gt=0.0, le=1.0, description="applicability")

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and the speed that the rules give for the local goal."""
        nothing = context.commands.zeros()
        if context.local_goal is None or context.waypoint is None:
            return Proposal(0.0, nothing, nothing, "no waypoint")
        goal = context.local_goal
        if goal.gear is not None:
            return self._manoeuvre(context, goal.gear, goal.x, goal.y)
        bearing = math.degrees(goal.bearing)
        remaining = context.waypoint_distance if context.waypoint.final else math.inf
        verdict = self.rules.evaluate(bearing=bearing, distance=min(remaining, 2.0))
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands, crisp_turn=True),
            prohibition=nothing,
            reason=f"{context.waypoint.label} is {context.waypoint_distance:.1f} m away, "
            f"local goal at {bearing:+.0f} deg",
            explain=verdict.explain,
        )

    def _manoeuvre(self, context: Context, gear: int, x: float, y: float) -> Proposal:
        """Desire the arc to the point (x, y) of a manoeuvre; the other gears are prohibited."""
        commands, bearing = context.commands, math.atan2(y, x)
        if gear == 0:
            turn = min(1.0, max(abs(bearing) / TURN, MIN_TURN))
            desire = commands.on_the_spot(math.copysign(turn, bearing))
        else:
            speed = gear * min(SPEED, commands.max_v, -float(commands.v[0]))
            turn = 2.0 * speed * y / max(x * x + y * y, 1e-4)
            desire = commands.around(speed / commands.max_v, turn / commands.max_w)
        return Proposal(
            applicability=1.0,
            desirability=desire,
            prohibition=np.repeat(1.0 * (np.sign(commands.v) != gear)[:, None], commands.w.size, 1),
            reason=f"{GEARS[gear]} to turn a long body, {context.waypoint_distance:.1f} m to go",
        )
