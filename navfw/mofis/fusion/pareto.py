"""Behaviours as objectives: a compromise from the Pareto front (after BBFM, arXiv 1703.03161)."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.mofis.fusion.common import Proposals, command_at, no_command, prohibition_of
from navfw.numerics import Array
from navfw.numerics.functions import power
from navfw.signals import Command


class ParetoFusion(Fusion):
    """Takes each behaviour's membership function as an objective.

    Dominated commands are dropped. Of those left, the one nearest to the ideal (all objectives at
    their maximum) is taken; distances are weighted by applicability.
    """

    name: ClassVar[str] = "pareto"

    class Params(Fusion.Params):
        """How the compromise is measured."""

        power: Annotated[
            float, Field(ge=1.0, le=10.0, description="exponent of the distance to the ideal")
        ] = 2.0
        cut: Annotated[
            float, Field(gt=0.0, le=1.0, description="prohibition from which a command is excluded")
        ] = 0.5

    params: Params

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The best compromise on the Pareto front of the allowed commands."""
        prohibition = prohibition_of(context, proposals)
        forbidden = prohibition > self.params.cut
        active = [p for p in proposals.values() if p.applicability > 1e-3]
        allowed = np.flatnonzero(~forbidden)
        if not active or allowed.size == 0:
            return no_command(context, proposals, forbidden)
        weights = np.array([p.applicability for p in active])
        desires = np.stack([(p.desirability * (1.0 - prohibition)).ravel() for p in active])
        objectives = desires[:, allowed]
        if float(objectives.max()) <= 1e-6:
            return no_command(context, proposals, forbidden)
        front = pareto_front(objectives)
        short = objectives.max(axis=1, keepdims=True) - objectives[:, front]
        distance = (weights[:, None] * power(short, self.params.power)).sum(axis=0)
        chosen = allowed[front[int(distance.argmin())]]
        row, column = np.unravel_index(int(chosen), forbidden.shape)
        return command_at(
            context,
            proposals,
            (float(row), float(column)),
            forbidden,
            {"front": int(front.size), "distance": float(distance.min())},
        )


def pareto_front(objectives: Array) -> npt.NDArray[np.intp]:
    """Indices of the columns of ``objectives`` (k, n) that no other column dominates.

    A column dominates another when it is at least as good in every row and better in one.
    """
    at_least = (objectives[:, :, None] >= objectives[:, None, :]).all(axis=0)
    better = (objectives[:, :, None] > objectives[:, None, :]).any(axis=0)
    return np.flatnonzero(~(at_least & better).any(axis=0))
