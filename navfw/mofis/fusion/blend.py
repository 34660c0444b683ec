"""Superposition (motor schemas, Arkin): the mean of the commands of all behaviours."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.mofis.fusion.common import Proposals, command_at, no_command, prohibition_of
from navfw.numerics import Array
from navfw.signals import Command


class BlendFusion(Fusion):
    """Averages the behaviours' own crisp commands, weighted by applicability.

    A baseline: two ways around an obstacle are averaged into it, which fuzzy fusion avoids.
    """

    name: ClassVar[str] = "blend"

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The weighted mean of the centroids of all proposals."""
        row = column = total = 0.0
        for proposal in proposals.values():
            centre = _centroid(proposal.desirability * (1.0 - proposal.prohibition))
            if centre is None or proposal.applicability <= 0.0:
                continue
            row += proposal.applicability * centre[0]
            column += proposal.applicability * centre[1]
            total += proposal.applicability
        forbidden = prohibition_of(context, proposals) > 0.5
        if total <= 0.0:
            return no_command(context, proposals, forbidden)
        return command_at(context, proposals, (row / total, column / total), forbidden)


def _centroid(support: Array) -> tuple[float, float] | None:
    """(row, column), fractional, of the centre of ``support`` (n_v, n_w); None if it is empty."""
    weight = float(support.sum())
    if weight <= 1e-9:
        return None
    rows, columns = np.indices(support.shape)
    return float((rows * support).sum() / weight), float((columns * support).sum() / weight)
