"""Follow wall: along an obstacle that bars the path to the waypoint."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class FollowWall(RuledBehavior):
    """Drives along the wall on the nearer side, at the distance that its rules set.

    It would follow any wall: the composite behaviour decides when it applies.
    """

    name: ClassVar[str] = "follow_wall"

    class Params(RuledBehavior.Params):
        """Weight and reach."""

        weight: float = Field(0.9, gt=0.0, le=1.0, description="applicability")

        reach: float = Field(1.2, gt=0.0, le=3.0, description="largest distance of a wall [m]")

    params: Params

    def reset(self) -> None:
        """Forget the side."""
        self._side: str | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire to turn toward or away from the wall, by the free distances beside and ahead."""
        ranges = context.ranges
        nothing = context.commands.zeros()
        if context.waypoint is None or min(ranges.left, ranges.right) > self.params.reach:
            self._side = None
            return Proposal(0.0, nothing, nothing, "no wall to follow")
        side = self._choose_side(context)
        distance = ranges.left if side == "left" else ranges.right
        verdict = self.rules.evaluate(distance=distance, ahead=ranges.front)
        away = context.commands.relative_w if side == "right" else -context.commands.relative_w
        desire = context.commands.product(
            verdict.over("speed", context.commands.relative_v), verdict.over("turn", away)
        )
        return Proposal(
            applicability=self.params.weight,
            desirability=desire,
            prohibition=nothing,
            reason=f"wall on the {side}, {distance:.2f} m away",
            explain=verdict.explain,
        )

    def _choose_side(self, context: Context) -> str:
        """Choose the nearer side; keep it without progress, as a change would drive in circles."""
        if self._side is None or context.idle < 1.0:
            self._side = "left" if context.ranges.left <= context.ranges.right else "right"
        return self._side
