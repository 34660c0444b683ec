"""Shared by all fusions: joint prohibition, shares, the leader, and the resulting command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from navfw.context import Context
from navfw.numerics import Array, Mask
from navfw.numerics.products import sum_in_order
from navfw.signals import Command, Proposal, Twist

Proposals = Mapping[str, Proposal]


def prohibition_of(context: Context, proposals: Proposals) -> Array:
    """(n_v, n_w): the strongest prohibition of any behaviour; never averaged (METHOD 3.6)."""
    result = context.commands.zeros()
    for proposal in proposals.values():
        np.maximum(result, proposal.prohibition, out=result)
    return result


def shares_of(proposals: Proposals) -> dict[str, float]:
    """Each behaviour's share of all applicability."""
    total = sum_in_order(proposal.applicability for proposal in proposals.values())
    return {name: p.applicability / max(total, 1e-9) for name, p in proposals.items()}


def _leader_at(proposals: Proposals, row: int, column: int) -> str:
    """The behaviour with the largest weighted desire for the command at (row, column)."""
    return max(
        proposals,
        key=lambda name: proposals[name].applicability * proposals[name].desirability[row, column],
    )


def _at_fraction(values: Array, position: float) -> float:
    """``values`` (n,) at a fractional index."""
    return float(np.interp(position, np.arange(values.size), values))


def command_at(
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
        weights=shares_of(proposals),
        explanation=explanation or {},
    )


def no_command(context: Context, proposals: Proposals, forbidden: Mask) -> Command:
    """Stand still: no command is both desired and allowed."""
    return Command(
        time=context.time,
        twist=Twist(0.0, 0.0),
        leader="none",
        reason="no command is both desired and allowed",
        emergency=_forward_excluded(context, forbidden),
        weights=shares_of(proposals),
    )


def _forward_excluded(context: Context, forbidden: Mask) -> bool:
    return bool(forbidden[context.commands.forward_rows].all())
