"""Emergency by quadrants: stop and turn where something is near ahead and no floor before it."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class EmergencyQuadrants(RuledBehavior):
    """Forbids driving on when alarmed, and turns on the spot to the freer side.

    A turning camera sees no depth, so the turn is made blindly to its end; then it looks again.
    """

    name: ClassVar[str] = "emergency_quadrants"

    class Params(RuledBehavior.Params):
        """How an alarm is answered."""

        threshold: Annotated[
            float, Field(gt=0.0, lt=1.0, description="alarm from which it takes over")
        ] = 0.5
        turn: Annotated[float, Field(gt=0.0, le=3.2, description="turn after an alarm [rad]")] = 1.0
        patience: Annotated[
            float, Field(gt=0.0, le=20.0, description="longest alarm in one go [s]")
        ] = 4.0
        fresh: Annotated[
            float, Field(gt=0.0, le=10.0, description="a percept older than this says nothing [s]")
        ] = 0.6
        again: Annotated[
            float, Field(ge=0.0, le=60.0, description="sooner than this it turns the same way [s]")
        ] = 8.0

    params: Params

    def reset(self) -> None:
        """No alarm."""
        self._target: float | None = None
        self._began = 0.0
        self._ended = -math.inf
        self._way = 1.0

    def propose(self, context: Context) -> Proposal:
        """Forbid all forward commands until the turn is made, otherwise nothing."""
        sight, commands = context.quadrant_distances, context.commands
        fresh = sight is not None and sight.age <= self.params.fresh
        verdict = self.rules.evaluate(
            ahead=sight.ahead if sight is not None and fresh else 1.0,
            floor=sight.floor if sight is not None and fresh else 1.0,
            stalled=context.stalled,
        )
        if self._target is None and verdict.degree("alarm") > self.params.threshold:
            self._begin(context)
        left = self._left(context)
        if left is None:
            nothing = commands.zeros()
            return Proposal(0.0, nothing, nothing, "nothing to fear", explain=verdict.explain)
        return Proposal(
            applicability=1.0,
            desirability=commands.on_the_spot(self._way * 0.8, width=0.4),
            prohibition=commands.forward(),
            reason=f"turning {'left' if self._way > 0.0 else 'right'} before what is near",
            explain=verdict.explain,
        )

    def _begin(self, context: Context) -> None:
        """Choose the side: as a moment ago, else the freer one, else the waypoint's."""
        if context.time - self._ended > self.params.again:
            sight = context.quadrant_distances
            freer = 0.0 if sight is None else sight.left - sight.right
            side = freer if abs(freer) > 0.1 else context.waypoint_bearing
            self._way = 1.0 if side >= 0.0 else -1.0
        self._began = context.time
        self._target = context.pose.yaw + self._way * self.params.turn

    def _left(self, context: Context) -> float | None:
        """The turn [rad] still to make; None without an alarm."""
        if self._target is None:
            return None
        left = context.turn_to(self._target)
        too_long = context.time - self._began > self.params.patience
        if left * self._way < 0.1 or too_long:
            self._target, self._ended = None, context.time
            return None
        return left
