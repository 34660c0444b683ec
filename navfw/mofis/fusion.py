"""Command fusion: ways to make one command of all behaviours' proposals (METHOD 3, Pirjanian)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.numerics import Array, Mask
from navfw.numerics.functions import power
from navfw.numerics.products import product, sum_in_order
from navfw.signals import Command, Proposal, Twist

CUT = 0.5
"""Prohibition from which a command is excluded."""
LOYALTY = 0.3
"""Bonus of the region with the previous command."""

Proposals = Mapping[str, Proposal]


def _joint_prohibition(context: Context, proposals: Proposals) -> Array:
    """(n_v, n_w): the strongest prohibition of any behaviour; never averaged (METHOD 3.6)."""
    result = context.commands.zeros()
    for proposal in proposals.values():
        np.maximum(result, proposal.prohibition, out=result)
    return result


def _shares(proposals: Proposals) -> dict[str, float]:
    total = sum_in_order(proposal.applicability for proposal in proposals.values())
    return {name: p.applicability / max(total, 1e-9) for name, p in proposals.items()}


def _leader_at(proposals: Proposals, row: int, column: int) -> str:
    """The behaviour with the largest weighted desire for the command at (row, column)."""
    return max(
        proposals,
        key=lambda name: proposals[name].applicability * proposals[name].desirability[row, column],
    )


def _at_fraction(values: Array, position: float) -> float:
    return float(np.interp(position, np.arange(values.size), values))


def _best_of(values: Array) -> tuple[float, float]:
    """(row, column) of the largest of ``values`` (n_v, n_w)."""
    row, column = np.unravel_index(int(values.argmax()), values.shape)
    return float(row), float(column)


def _command_at(
    context: Context,
    proposals: Proposals,
    position: tuple[float, float],
    forbidden: Mask,
    explanation: Mapping[str, Any] | None = None,
    leader: str | None = None,
) -> Command:
    """The command at a (row, column) of the grid, which may be fractional.

    ``forbidden`` (n_v, n_w) marks excluded commands. If all forward commands are excluded it is an
    emergency, and LOCOM brakes fully.
    """
    row, column = position
    grid = context.commands
    leader = leader or _leader_at(proposals, round(row), round(column))
    return Command(
        time=context.time,
        twist=Twist(_at_fraction(grid.v, row), _at_fraction(grid.w, column)),
        leader=leader,
        reason=proposals[leader].reason,
        emergency=_forward_excluded(context, forbidden),
        weights=_shares(proposals),
        explanation=explanation or {},
    )


def _no_command(context: Context, proposals: Proposals, forbidden: Mask) -> Command:
    """Stand still: no command is both desired and allowed."""
    return Command(
        time=context.time,
        twist=Twist(0.0, 0.0),
        leader="none",
        reason="no command is both desired and allowed",
        emergency=_forward_excluded(context, forbidden),
        weights=_shares(proposals),
    )


def _forward_excluded(context: Context, forbidden: Mask) -> bool:
    return bool(forbidden[context.commands.forward_rows].all())


class FuzzyFusion(Fusion):
    """Blends desires by applicability, removes prohibitions, takes the centroid of one region.

    The desirability of each (v, w) is the applicability-weighted mean over the behaviours (``blend:
    sum``) or their context-dependent maximum (``blend: max``, Saffiotti). Any behaviour's
    prohibition counts in full. Of the connected regions left, the one with the largest mass
    decides, so that two ways around an obstacle are not averaged into it (centroid of largest area,
    Yen and Pfluger).
    """

    name: ClassVar[str] = "fuzzy"

    class Params(Fusion.Params):
        """How desires and prohibitions are combined."""

        blend: Annotated[
            Literal["sum", "max"], Field(description="sum: weighted mean; max: fuzzy union")
        ] = "sum"
        level: Annotated[
            float,
            Field(
                gt=0.0, lt=1.0, description="share of the maximum from which commands form regions"
            ),
        ] = 0.8

    params: Params

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The centroid of the allowed region with the largest desire."""
        prohibition = _joint_prohibition(context, proposals)
        forbidden = prohibition > CUT
        desire = self._desire(context, proposals)
        support = np.where(forbidden, 0.0, desire * (1.0 - prohibition))
        best = float(support.max())
        if best <= 1e-6:
            return _no_command(context, proposals, forbidden)
        share = np.count_nonzero(forbidden) / forbidden.size
        explanation = {"desire": float(desire.max()), "allowed": 1.0 - share}
        position = self._centre(context, support, best, forbidden)
        return _command_at(context, proposals, position, forbidden, explanation)

    def _desire(self, context: Context, proposals: Proposals) -> Array:
        """(n_v, n_w) blended desirability."""
        desire = context.commands.zeros()
        if self.params.blend == "max":
            for proposal in proposals.values():
                desired = np.minimum(proposal.applicability, proposal.desirability)
                np.maximum(desire, desired, out=desire)
            return desire
        for name, share in _shares(proposals).items():
            if share > 0.0:
                desire += share * proposals[name].desirability
        return desire

    def _centre(
        self, context: Context, support: Array, best: float, forbidden: Mask
    ) -> tuple[float, float]:
        """(row, column), fractional, of the command chosen from ``support`` (n_v, n_w)."""
        joined = (support >= self.params.level * best).astype(np.uint8)
        _, regions = cv2.connectedComponents(joined, connectivity=4)
        mass = np.bincount(regions.ravel(), weights=support.ravel())[1:]
        if context.previous is not None:
            before = regions[context.commands.nearest(context.previous.twist)]
            if before > 0:
                mass[before - 1] *= 1.0 + LOYALTY
        chosen = regions == 1 + int(mass.argmax())
        inside = np.where(chosen, support, 0.0)
        weight = inside.sum()
        row = product(np.arange(support.shape[0]), inside.sum(axis=1)) / weight
        column = product(np.arange(support.shape[1]), inside.sum(axis=0)) / weight
        if forbidden[round(row), round(column)]:
            return _best_of(inside)  # the centroid of a concave region may lie outside it
        return float(row), float(column)


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
        from scipy import ndimage  # takes a tenth of a start's time

        votes = context.commands.zeros()
        for name, share in _shares(proposals).items():
            proposal = proposals[name]
            votes += share * (proposal.desirability - self.params.against * proposal.prohibition)
        forbidden = _joint_prohibition(context, proposals) > 0.5
        votes = ndimage.gaussian_filter(votes, self.params.smoothing, mode="nearest")
        most = float(votes.max())
        if most <= 0.0:
            return _no_command(context, proposals, forbidden)
        return _command_at(context, proposals, _best_of(votes), forbidden, {"votes": most})


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
        prohibition = _joint_prohibition(context, proposals)
        forbidden = prohibition > self.params.cut
        active = [p for p in proposals.values() if p.applicability > 1e-3]
        allowed = np.flatnonzero(~forbidden)
        if not active or allowed.size == 0:
            return _no_command(context, proposals, forbidden)
        weights = np.array([p.applicability for p in active])
        desires = np.stack([(p.desirability * (1.0 - prohibition)).ravel() for p in active])
        objectives = desires[:, allowed]
        if float(objectives.max()) <= 1e-6:
            return _no_command(context, proposals, forbidden)
        front = pareto_front(objectives)
        short = objectives.max(axis=1, keepdims=True) - objectives[:, front]
        distance = (weights[:, None] * power(short, self.params.power)).sum(axis=0)
        nearest = np.unravel_index(int(allowed[front[int(distance.argmin())]]), forbidden.shape)
        position = float(nearest[0]), float(nearest[1])
        explanation = {"front": int(front.size), "distance": float(distance.min())}
        return _command_at(context, proposals, position, forbidden, explanation)


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
        forbidden = _joint_prohibition(context, proposals) > 0.5
        if total <= 0.0:
            return _no_command(context, proposals, forbidden)
        return _command_at(context, proposals, (row / total, column / total), forbidden)


def _centroid(support: Array) -> tuple[float, float] | None:
    """(row, column), fractional, of the centre of ``support`` (n_v, n_w); None if it is empty."""
    weight = float(support.sum())
    if weight <= 1e-9:
        return None
    rows, columns = np.indices(support.shape)
    return float((rows * support).sum() / weight), float((columns * support).sum() / weight)


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
        none_forbidden = context.commands.zeros() > 1.0
        if not applicable:
            return _no_command(context, proposals, none_forbidden)
        winner = applicable[0]
        proposal = proposals[winner]
        support = proposal.desirability * (1.0 - proposal.prohibition)
        if float(support.max()) <= 1e-6:
            return _no_command(context, proposals, none_forbidden)
        forbidden, explanation = proposal.prohibition > 0.5, {"winner": winner}
        return _command_at(
            context, proposals, _best_of(support), forbidden, explanation, leader=winner
        )
