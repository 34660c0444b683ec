"""Avoid: obstacle avoidance; rates every command by the free distance along its arc."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Array, Context, Proposal, RuledBehavior

BRAKING = 0.8
"""Deceleration assumed [m/s^2]."""


class Avoid(RuledBehavior):
    """Prohibits commands without room to stop; desires those with clearance over observed floor."""

    name: ClassVar[str] = "avoid"

    class Params(RuledBehavior.Params):
        """The stopping distance, and the weight."""

        latency: float = Field(0.3, ge=0.0, le=2.0, description="delay until braking [s]")
        spare: float = Field(
            0.06, ge=0.0, le=1.0, description="free distance kept at any speed [m]"
        )
        weight: float = Field(0.6, gt=0.0, le=1.0, description="applicability beside an obstacle")

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Rate every arc by free and observed length over that needed to stop, and clearance."""
        p, commands, arcs = self.params, context.commands, context.arcs
        v = np.abs(commands.v)
        needed = self._to_stop(v, BRAKING) + p.spare
        needed[v == 0.0] = 1e-3  # a turn on the spot needs no distance, but an angle
        reserve = arcs.free / needed[:, None]
        angles = self._to_stop(np.abs(commands.w), self.robot.max_turn_accel)
        reserve[v == 0.0] = np.minimum(arcs.turn / np.maximum(angles, 1e-3), 1e3)
        verdict = self.rules.evaluate_all(
            reserve=reserve,
            observed=arcs.observed / needed[:, None],
            pace=commands.product(v, np.ones_like(commands.w)),
            clearance=arcs.clearance,
        )
        nearest = float(context.ranges.free.min())
        return Proposal(
            applicability=p.weight * min(1.0, max(0.25, 1.5 - nearest / 0.6)),
            desirability=verdict.values("desire"),
            prohibition=verdict.values("prohibit"),
            reason=f"nearest obstacle at {nearest:.2f} m",
            explain=verdict.explain,
        )

    def _to_stop(self, speed: Array, deceleration: float) -> Array:
        """Return the distances [m] or angles [rad] to stop from ``speed``, latency included."""
        distance: Array = speed**2 / (2.0 * deceleration) + speed * self.params.latency
        return distance
