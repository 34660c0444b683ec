"""Fuzzy command fusion: desires are blended, prohibitions are not averaged (METHOD 3.6)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.context import Context
from navfw.interfaces import Fusion
from navfw.mofis.fusion.common import Proposals, command_at, no_command, prohibition_of, shares_of
from navfw.numerics import Array, Mask
from navfw.numerics.products import product
from navfw.signals import Command


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
        cut: Annotated[
            float, Field(gt=0.0, le=1.0, description="prohibition from which a command is excluded")
        ] = 0.5
        level: Annotated[
            float,
            Field(
                gt=0.0, lt=1.0, description="share of the maximum from which commands form regions"
            ),
        ] = 0.8
        loyalty: Annotated[
            float,
            Field(ge=0.0, le=2.0, description="bonus of the region with the previous command"),
        ] = 0.3

    params: Params

    def fuse(self, context: Context, proposals: Proposals) -> Command:
        """The centroid of the allowed region with the largest desire."""
        prohibition = prohibition_of(context, proposals)
        forbidden = prohibition > self.params.cut
        desire = self._desire(context, proposals)
        support = np.where(forbidden, 0.0, desire * (1.0 - prohibition))
        best = float(support.max())
        if best <= 1e-6:
            return no_command(context, proposals, forbidden)
        share = np.count_nonzero(forbidden) / forbidden.size
        explanation = {"desire": float(desire.max()), "allowed": 1.0 - share}
        position = self._centre(context, support, best, forbidden)
        return command_at(context, proposals, position, forbidden, explanation)

    def _desire(self, context: Context, proposals: Proposals) -> Array:
        """(n_v, n_w) blended desirability."""
        desire = context.commands.zeros()
        if self.params.blend == "max":
            for proposal in proposals.values():
                desired = np.minimum(proposal.applicability, proposal.desirability)
                np.maximum(desire, desired, out=desire)
            return desire
        for name, share in shares_of(proposals).items():
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
                mass[before - 1] *= 1.0 + self.params.loyalty
        chosen = regions == 1 + int(mass.argmax())
        inside = np.where(chosen, support, 0.0)
        weight = inside.sum()
        row = product(np.arange(support.shape[0]), inside.sum(axis=1)) / weight
        column = product(np.arange(support.shape[1]), inside.sum(axis=0)) / weight
        if forbidden[round(row), round(column)]:
            # the centroid of a concave region may lie outside it
            top = np.unravel_index(int(inside.argmax()), support.shape)
            return float(top[0]), float(top[1])
        return float(row), float(column)
