"""Emergency by quadrants: stop and turn at a near object ahead without floor in front."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class EmergencyQuadrants(RuledBehavior):
    """Prohibits forward commands during an alarm, and turns on the spot to the freer side.

    A turning camera has no depth, so the turn is completed before the next percept counts.
    """

    name: ClassVar[str] = "emergency_quadrants"

    class Params(RuledBehavior.Params):
        """The alarm, and the turn."""

        threshold: Annotated[
            float, Field(gt=0.0, lt=1.0, description="degree from which there is an alarm")
        ] = 0.5
        turn: Annotated[float, Field(gt=0.0, le=3.2, description="turn after an alarm [rad]")] = 1.0
        max_time: Annotated[
            float, Field(gt=0.0, le=20.0, description="longest duration of an alarm [s]")
        ] = 4.0
        max_age: Annotated[
            float, Field(gt=0.0, le=10.0, description="age from which a percept is void [s]")
        ] = 0.6
        repeat_time: Annotated[
            float,
            Field(ge=0.0, le=60.0, description="time for which the side of a turn is kept [s]"),
        ] = 8.0

    params: Params

    def reset(self) -> None:
        """No alarm."""
        self._target: float | None = None
        self._began = 0.0
        self._ended = -math.inf
        self._way = 1.0

    def propose(self, context: Context) -> Proposal:
        """Prohibit all forward commands until the turn is complete, otherwise none."""
        distances, commands = context.quadrant_distances, context.commands
        fresh = distances is not None and distances.age <= self.params.max_age
        verdict = self.rules.evaluate(
            ahead=distances.ahead if distances is not None and fresh else 1.0,
            floor=distances.floor if distances is not None and fresh else 1.0,
            stalled=context.stalled,
        )
        if self._target is None and verdict.degree("alarm") > self.params.threshold:
            self._begin(context)
        left = self._left(context)
        if left is None:
            nothing = commands.zeros()
            return Proposal(0.0, nothing, nothing, "no alarm", explain=verdict.explain)
        return Proposal(
            applicability=1.0,
            desirability=commands.on_the_spot(self._way * 0.8, width=0.4),
            prohibition=commands.forward(),
            reason=f"turning {'left' if self._way > 0.0 else 'right'} away from a near object",
            explain=verdict.explain,
        )

    def _begin(self, context: Context) -> None:
        """Choose the side: that of a recent turn, else the freer one, else the waypoint's."""
        if context.time - self._ended > self.params.repeat_time:
            distances = context.quadrant_distances
            freer = 0.0 if distances is None else distances.left - distances.right
            side = freer if abs(freer) > 0.1 else context.waypoint_bearing
            self._way = 1.0 if side >= 0.0 else -1.0
        self._began = context.time
        self._target = context.pose.yaw + self._way * self.params.turn

    def _left(self, context: Context) -> float | None:
        """The remaining turn [rad]; None without an alarm."""
        if self._target is None:
            return None
        left = context.turn_to(self._target)
        too_long = context.time - self._began > self.params.max_time
        if left * self._way < 0.1 or too_long:
            self._target, self._ended = None, context.time
            return None
        return left
