"""Voting after DAMN (Payton, Rosenblatt): every behaviour votes on every command."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field
from scipy import ndimage

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.mofis.fusion.common import Proposals, command_at, no_command, prohibition_of, shares_of
from navfw.signals import Command


class DamnFusion(Fusion):
    """Adds up all votes for and against, weighted by applicability, smooths them, takes the best.

    Prohibitions are votes like any other: enough desire outvotes them (METHOD 3.5).
    """

    name: ClassVar[str] = "damn"

    class Params(Fusion.Params):
        """How votes are counted."""

        against: Annotated[
            float,
            Field(ge=0.0, le=10.0, description="weight of a prohibition against a desire"),
        ] = 1.0
        smoothing: Annotated[
            float, Field(ge=0.0, le=5.0, description="standard deviation [cells of the grid]")
        ] = 0.7

    params: Params

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The command with the most votes."""
        votes = context.commands.zeros()
        for name, share in shares_of(proposals).items():
            proposal = proposals[name]
            votes += share * (proposal.desirability - self.params.against * proposal.prohibition)
        forbidden = prohibition_of(context, proposals)
        votes = ndimage.gaussian_filter(votes, self.params.smoothing, mode="nearest")
        if float(votes.max()) <= 0.0:
            return no_command(context, proposals, forbidden > 0.5)
        row, column = np.unravel_index(int(votes.argmax()), votes.shape)
        return command_at(
            context,
            proposals,
            (float(row), float(column)),
            forbidden > 0.5,
            {"votes": float(votes.max())},
        )
