"""Four fusions to compare with the fuzzy one: voting, Pareto optimum, blending, priority."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from navfw import Array, Command, Context, Fusion, Proposal
from navfw.mofis.fusion import best_of, command_at, joint_prohibition, no_command, shares
from navfw.numerics.functions import power

Proposals = Mapping[str, Proposal]

_SMOOTHING = 0.7
"""Standard deviation with which votes are smoothed [cells of the grid of commands]."""
_ORDER = ("emergency", "escape", "give_way", "avoid", "follow_wall", "go_to_xy")
"""The behaviours to which ``PriorityFusion`` gives the command, the most important first."""
_THRESHOLD = 0.8
"""Applicability from which such a behaviour decides."""


class DamnFusion(Fusion):
    """Adds up all votes for and against, weighted by applicability, smooths them, takes the best.

    Prohibitions are votes like any other: enough desire outvotes them (METHOD 3.5).
    """

    name: ClassVar[str] = "damn"

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The command with the most votes."""
        from scipy import ndimage  # takes a tenth of a start's time

        votes = context.commands.zeros()
        for name, share in shares(proposals).items():
            proposal = proposals[name]
            votes += share * (proposal.desirability - proposal.prohibition)
        forbidden = joint_prohibition(context, proposals) > 0.5
        votes = ndimage.gaussian_filter(votes, _SMOOTHING, mode="nearest")
        most = float(votes.max())
        if most <= 0.0:
            return no_command(context, proposals, forbidden)
        return command_at(context, proposals, best_of(votes), forbidden, {"votes": most})


class ParetoFusion(Fusion):
    """Takes each behaviour's membership function as an objective.

    Dominated commands are dropped. Of those left, the one nearest to the ideal (all objectives at
    their maximum) is taken; distances are weighted by applicability.
    """

    name: ClassVar[str] = "pareto"

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The best compromise on the Pareto front of the allowed commands."""
        prohibition = joint_prohibition(context, proposals)
        forbidden = prohibition > 0.5
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
        distance = (weights[:, None] * power(short, 2.0)).sum(axis=0)
        nearest = np.unravel_index(int(allowed[front[int(distance.argmin())]]), forbidden.shape)
        position = float(nearest[0]), float(nearest[1])
        explanation = {"front": int(front.size), "distance": float(distance.min())}
        return command_at(context, proposals, position, forbidden, explanation)


def pareto_front(objectives: Array) -> npt.NDArray[np.intp]:
    """Indices of the columns of ``objectives`` (k, n) that no other column dominates.

    A column dominates another when it is at least as good in every row and better in one.
    """
    at_least = (objectives[:, :, None] >= objectives[:, None, :]).all(axis=0)
    better = (objectives[:, :, None] > objectives[:, None, :]).any(axis=0)
    return np.flatnonzero(~(at_least & better).any(axis=0))


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
        forbidden = joint_prohibition(context, proposals) > 0.5
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


class PriorityFusion(Fusion):
    """Gives the command to one behaviour: the first of ``_ORDER`` that is applicable enough.

    A baseline: the prohibitions of the other behaviours do not count. Behaviours not named in
    ``_ORDER`` come last, in the order of the stack file.
    """

    name: ClassVar[str] = "priority"

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The command with the winner's largest desire that it does not prohibit."""
        rank = {name: index for index, name in enumerate(_ORDER)}
        ordered = sorted(proposals, key=lambda name: rank.get(name, len(rank)))
        applicable = [name for name in ordered if proposals[name].applicability >= _THRESHOLD]
        none_forbidden = context.commands.zeros() > 1.0
        if not applicable:
            return no_command(context, proposals, none_forbidden)
        winner = applicable[0]
        proposal = proposals[winner]
        support = proposal.desirability * (1.0 - proposal.prohibition)
        if float(support.max()) <= 1e-6:
            return no_command(context, proposals, none_forbidden)
        forbidden, explanation = proposal.prohibition > 0.5, {"winner": winner}
        return command_at(
            context, proposals, best_of(support), forbidden, explanation, leader=winner
        )
