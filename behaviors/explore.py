"""Explore: head for where it is open and has not been seen."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Array, Context, Proposal, RuledBehavior


class Explore(RuledBehavior):
    """Turns to the direction in which most is open and unseen, and drives there.

    Whether to explore at all, the composite behaviour must say: waypoints mean nothing to it.
    """

    name: ClassVar[str] = "explore"

    class Params(RuledBehavior.Params):
        """What draws it."""

        weight: Annotated[float, Field(gt=0.0, le=1.0, description="applicability")] = 0.8
        novelty: Annotated[
            float, Field(ge=0.0, le=10.0, description="worth of an unseen metre beside a free one")
        ] = 1.0
        turning: Annotated[
            float, Field(ge=0.0, le=5.0, description="price of turning there [m/rad]")
        ] = 0.5
        loyalty: Annotated[
            float, Field(ge=0.0, le=5.0, description="bonus of the direction taken before [m]")
        ] = 0.6

    params: Params

    def reset(self) -> None:
        """No direction taken yet."""
        self._heading: float | None = None

    def propose(self, context: Context) -> Proposal:
        """Desire the turn and speed that the rules give for the most promising direction."""
        bearings, worth = context.ranges.bearings, self._worth(context)
        bearing = float(bearings[int(worth.argmax())])
        self._heading = context.pose.yaw + bearing
        free = context.ranges.nearest(bearing - 0.2, bearing + 0.2)
        # who has only turned so far has seen nothing, and may but creep
        toward = np.cos(bearings - bearing) > 0.98
        seen = float(context.ranges.observed[toward].min(initial=2.0))
        verdict = self.rules.evaluate(bearing=math.degrees(bearing), free=free, seen=min(seen, 2.0))
        return Proposal(
            applicability=self.params.weight,
            desirability=verdict.command(context.commands),
            prohibition=context.commands.zeros(),
            reason=f"{free:.1f} m open at {math.degrees(bearing):+.0f} deg",
            explain=verdict.explain,
        )

    def _worth(self, context: Context) -> Array:
        """(n,) how much each direction promises [m]."""
        p, ranges = self.params, context.ranges
        # a gap narrower than the body leads nowhere: each direction is as free as its neighbours
        around = [np.roll(ranges.free, shift) for shift in (-1, 0, 1)]
        free = np.min(around, axis=0)
        unseen = np.maximum(free - ranges.observed, 0.0)
        worth = free + p.novelty * unseen - p.turning * np.abs(ranges.bearings)
        if self._heading is not None:
            off = ranges.bearings - (self._heading - context.pose.yaw)
            worth += p.loyalty * np.maximum(0.0, np.cos(off)) ** 4
        return np.asarray(worth)
