"""Centre corridor: keep to the middle between two walls (balance strategy)."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from navfw import Context, Proposal, RuledBehavior


class CentreCorridor(RuledBehavior):
    """Turns away from the nearer of two walls while the local goal lies along them."""

    name: ClassVar[str] = "centre_corridor"

    class Params(RuledBehavior.Params):
        """Weight and limits."""

        weight: float = Field(
            0.4, gt=0.0, le=1.0, description="applicability in a perfect corridor"
        )
        along: float = Field(
            0.6, gt=0.0, le=3.2, description="largest bearing of the local goal [rad]"
        )

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turn that balances the free distances left and right; else do not apply."""
        ranges = context.ranges
        along = (
            context.local_goal is not None and abs(context.local_goal.bearing) < self.params.along
        )
        degree = ranges.corridor if along else 0.0
        balance = (ranges.left - ranges.right) / max(ranges.left + ranges.right, 1e-3)
        verdict = self.rules.evaluate(balance=balance)
        nothing = context.commands.zeros()
        reason = f"walls {ranges.left:.2f} m left, {ranges.right:.2f} m right"
        if degree == 0.0:
            return Proposal(0.0, nothing, nothing, reason, verdict.explain)
        return Proposal(
            applicability=self.params.weight * degree,
            desirability=verdict.command(context.commands),
            prohibition=nothing,
            reason=reason,
            explain=verdict.explain,
        )
