"""Follow wall by quadrants: along a wall, from near, middle and far only."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

MAX_AGE = 0.6
"""Age from which a percept is void [s]."""
SEARCH_TURN = 1.2
"""Largest turn toward a lost wall [rad]."""

FAR = 0.45
"""Fuzzy distance from which no wall is in view beside the robot; unknown is 0.5."""


class FollowWallQuadrants(RuledBehavior):
    """Drives along the wall on the nearer side, between near and middle distance, without a map.

    It would follow any wall: the composite behaviour decides when it applies. Toward a wall that
    has left the view it turns a bit, and no farther: it would go round and round.
    """

    name: ClassVar[str] = "follow_wall_quadrants"

    class Params(RuledBehavior.Params):
        """Weight, and the age limit of percepts."""

        weight: float = Field(0.9, gt=0.0, le=1.0, description="applicability")

    params: Params

    def reset(self) -> None:
        """Forget the side."""
        self._side: str | None = None
        self._turned = 0.0
        self._yaw: float | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire to turn toward or away from the wall, by the fuzzy distances beside and ahead."""
        distances, commands = context.quadrant_distances, context.commands
        nothing = commands.zeros()
        if context.waypoint is None or distances is None or distances.age > MAX_AGE:
            return Proposal(0.0, nothing, nothing, "no wall to follow")
        if self._side is None or context.idle < 1.0:
            self._side = "left" if distances.left <= distances.right else "right"
        beside = distances.left if self._side == "left" else distances.right
        if self._lost(context, beside):
            return Proposal(0.0, nothing, nothing, "the wall has left the view")
        verdict = self.rules.evaluate(beside=beside, ahead=distances.ahead)
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

    def _lost(self, context: Context, beside: float) -> bool:
        """Return whether the robot has turned too far since the wall was in view."""
        before = context.pose.yaw if self._yaw is None else self._yaw
        self._yaw = context.pose.yaw
        self._turned = 0.0 if beside < FAR else self._turned - context.turn_to(before)
        toward = self._turned if self._side == "left" else -self._turned
        return toward > SEARCH_TURN
