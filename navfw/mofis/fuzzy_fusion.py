"""Fuzzy command fusion: desires are blended, prohibitions are never averaged away (METHOD 3.6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from scipy import ndimage

from navfw.kinds import Fusion
from navfw.mofis.context import Context
from navfw.signals import Array, Command, Proposal, Twist

__all__ = ["FuzzyFusion"]


class FuzzyFusion(Fusion):
    """Blends desires by applicability, subtracts prohibitions, takes the centre of the best region.

    The desirability of each (v, w) is the applicability-weighted mean of the behaviours' (``blend:
    sum``) or their context-dependent maximum (``blend: max``, Saffiotti); what any behaviour
    forbids is taken away from it whole. Of the connected regions left, the largest decides, so that
    two ways around an obstacle are never averaged into it (Yen and Pfluger's centroid of largest
    area).
    """

    name: ClassVar[str] = "fuzzy"

    class Params(Fusion.Params):
        """How desires meet prohibitions."""

        blend: Annotated[
            Literal["sum", "max"], Field(description="sum: weighted mean; max: fuzzy union")
        ] = "sum"
        cut: Annotated[
            float, Field(gt=0.0, le=1.0, description="prohibition from which a command is out")
        ] = 0.5
        level: Annotated[
            float, Field(gt=0.0, lt=1.0, description="share of the best that joins its region")
        ] = 0.6
        loyalty: Annotated[
            float, Field(ge=0.0, le=2.0, description="bonus of the region chosen last time")
        ] = 0.3

    params: Params

    def fuse(self, context: Context, proposals: Mapping[str, Proposal]) -> Command:
        """The centre of the most desired region that nobody forbids."""
        desire, weights = self._desire(context, proposals)
        prohibition = context.commands.zeros()
        for proposal in proposals.values():
            np.maximum(prohibition, proposal.prohibition, out=prohibition)
        allowed = prohibition <= self.params.cut
        explanation = {"desire": float(desire.max()), "allowed": float(allowed.mean())}
        support = np.where(allowed, desire * (1.0 - prohibition), 0.0)
        # with every way forward forbidden LOCOM must not coast
        emergency = not bool(allowed[context.commands.v > 0.0].any())
        best = float(support.max())
        if best <= 1e-6:
            return Command(
                time=context.time,
                twist=Twist(0.0, 0.0),
                leader="none",
                reason="no command is both desired and allowed",
                emergency=emergency,
                weights=weights,
                explanation=explanation,
            )
        row, column = self._centre(context, support, prohibition)
        v, w = _interpolate(context.commands.v, row), _interpolate(context.commands.w, column)
        leader = self._leader(proposals, round(row), round(column))
        return Command(
            time=context.time,
            twist=Twist(v, w),
            leader=leader,
            reason=proposals[leader].reason,
            emergency=emergency,
            weights=weights,
            explanation=explanation,
        )

    def _desire(
        self, context: Context, proposals: Mapping[str, Proposal]
    ) -> tuple[Array, dict[str, float]]:
        """Blended desirability (n_v, n_w) and each behaviour's share of it."""
        total = sum(p.applicability for p in proposals.values())
        weights = {name: p.applicability / max(total, 1e-9) for name, p in proposals.items()}
        desire = context.commands.zeros()
        for name, proposal in proposals.items():
            if self.params.blend == "sum":
                desire += weights[name] * proposal.desirability
            else:
                np.maximum(
                    desire, np.minimum(proposal.applicability, proposal.desirability), out=desire
                )
        return desire, weights

    def _centre(self, context: Context, support: Array, prohibition: Array) -> tuple[float, float]:
        """(row, column), fractional, of the command chosen from ``support`` (n_v, n_w)."""
        best = float(support.max())
        regions, count = ndimage.label(support >= self.params.level * best)
        index = range(1, count + 1)
        mass = np.atleast_1d(ndimage.sum_labels(support, regions, index))
        if context.previous is not None:
            before = regions[context.commands.nearest(context.previous.twist)]
            if before > 0:
                mass[before - 1] *= 1.0 + self.params.loyalty
        chosen = regions == 1 + int(mass.argmax())
        inside = np.where(chosen, support, 0.0)
        rows, columns = np.indices(support.shape)
        weight = inside.sum()
        row, column = (rows * inside).sum() / weight, (columns * inside).sum() / weight
        if prohibition[round(row), round(column)] > self.params.cut:
            top = np.unravel_index(int(inside.argmax()), support.shape)
            return float(top[0]), float(top[1])
        return float(row), float(column)

    @staticmethod
    def _leader(proposals: Mapping[str, Proposal], row: int, column: int) -> str:
        """The behaviour that wanted the chosen command most."""
        return max(
            proposals,
            key=lambda name: (
                proposals[name].applicability * proposals[name].desirability[row, column]
            ),
        )


def _interpolate(values: Array, position: float) -> float:
    """``values`` at a fractional index."""
    return float(np.interp(position, np.arange(values.size), values))
