"""Follow wall: along what bars the way, when heading straight for the waypoint leads nowhere."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class FollowWall(RuledBehavior):
    """Keeps the nearer wall at its side.

    Whether that helps, the composite behaviour must say: on its own it would follow any wall.
    """

    name: ClassVar[str] = "follow_wall"

    class Params(RuledBehavior.Params):
        """When a wall is worth following."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.9

        reach: Annotated[
            float, Field(gt=0.0, le=3.0, description="farthest wall that is followed [m]")
        ] = 1.2

    params: Params

    def reset(self) -> None:
        """Choose the side anew."""
        self._side: str | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire to turn toward or away from the wall, by its gap and the room ahead."""
        ranges = context.ranges
        nothing = context.commands.zeros()
        if context.waypoint is None or min(ranges.left, ranges.right) > self.params.reach:
            self._side = None
            return Proposal(0.0, nothing, nothing, "no wall to follow")
        side = self._choose_side(context)
        gap = ranges.left if side == "left" else ranges.right
        verdict = self.rules.evaluate(gap=gap, ahead=ranges.front)
        away = context.commands.relative_w if side == "right" else -context.commands.relative_w
        desire = context.commands.product(
            verdict.over("speed", context.commands.relative_v), verdict.over("turn", away)
        )
        return Proposal(
            applicability=self.params.weight,
            desirability=desire,
            prohibition=nothing,
            reason=f"wall on the {side}, {gap:.2f} m off",
            explain=verdict.explain,
        )

    def _choose_side(self, context: Context) -> str:
        """The nearer side at first, then the same one: changing sides goes round in circles."""
        if self._side is None or context.idle < 1.0:
            self._side = "left" if context.ranges.left <= context.ranges.right else "right"
        return self._side
