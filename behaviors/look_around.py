"""Look around: turn on the spot, so that the camera covers all directions."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from navfw import Behavior, Context, Proposal


class LookAround(Behavior):
    """Turns on the spot without end: the composite behaviour decides when, and for how long."""

    name: ClassVar[str] = "look_around"

    class Params(Behavior.Params):
        """Weight and rate."""

        weight: float = Field(0.9, gt=0.0, le=1.0, description="applicability")
        rate: float = Field(0.5, gt=0.0, le=1.0, description="share of the top turning rate")

    params: Params

    def reset(self) -> None:
        """Forget the direction of the turn."""
        self._way: float | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire to turn on the spot, first toward the waypoint's side."""
        commands = context.commands
        if self._way is None:
            self._way = 1.0 if context.waypoint_bearing >= 0.0 else -1.0
        return Proposal(
            applicability=self.params.weight,
            desirability=commands.on_the_spot(self._way * self.params.rate),
            prohibition=commands.zeros(),
            reason=f"looking around to the {'left' if self._way > 0.0 else 'right'}",
        )
