"""Balance: turn away from the side whose flow is larger (Duchon and Warren 1994; METHOD 2.15)."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Behavior, Context, FlowField, Proposal


class Balance(Behavior):
    """A whole flow robot: w = k (sum|d_R| - sum|d_L|) / (sum|d_R| + sum|d_L|), and the goal's pull.

    It sees derotated flow and nothing else. Where both sides show the same, it goes straight on,
    into what stands in the middle as well: the weakness the strategy is known for.
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
        goal_most: Annotated[
            float, Field(ge=0.0, le=4.0, description="most that the goal adds [rad/s]")
        ] = 0.5
        speed: Annotated[float, Field(gt=0.0, le=2.0, description="straight on [m/s]")] = 0.3
        slowing: Annotated[
            float, Field(ge=0.0, le=1.0, description="share of speed given up in hard turns")
        ] = 0.7
        patience: Annotated[
            float, Field(gt=0.0, le=10.0, description="flow older than this says nothing [s]")
        ] = 0.5

    params: Params

    def propose(self, context: Context) -> Proposal:
        """Desire the turning rate that evens out the flow, tempered by the waypoint's bearing."""
        p, commands = self.params, context.commands
        if context.waypoint is None:
            return Proposal(0.0, commands.zeros(), commands.zeros(), "nowhere to go")
        left = right = 0.0
        flow = context.flow
        if flow is not None and context.time - flow.time <= p.patience:
            left, right = _sides(flow)
        # it takes trust in both sides to compare them
        balance = (right - left) / (right + left) if min(left, right) > 0.0 else 0.0
        pull = p.goal_gain * context.waypoint_bearing
        w = p.gain * balance + min(p.goal_most, max(-p.goal_most, pull))
        turn = min(1.0, max(-1.0, w / commands.max_w))
        v = p.speed * (1.0 - p.slowing * abs(turn))
        return Proposal(
            applicability=1.0,
            desirability=commands.around(v / commands.max_v, turn),
            prohibition=commands.zeros(),
            reason=f"flow {left:.1f} px left, {right:.1f} px right",
        )


def _sides(flow: FlowField) -> tuple[float, float]:
    """Mean length [px] of the trusted vectors of the image's left and right half; 0: none."""
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    trusted = flow.confidence * np.isfinite(length)
    length = np.nan_to_num(length)
    means = []
    for side in (flow.points[..., 0] < 0.0, flow.points[..., 0] > 0.0):
        weight = trusted * side
        total = float(weight.sum())
        means.append(float((weight * length).sum()) / total if total > 0.0 else 0.0)
    return means[0], means[1]
