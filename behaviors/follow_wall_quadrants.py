"""Follow wall by quadrants: along what stands beside the robot, from near, middle and far alone."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class FollowWallQuadrants(RuledBehavior):
    """Keeps the nearer half of the image between near and middle, without any memory.

    Whether that helps, the composite behaviour must say: on its own it would follow any wall.
    """

    name: ClassVar[str] = "follow_wall_quadrants"

    class Params(RuledBehavior.Params):
        """When there is a wall to follow."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.9
        patience: Annotated[
            float, Field(gt=0.0, le=10.0, description="a percept older than this says nothing [s]")
        ] = 0.6

    params: Params

    def reset(self) -> None:
        """Choose the side anew."""
        self._side: str | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire to turn toward or away from the wall, by the fuzzy distances beside and ahead."""
        sight, commands = context.quadrant_distances, context.commands
        nothing = commands.zeros()
        if context.waypoint is None or sight is None or sight.age > self.params.patience:
            return Proposal(0.0, nothing, nothing, "no wall to follow")
        if self._side is None or context.idle < 1.0:
            self._side = "left" if sight.left <= sight.right else "right"
        beside = sight.left if self._side == "left" else sight.right
        verdict = self.rules.evaluate(beside=beside, ahead=sight.ahead)
        away = commands.relative_w if self._side == "right" else -commands.relative_w
        desire = commands.product(
            verdict.over("speed", commands.relative_v), verdict.over("turn", away)
        )
        return Proposal(
            applicability=self.params.weight,
            desirability=desire,
            prohibition=nothing,
            reason=f"wall on the {self._side}",
            explain=verdict.explain,
        )
