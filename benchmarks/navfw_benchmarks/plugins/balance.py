"""Balance: turn away from the side whose flow is larger (Duchon and Warren 1994; METHOD 2.15)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from navfw import Behavior, Context, FlowField, Proposal

_GAIN = 1.8
"""k, turning rate at full imbalance [rad/s]."""
_GOAL_GAIN, _GOAL_MAX = 0.5, 0.5
"""Turning rate per bearing of the goal [1/s], and the bound of the goal term [rad/s]."""
_SPEED, _SLOWING = 0.3, 0.7
"""Speed straight on [m/s], and the share of it that is removed at full turn."""
_MAX_AGE = 0.5
"""Age from which flow is void [s]."""


class Balance(Behavior):
    """A complete flow robot: w = k (sum|d_R| - sum|d_L|) / (sum|d_R| + sum|d_L|), and a goal term.

    Its only input is derotated flow. With equal flow on both sides it drives straight on, also into
    an obstacle in the middle: a known weakness of the strategy.
    """

    name: ClassVar[str] = "balance"

    def propose(self, context: Context) -> Proposal:
        """Desire the turning rate that balances the flow, plus the goal term."""
        commands = context.commands
        if context.waypoint is None:
            return Proposal(0.0, commands.zeros(), commands.zeros(), "no waypoint")
        left = right = 0.0
        flow = context.flow
        if flow is not None and context.time - flow.time <= _MAX_AGE:
            left, right = _sides(flow)
        # sides are compared only if both have valid flow
        balance = (right - left) / (right + left) if min(left, right) > 0.0 else 0.0
        pull = _GOAL_GAIN * context.waypoint_bearing
        w = _GAIN * balance + min(_GOAL_MAX, max(-_GOAL_MAX, pull))
        turn = min(1.0, max(-1.0, w / commands.max_w))
        v = _SPEED * (1.0 - _SLOWING * abs(turn))
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
