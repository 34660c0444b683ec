"""Give way: keep clear of those who walk, and get out of the way of those who do not stop."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class GiveWay(RuledBehavior):
    """Judges every command by how near it brings movers in the next seconds.

    Where all commands bring one too near, those that keep it farthest off are the best there is:
    standing still is none of them, when somebody walks into a robot that stands.
    """

    name: ClassVar[str] = "give_way"
    handles_moving_obstacles = True

    class Params(RuledBehavior.Params):
        """When movers matter."""

        clear: Annotated[
            float, Field(gt=0.0, le=3.0, description="a gap from which nobody minds [m]")
        ] = 0.5
        approach: Annotated[
            float,
            Field(ge=0.0, le=0.2, description="so much nearer to who is at hand is at them [m]"),
        ] = 0.02
        weight: Annotated[
            float, Field(gt=0.0, le=1.0, description="applicability when a touch is near")
        ] = 1.0

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire and forbid commands by the gap they leave to movers."""
        conflicts = context.conflicts
        if conflicts is None:
            nothing = context.commands.zeros()
            return Proposal(0.0, nothing, nothing, "nobody walks here")
        # where somebody is at hand, driving at them is no way out: standing never is that
        best = float(conflicts.distance[conflicts.approach <= self.params.approach].max())
        verdict = self.rules.evaluate_all(
            distance=conflicts.distance,
            worse=np.maximum(best - conflicts.distance, 0.0),
            time=conflicts.time,
            near=np.full(conflicts.distance.shape, conflicts.nearest),
            approach=conflicts.approach,
        )
        least = float(conflicts.distance.min())
        return Proposal(
            applicability=self.params.weight * max(0.0, min(1.0, 1.0 - least / self.params.clear)),
            desirability=verdict.values("desire"),
            prohibition=verdict.values("forbid"),
            reason=f"somebody walks {conflicts.nearest:.2f} m off; the best gap is {best:.2f} m",
            explain=verdict.explain,
        )
