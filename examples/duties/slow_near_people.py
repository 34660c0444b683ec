"""Slow near people: what moves is taken for a person."""

from typing import ClassVar

import numpy as np

from navfw import Behavior, Context, Proposal


class SlowNearPeople(Behavior):
    """Wants less than a third of the top speed while something moves within 2 m."""

    name: ClassVar[str] = "slow_near_people"

    def propose(self, context: Context) -> Proposal:
        """Desire slow commands; the applicability grows as the moving thing comes nearer."""
        commands, conflicts = context.commands, context.conflicts
        near = np.inf if conflicts is None else conflicts.nearest
        slow = (np.abs(commands.relative_v) < 1.0 / 3.0).astype(float)
        return Proposal(
            applicability=float(np.clip(2.0 - near, 0.0, 1.0)),
            desirability=commands.product(slow, np.ones(commands.w.size)),
            prohibition=commands.zeros(),
            reason=f"{near:.1f} m to the nearest moving thing",
        )
