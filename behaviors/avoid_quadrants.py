"""Avoid quadrants: obstacle avoidance from OFFIS' near, middle and far alone."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class AvoidQuadrants(RuledBehavior):
    """Turns away from the half image with the nearer objects, and slows down with their distance.

    Its only input is the fuzzy distance of the nearest object in each quadrant, as in the paper.
    """

    name: ClassVar[str] = "avoid_quadrants"

    class Params(RuledBehavior.Params):
        """Weights, and the age limit of percepts."""

        weight: Annotated[
            float, Field(gt=0.0, le=1.0, description="applicability beside an obstacle")
        ] = 0.9
        max_age: Annotated[
            float, Field(gt=0.0, le=10.0, description="age from which a percept is void [s]")
        ] = 0.6
        goal_pull: Annotated[
            float,
            Field(ge=0.0, le=1.0, description="weight of the waypoint's side"),
        ] = 0.25

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and prohibit the speeds that the rules give for the quadrants."""
        distances, commands = context.quadrant_distances, context.commands
        nothing = commands.zeros()
        if distances is None or distances.age > self.params.max_age:
            return Proposal(0.0, nothing, nothing, "no recent percept")
        toward = math.sin(0.5 * context.waypoint_bearing)
        freer = distances.left - distances.right + self.params.goal_pull * toward
        verdict = self.rules.evaluate(
            left=distances.left,
            right=distances.right,
            ahead=distances.ahead,
            freer=min(1.0, max(-1.0, freer)),
        )
        too_fast = commands.relative_v > verdict.value("limit")
        prohibited = commands.zeros()
        prohibited[too_fast & (commands.v > 0.0), :] = 0.4
        return Proposal(
            applicability=self.params.weight * verdict.degree("applicability"),
            desirability=verdict.command(commands),
            prohibition=prohibited,
            reason=f"left {_word(distances.left)}, right {_word(distances.right)}, "
            f"ahead {_word(distances.ahead)}",
            explain=verdict.explain,
        )


def _word(distance: float) -> str:
    return ("near", "middle", "far")[min(2, int(3.0 * distance))]
