"""Follow a person: toward what moves, and no nearer than a metre."""

from typing import ClassVar

import numpy as np

from navfw import Behavior, Context, Proposal


class FollowPerson(Behavior):
    """Wants commands whose closest approach to a moving thing is a metre."""

    name: ClassVar[str] = "follow_person"
    handles_moving_obstacles = True

    def propose(self, context: Context) -> Proposal:
        """Desire commands with a closest approach near 1 m; applicability 0 if nothing moves."""
        conflicts, nothing = context.conflicts, context.commands.zeros()
        if conflicts is None:
            return Proposal(0.0, nothing, nothing, "nobody to follow")
        return Proposal(
            applicability=0.8,
            desirability=np.clip(1.0 - np.abs(conflicts.distance - 1.0), 0.0, 1.0),
            prohibition=nothing,
            reason=f"follows at {conflicts.nearest:.1f} m",
        )
