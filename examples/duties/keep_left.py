"""Keep left: nearer to the wall on the left, as far as there is one."""

from typing import ClassVar

import numpy as np

from navfw import Behavior, Context, Proposal


class KeepLeft(Behavior):
    """Wants to turn a little to the left while a wall there is 0.5 to 2 m away."""

    name: ClassVar[str] = "keep_left"

    def propose(self, context: Context) -> Proposal:
        """Desire a slight turn; applicability 0 beside the wall, or without one."""
        commands, beside = context.commands, context.ranges.left
        turn = commands.turning(0.3)
        return Proposal(
            applicability=0.3 * float(0.5 < beside < 2.0),
            desirability=commands.product(np.ones(commands.v.size), turn),
            prohibition=commands.zeros(),
            reason=f"{beside:.1f} m to the wall on the left",
        )
