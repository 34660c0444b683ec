"""Avoid quadrants: obstacle avoidance from OFFIS' near, middle and far only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from navfw import Array, Context, Proposal, RuledBehavior

MAX_AGE = 0.6
"""Age from which a percept is void [s]."""
GOAL_PULL = 0.25
"""Weight of the waypoint's side."""
PASSING_TURN = 1.0
"""Turn that brings it into view again [rad]."""

NEAR = 0.2
"""Fuzzy distance below which a side is near."""
STRAIGHT = 0.15
"""Share of the top turning rate up to which a command is straight."""


class AvoidQuadrants(RuledBehavior):
    """Turns away from the half image with the nearer objects, and slows down with their distance.

    Its only input is the fuzzy distance of the nearest object in each quadrant, as in the paper.
    Forward commands that turn to a near side are prohibited, also for a while after what was near
    has left the view: it is beside the robot until that has passed it.
    """

    name: ClassVar[str] = "avoid_quadrants"

    class Params(RuledBehavior.Params):
        """Weights, and the age limit of percepts."""

        weight: float = Field(0.9, gt=0.0, le=1.0, description="applicability beside an obstacle")

        passing: float = Field(
            0.5, ge=0.0, le=5.0, description="distance past what was near and left the view [m]"
        )

    params: Params

    def reset(self) -> None:
        """Forget what was beside the robot."""
        self._near: dict[float, tuple[float, float, float]] = {}

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and prohibit the speeds that the rules give for the quadrants."""
        distances, commands = context.quadrant_distances, context.commands
        if distances is None or distances.age > MAX_AGE:
            return Proposal(0.0, commands.zeros(), self._beside(context), "no recent percept")
        self._see(context, {1.0: distances.left, -1.0: distances.right})
        toward = math.sin(0.5 * context.waypoint_bearing)
        freer = distances.left - distances.right + GOAL_PULL * toward
        verdict = self.rules.evaluate(
            left=distances.left,
            right=distances.right,
            ahead=distances.ahead,
            freer=min(1.0, max(-1.0, freer)),
        )
        # to turn away from what is ahead comes first
        prohibited = commands.zeros() if distances.ahead < NEAR else self._beside(context)
        too_fast = commands.relative_v > verdict.value("limit")
        prohibited[too_fast & (commands.v > 0.0), :] += 0.4
        return Proposal(
            applicability=self.params.weight * verdict.degree("applicability"),
            desirability=verdict.command(commands),
            prohibition=prohibited,
            reason=f"left {_word(distances.left)}, right {_word(distances.right)}, "
            f"ahead {_word(distances.ahead)}",
            explain=verdict.explain,
        )

    def _see(self, context: Context, distances: Mapping[float, float]) -> None:
        """Remember where each side was near last, by its distance; 1 is left, -1 right."""
        for side, distance in distances.items():
            if distance < NEAR:
                self._near[side] = (context.pose.x, context.pose.y, context.pose.yaw)

    def _beside(self, context: Context) -> Array:
        """Return a layer (n_v, n_w): 0.6 for forward commands that turn to what is beside."""
        commands, pose, params = context.commands, context.pose, self.params
        layer = commands.zeros()
        for side, (x, y, yaw) in tuple(self._near.items()):
            passed = math.hypot(pose.x - x, pose.y - y) > params.passing
            if passed or abs(context.turn_to(yaw)) > PASSING_TURN:
                del self._near[side]
            else:
                layer[commands.forward_rows, side * commands.relative_w > STRAIGHT] = 0.6
        return layer


def _word(distance: float) -> str:
    return ("near", "middle", "far")[min(2, int(3.0 * distance))]
