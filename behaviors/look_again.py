"""Look again: moves the view of a robot whose newest percept has become old."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

MAX_AGE = 0.6
"""Age from which a percept is void [s]."""


class LookAgain(RuledBehavior):
    """Turns away from what the old percept had near ahead, then creeps on until there is a new one.

    A camera that stands or turns shows no depth: without this primitive no behaviour judges by what
    is ahead, and a robot that has stopped stands for ever. The composite behaviour decides when it
    applies. As long as the percept is old, forward commands that turn are prohibited: they lead
    blindly aside, and bring no new percept.
    """

    name: ClassVar[str] = "look_again"

    class Params(RuledBehavior.Params):
        """Weight, and the age limit of percepts."""

        weight: float = Field(0.9, gt=0.0, le=1.0, description="applicability")
        straight: float = Field(
            0.15, ge=0.0, le=1.0, description="turn of a straight command [of the top rate]"
        )

        facing: float = Field(
            0.4, ge=0.0, le=3.2, description="bearing up to which a waypoint is faced [rad]"
        )

    params: Params

    def reset(self) -> None:
        """Take the view for fresh again."""
        self._looked: float | None = None
        self._way = 0.0

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and the speed that the rules give for the old percept."""
        distances, commands = context.quadrant_distances, context.commands
        if distances is not None and distances.age <= MAX_AGE:
            self._looked, self._way = context.pose.yaw, 0.0
            return Proposal(0.0, commands.zeros(), commands.zeros(), "the view is fresh")
        if self._looked is None:
            self._looked = context.pose.yaw
        if self._way == 0.0:
            self._way = self._freer_way(context)
        turned = abs(context.turn_to(self._looked))
        verdict = self.rules.evaluate(
            ahead=1.0 if distances is None else distances.ahead, turned=turned
        )
        turn = verdict.over("turn", self._way * commands.relative_w)
        prohibited = commands.forward()
        prohibited[:, np.abs(commands.relative_w) <= self.params.straight] = 0.0
        return Proposal(
            applicability=self.params.weight,
            desirability=commands.product(verdict.over("speed", commands.relative_v), turn),
            prohibition=prohibited,
            reason=f"no view since {turned:.1f} rad ago",
            explain=verdict.explain,
        )

    def _freer_way(self, context: Context) -> float:
        """Choose the side to turn to, 1 left, -1 right: a waypoint's if aside, else the freer one.

        A turn away from the waypoint would be undone at once by goal seeking, again and again.
        """
        distances, bearing = context.quadrant_distances, context.waypoint_bearing
        freer = 0.0 if distances is None else distances.left - distances.right
        faced = abs(bearing) < self.params.facing
        side = freer if faced and abs(freer) > 0.1 else bearing
        return 1.0 if side >= 0.0 else -1.0
