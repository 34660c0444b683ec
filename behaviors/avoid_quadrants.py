"""Avoid quadrants: obstacle avoidance from OFFIS' near, middle and far alone."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class AvoidQuadrants(RuledBehavior):
    """Turns away from the half of the image whose objects are nearer, slower the nearer they are.

    All it knows is the fuzzy distance of the nearest object in each quadrant, as in the paper.
    """

    name: ClassVar[str] = "avoid_quadrants"

    class Params(RuledBehavior.Params):
        """How much the quadrants count."""

        weight: Annotated[
            float, Field(gt=0.0, le=1.0, description="applicability beside a thing")
        ] = 0.9
        patience: Annotated[
            float, Field(gt=0.0, le=10.0, description="a percept older than this says nothing [s]")
        ] = 0.6
        goal_pull: Annotated[
            float,
            Field(ge=0.0, le=1.0, description="how much the waypoint's side counts beside a tie"),
        ] = 0.25

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turn, and forbid the speeds, that the rules give for the quadrants."""
        sight, commands = context.quadrant_distances, context.commands
        nothing = commands.zeros()
        if sight is None or sight.age > self.params.patience:
            return Proposal(0.0, nothing, nothing, "nothing seen just now")
        toward = math.sin(0.5 * context.waypoint_bearing)
        freer = sight.left - sight.right + self.params.goal_pull * toward
        verdict = self.rules.evaluate(
            left=sight.left, right=sight.right, ahead=sight.ahead, freer=min(1.0, max(-1.0, freer))
        )
        too_fast = commands.relative_v > verdict.value("limit")
        forbid = commands.zeros()
        forbid[too_fast & (commands.v > 0.0), :] = 0.4
        return Proposal(
            applicability=self.params.weight * verdict.degree("applicability"),
            desirability=verdict.command(commands),
            prohibition=forbid,
            reason=f"left {_word(sight.left)}, right {_word(sight.right)}, "
            f"ahead {_word(sight.ahead)}",
            explain=verdict.explain,
        )


def _word(distance: float) -> str:
    return ("near", "middle", "far")[min(2, int(3.0 * distance))]
