"""Give way: keep clear of moving obstacles, and move out of the way of approaching ones."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior

ROOM, DELAY, BRAKING, BESIDE = 0.07, 0.35, 0.7, 0.06
"""Distance [m], time [s] and deceleration [m/s^2] of a stop, and clearance [m]: as ``avoid``'s."""


class GiveWay(RuledBehavior):
    """Rates every command by its predicted closest approach to moving obstacles.

    If all commands lead too close, those with the largest distance are desired; standing still is
    not among them when an obstacle is on a collision course with a standing robot. While the robot
    rolls, even braking may approach a close obstacle: what no command avoids counts against none.
    """

    name: ClassVar[str] = "give_way"
    handles_moving_obstacles = True

    class Params(RuledBehavior.Params):
        """Distances and weight."""

        clear: float = Field(
            0.5, gt=0.0, le=3.0, description="distance from which it does not apply [m]"
        )
        approach: float = Field(
            0.02, ge=0.0, le=0.2, description="least approach that counts as driving toward it [m]"
        )
        weight: float = Field(1.0, gt=0.0, le=1.0, description="applicability at predicted contact")

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire and prohibit commands by their distance and time at closest approach."""
        conflicts = context.conflicts
        if conflicts is None:
            nothing = context.commands.zeros()
            return Proposal(0.0, nothing, nothing, "no moving obstacle")
        # driving into a wall is no escape, neither is driving toward a close obstacle
        arcs, speeds = context.arcs, context.commands.v[:, None]
        needed = ROOM + DELAY * np.abs(speeds) + speeds**2 / (2.0 * BRAKING)
        possible = (np.minimum(arcs.free, arcs.observed) > needed) & (arcs.clearance > BESIDE)
        possible[speeds[:, 0] == 0.0] = True
        # what no command avoids, as a rolling robot cannot stop at once, counts against none
        unavoidable = float(conflicts.approach[possible].min())
        approach = conflicts.approach
        if unavoidable > self.params.approach:
            approach = approach - unavoidable
        best = float(conflicts.distance[possible & (approach <= self.params.approach)].max())
        verdict = self.rules.evaluate_all(
            distance=conflicts.distance,
            worse=np.maximum(best - conflicts.distance, 0.0),
            time=conflicts.time,
            near=np.full(conflicts.distance.shape, conflicts.nearest),
            approach=approach,
            speed=np.broadcast_to(speeds, approach.shape),
        )
        least = float(conflicts.distance.min())
        return Proposal(
            applicability=self.params.weight * max(0.0, min(1.0, 1.0 - least / self.params.clear)),
            desirability=verdict.values("desire"),
            prohibition=verdict.values("prohibit"),
            reason=f"obstacle at {conflicts.nearest:.2f} m, closest approach {best:.2f} m",
            explain=verdict.explain,
        )
