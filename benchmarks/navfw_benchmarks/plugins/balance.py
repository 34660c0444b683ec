"""Balance: turn away from the side whose flow is larger (Duchon and Warren 1994; METHOD 2.15)."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Behavior, Context, FlowField, Proposal


class Balance(Behavior):
    """A complete flow robot: w = k (sum|d_R| - sum|d_L|) / (sum|d_R| + sum|d_L|), and a goal term.

    Its only input is derotated flow. With equal flow on both sides it drives straight on, also into
    an obstacle in the middle: a known weakness of the strategy.
    """

    name: ClassVar[str] = "balance"

    class Params(Behavior.Params):
        """Gains."""

        gain: Annotated[
            float, Field(ge=0.0, le=20.0, description="k, turning rate at full imbalance [rad/s]")
        ] = 1.8
        goal_gain: Annotated[
            float, Field(ge=0.0, le=10.0, description="turning rate per bearing of the goal [1/s]")
        ] = 0.5
        goal_max: Annotated[
            float, Field(ge=0.0, le=4.0, description="bound of the goal term [rad/s]")
        ] = 0.5
        speed: Annotated[float, Field(gt=0.0, le=2.0, description="speed straight on [m/s]")] = 0.3
        slowing: Annotated[
            float, Field(ge=0.0, le=1.0, description="share of the speed removed at full turn")
        ] = 0.7
        max_age: Annotated[
            float, Field(gt=0.0, le=10.0, description="age from which flow is void [s]")
        ] = 0.5

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turning rate that balances the flow, plus the goal term."""
        p, commands = self.params, context.commands
        if context.waypoint is None:
            return Proposal(0.0, commands.zeros(), commands.zeros(), "no waypoint")
        left = right = 0.0
        flow = context.flow
        if flow is not None and context.time - flow.time <= p.max_age:
            left, right = _sides(flow)
        # sides are compared only if both have valid flow
        balance = (right - left) / (right + left) if min(left, right) > 0.0 else 0.0
        pull = p.goal_gain * context.waypoint_bearing
        w = p.gain * balance + min(p.goal_max, max(-p.goal_max, pull))
        turn = min(1.0, max(-1.0, w / commands.max_w))
        v = p.speed * (1.0 - p.slowing * abs(turn))
        return Proposal(
            applicability=1.0,
            desirability=commands.around(v / commands.max_v, turn),
            prohibition=commands.zeros(),
            reason=f"flow {left:.1f} px left, {right:.1f} px right",
        )


def _sides(flow: FlowField) -> tuple[float, float]:
    """Mean length [px] of the valid vectors of the image's left and right half; 0 without any."""
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    valid = flow.confidence * np.isfinite(length)
    length = np.nan_to_num(length)
    means = []
    for side in (flow.points[..., 0] < 0.0, flow.points[..., 0] > 0.0):
        weight = valid * side
        total = float(weight.sum())
        means.append(float((weight * length).sum()) / total if total > 0.0 else 0.0)
    return means[0], means[1]
