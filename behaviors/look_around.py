"""Look around: turn on the spot, so that the camera sees what is to be seen from here."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Behavior, Context, Proposal


class LookAround(Behavior):
    """Turns on and on.

    When, and for how long, the composite behaviour must say: on its own it would never stop.
    """

    name: ClassVar[str] = "look_around"

    class Params(Behavior.Params):
        """How it turns."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.9
        rate: Annotated[
            float, Field(gt=0.0, le=1.0, description="share of the top turning rate")
        ] = 0.5

    params: Params

    def reset(self) -> None:
        """Choose the way round anew."""
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
