"""Explore: head for free, unobserved space (frontier)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Array, Context, Proposal, RuledBehavior

NOVELTY = 1.0
"""Worth of an unobserved metre."""
PERSISTENCE = 0.6
"""Bonus of the previous direction [m]."""


class Explore(RuledBehavior):
    """Turns to the direction with the most free and unobserved distance, and drives there.

    It ignores waypoints: the composite behaviour decides when it applies.
    """

    name: ClassVar[str] = "explore"

    class Params(RuledBehavior.Params):
        """Worth of a direction."""

        weight: float = Field(0.8, gt=0.0, le=1.0, description="applicability")
        turning: float = Field(0.5, ge=0.0, le=5.0, description="price of the turn [m/rad]")

    params: Params

    def reset(self) -> None:
        """Forget the direction."""
        self._heading: float | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and speed that the rules give for the direction of largest worth."""
        bearings, worth = context.ranges.bearings, self._worth(context)
        bearing = float(bearings[int(worth.argmax())])
        self._heading = context.pose.yaw + bearing
        free = context.ranges.nearest(bearing - 0.2, bearing + 0.2)
        # before the first translation nothing is observed, and the rules only let it creep
        toward = np.cos(bearings - bearing) > 0.98
        observed = float(context.ranges.observed[toward].min(initial=2.0))
        verdict = self.rules.evaluate(
            bearing=math.degrees(bearing), free=free, observed=min(observed, 2.0)
        )
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands),
            prohibition=context.commands.zeros(),
            reason=f"{free:.1f} m free at {math.degrees(bearing):+.0f} deg",
            explain=verdict.explain,
        )

    def _worth(self, context: Context) -> Array:
        """Compute the worth (n,) [m] of each direction."""
        p, ranges = self.params, context.ranges
        # minimum over neighbouring directions: a gap narrower than the body leads nowhere
        around = [np.roll(ranges.free, shift) for shift in (-1, 0, 1)]
        free = np.min(around, axis=0)
        unobserved = np.maximum(free - ranges.observed, 0.0)
        worth = free + NOVELTY * unobserved - p.turning * np.abs(ranges.bearings)
        if self._heading is not None:
            off = ranges.bearings - (self._heading - context.pose.yaw)
            worth += PERSISTENCE * np.maximum(0.0, np.cos(off)) ** 4
        return np.asarray(worth)
