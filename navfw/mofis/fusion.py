"""Command fusion: one command of all behaviours' proposals (METHOD 3, Pirjanian)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.numerics import Array, Mask
from navfw.numerics.products import product, sum_in_order
from navfw.signals import Command, Proposal, Twist

CUT = 0.5  # chosen
"""Prohibition from which a command is excluded."""
LOYALTY = 0.3  # chosen
"""Bonus of the region with the previous command."""

Proposals = Mapping[str, Proposal]


def joint_prohibition(context: Context, proposals: Proposals) -> Array:
    """Return the strongest prohibition (n_v, n_w) of any behaviour; never averaged (METHOD 3.6)."""
    result = context.commands.zeros()
    for proposal in proposals.values():
        np.maximum(result, proposal.prohibition, out=result)
    return result


def shares(proposals: Proposals) -> dict[str, float]:
    """Return each behaviour's share of the sum of all applicabilities; 0 if that is 0."""
    total = sum_in_order(proposal.applicability for proposal in proposals.values())
    return {name: p.applicability / max(total, 1e-9) for name, p in proposals.items()}


def mean_desire(context: Context, proposals: Proposals) -> Array:
    """Return the mean of the desirabilities (n_v, n_w), weighted by applicability."""
    desire = context.commands.zeros()
    for name, share in shares(proposals).items():
        if share > 0.0:
            desire += share * proposals[name].desirability
    return desire


def allowed_desire(desire: Array, prohibition: Array) -> Array:
    """Return ``desire`` (n_v, n_w) less what is prohibited; 0 for excluded commands."""
    return np.where(prohibition > CUT, 0.0, desire * (1.0 - prohibition))


def _leader_at(proposals: Proposals, row: int, column: int) -> str:
    """Return the behaviour with the largest weighted desire for the command at (row, column)."""
    return max(
        proposals,
        key=lambda name: proposals[name].applicability * proposals[name].desirability[row, column],
    )


def _at_fraction(values: Array, position: float) -> float:
    return float(np.interp(position, np.arange(values.size), values))


def best_of(values: Array) -> tuple[float, float]:
    """Return (row, column) of the largest of ``values`` (n_v, n_w)."""
    row, column = np.unravel_index(int(values.argmax()), values.shape)
    return float(row), float(column)


def command_at(
    context: Context,
    proposals: Proposals,
    position: tuple[float, float],
    forbidden: Mask,
    explanation: Mapping[str, Any] | None = None,
    leader: str | None = None,
) -> Command:
    """Build the command at ``position``, a (row, column) of the grid that may be fractional.

    ``forbidden`` (n_v, n_w) marks excluded commands. If all forward commands are excluded it is an
    emergency, and LOCOM never drives forward. ``leader`` is by default whoever desires it most.
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
        weights=shares(proposals),
        explanation=explanation or {},
    )


def no_command(context: Context, proposals: Proposals, forbidden: Mask) -> Command:
    """Build the command to stand still, because none is both desired and allowed."""
    return Command(
        time=context.time,
        twist=Twist(0.0, 0.0),
        leader="none",
        reason="no command is both desired and allowed",
        emergency=_forward_excluded(context, forbidden),
        weights=shares(proposals),
    )


def _forward_excluded(context: Context, forbidden: Mask) -> bool:
    return bool(forbidden[context.commands.forward_rows].all())


def _up_to_the_top(row: float, peaks: Array, best: float, level: float) -> float:
    """Move the centroid's ``row`` by how much the region goes on beyond the top speed.

    Speeds end where the desires for them do not, so the centroid of a region at the end would never
    be the top speed. ``peaks`` (n_v,) are the region's largest values: if the last is the largest
    of all, ``best``, the region counts as symmetric about it; at ``level`` of that as ending there.
    """
    top = peaks.size - 1
    beyond = max(float(peaks[top]) / best - level, 0.0) / (1.0 - level)
    return top - (top - row) * (1.0 - beyond) / (1.0 + beyond)


class FuzzyFusion(Fusion):
    """Blends desires by applicability, removes prohibitions, takes the centroid of one region.

    The desirability of each (v, w) is the applicability-weighted mean over the behaviours (``blend:
    sum``) or their context-dependent maximum (``blend: max``, Saffiotti). Any behaviour's
    prohibition counts in full. Of the connected regions left, the one with the largest mass
    decides: two paths around an obstacle are not averaged into it (centroid of largest area,
    Yen and Pfluger).
    """

    name: ClassVar[str] = "fuzzy"

    class Params(Fusion.Params):
        """How desires and prohibitions are combined."""

        blend: Literal["sum", "max"] = Field(
            "sum", description="sum: weighted mean; max: fuzzy union"
        )
        level: float = Field(
            0.8, gt=0.0, lt=1.0, description="share of the maximum from which commands form regions"
        )

    params: Params

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """Return the command at the centroid of the best allowed region; stand without one."""
        prohibition = joint_prohibition(context, proposals)
        forbidden = prohibition > CUT
        desire = self._desire(context, proposals)
        support = allowed_desire(desire, prohibition)
        best = float(support.max())
        if best <= 1e-6:
            return no_command(context, proposals, forbidden)
        share = np.count_nonzero(forbidden) / forbidden.size
        explanation = {"desire": float(desire.max()), "allowed": 1.0 - share}
        position = self._centre(context, support, best, forbidden)
        return command_at(context, proposals, position, forbidden, explanation)

    def _desire(self, context: Context, proposals: Proposals) -> Array:
        """Blend the desirabilities (n_v, n_w)."""
        if self.params.blend == "sum":
            return mean_desire(context, proposals)
        desire = context.commands.zeros()
        for proposal in proposals.values():
            desired = np.minimum(proposal.applicability, proposal.desirability)
            np.maximum(desire, desired, out=desire)
        return desire

    def _centre(
        self, context: Context, support: Array, best: float, forbidden: Mask
    ) -> tuple[float, float]:
        """Choose the command (row, column), fractional, from ``support`` (n_v, n_w)."""
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
        row = _up_to_the_top(row, inside.max(axis=1), best, self.params.level)
        column = product(np.arange(support.shape[1]), inside.sum(axis=0)) / weight
        if forbidden[round(row), round(column)]:
            return best_of(inside)  # the centroid of a concave region may lie outside it
        return float(row), float(column)
