"""Priority arbitration: the first applicable behaviour of a fixed order decides alone."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.mofis.fusion.common import Proposals, command_at, no_command
from navfw.signals import Command


class PriorityFusion(Fusion):
    """Gives the command to one behaviour: the first of ``order`` that is applicable enough.

    A baseline: the prohibitions of the other behaviours do not count. Behaviours not named in
    ``order`` come last, in the order of the stack file.
    """

    name: ClassVar[str] = "priority"

    class Params(Fusion.Params):
        """The order of behaviours."""

        order: Annotated[
            tuple[str, ...], Field(description="behaviours, the most important first")
        ] = ("emergency", "escape", "give_way", "avoid", "follow_wall", "go_to_xy")
        threshold: Annotated[
            float, Field(gt=0.0, lt=1.0, description="applicability from which a behaviour decides")
        ] = 0.8

    params: Params

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The command with the winner's largest desire that it does not prohibit."""
        rank = {name: index for index, name in enumerate(self.params.order)}
        ordered = sorted(proposals, key=lambda name: rank.get(name, len(rank)))
        applicable = [
            name for name in ordered if proposals[name].applicability >= self.params.threshold
        ]
        nothing = context.commands.zeros() > 1.0
        if not applicable:
            return no_command(context, proposals, nothing)
        winner = applicable[0]
        proposal = proposals[winner]
        support = proposal.desirability * (1.0 - proposal.prohibition)
        if float(support.max()) <= 1e-6:
            return no_command(context, proposals, nothing)
        row, column = np.unravel_index(int(support.argmax()), support.shape)
        return command_at(
            context,
            proposals,
            (float(row), float(column)),
            proposal.prohibition > 0.5,
            {"winner": winner},
            winner,
        )
