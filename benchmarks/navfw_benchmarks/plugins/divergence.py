"""Divergence: drive until the flow diverges too fast, then stop and turn (Camus et al. 1996)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from navfw import Array, Behavior, Context, FlowField, Proposal, RobotModel

_CONTACT, _CONFIRMATIONS = 2.5, 2
"""Time to contact that starts a saccade [s], and the successive flow fields below it."""
_WIDTH, _ABOVE, _BELOW = 0.5, 0.35, 0.1
"""Image region: its width, and its height above and below the middle, as shares of the image."""
_SACCADE, _STRAIGHT = 1.0, 0.8
"""Angle of a saccade [rad], and the distance straight on after it [m]."""
_GOAL_GAIN, _SPEED = 1.0, 0.3
"""Turning rate per bearing of the goal [1/s], and the speed straight on [m/s]."""
_REPEAT_TIME = 6.0
"""Time for which the side of a saccade is kept [s]."""


class Divergence(Behavior):
    """A complete flow robot: time to contact from the central divergence, and saccades.

    Its only input is derotated flow (METHOD 2.15). Between saccades it drives toward the waypoint;
    after a saccade it drives straight on for a distance, or it would turn back.
    """

    name: ClassVar[str] = "divergence"

    def __init__(self, robot: RobotModel, params: Behavior.Params | None = None) -> None:
        super().__init__(robot, params)
        self.reset()

    def reset(self) -> None:
        """Back to driving straight on."""
        self._target: float | None = None
        self._way = 1.0
        self._ended = -math.inf
        self._from: tuple[float, float] | None = None
        self._flow_time = -math.inf
        self._alarms = 0
        self._contact = math.inf

    def propose(self, context: Context) -> Proposal:
        """Desire a saccade, or to drive toward the waypoint."""
        commands = context.commands
        if context.waypoint is None:
            return Proposal(0.0, commands.zeros(), commands.zeros(), "no waypoint")
        self._update(context)
        if self._target is None and self._alarms >= _CONFIRMATIONS:
            self._begin(context)
        if self._target is not None and self._left(context) <= 0.1:
            self._end(context)
        if self._target is not None:
            v, turn, reason = 0.0, 0.8 * self._way, f"contact in {self._contact:.1f} s: saccade"
        else:
            v, turn = self._drive(context)
            reason = f"contact in {min(self._contact, 99.0):.1f} s"
        return Proposal(
            applicability=1.0,
            desirability=commands.around(v / commands.max_v, turn),
            prohibition=commands.zeros(),
            reason=reason,
        )

    def _update(self, context: Context) -> None:
        """Update the time to contact by a new flow field; during a saccade there is none."""
        flow = context.flow
        if flow is None or flow.time <= self._flow_time:
            return
        self._flow_time = flow.time
        self._contact = self._time_to_contact(flow)
        # negative while reversing: only approaching surfaces count
        near = 0.0 < self._contact < _CONTACT
        self._alarms = self._alarms + 1 if near else 0

    def _time_to_contact(self, flow: FlowField) -> float:
        """Time [s] to contact with the surface in the image region; inf without valid flow."""
        camera = self.robot.camera
        x, y = flow.points[..., 0], flow.points[..., 1]
        middle = np.abs(x) <= 0.5 * _WIDTH * camera.width
        middle &= (y >= -_ABOVE * camera.height) & (y <= _BELOW * camera.height)
        valid = middle & (flow.confidence > 0.1) & np.isfinite(flow.vectors).all(axis=-1)
        if np.count_nonzero(valid) < 8:
            return math.inf
        rate = _growth(flow.points[valid], flow.vectors[valid], flow.confidence[valid])
        return flow.motion.dt * (1.0 / rate - 1.0) if rate > 1e-4 else math.inf

    def _begin(self, context: Context) -> None:
        """Choose the side: that of a recent saccade, else that of the smaller flow."""
        if context.time - self._ended > _REPEAT_TIME and context.flow is not None:
            self._way = 1.0 if _mean_turn(context.flow) >= 0.0 else -1.0
        self._target = context.pose.yaw + self._way * _SACCADE
        self._alarms = 0

    def _end(self, context: Context) -> None:
        self._target, self._ended = None, context.time
        self._from = (context.pose.x, context.pose.y)
        self._alarms = 0

    def _left(self, context: Context) -> float:
        """The remaining turn [rad], positive until it is complete."""
        target = context.pose.yaw if self._target is None else self._target
        return context.turn_to(target) * self._way

    def _drive(self, context: Context) -> tuple[float, float]:
        """Speed [m/s] and relative turn: straight on after a saccade, else toward the waypoint."""
        if self._from is not None:
            driven = math.hypot(context.pose.x - self._from[0], context.pose.y - self._from[1])
            # a blocked robot must not wait for ever
            if driven < _STRAIGHT and context.time - self._ended < 4.0 * _STRAIGHT / _SPEED:
                return _SPEED, 0.0
            self._from = None
        turn = _GOAL_GAIN * context.waypoint_bearing / context.commands.max_w
        turn = min(1.0, max(-1.0, turn))
        return _SPEED * (1.0 - 0.8 * abs(turn)), turn


def _growth(points: Array, vectors: Array, weight: Array) -> float:
    """Relative growth of the image about the focus of expansion: half the divergence.

    From an affine fit of ``vectors``; for a frontal surface it is 1 - (depth now / depth past).
    """
    mean = (weight[:, None] * points).sum(axis=0) / weight.sum()
    x, y = (points - mean).T
    xx, xy, yy = ((weight * square).sum() for square in (x * x, x * y, y * y))
    by_x, by_y = weight * (yy * x - xy * y), weight * (xx * y - xy * x)
    rates = (by_x * vectors[:, 0]).sum() + (by_y * vectors[:, 1]).sum()
    return 0.5 * float(rates / (xx * yy - xy * xy))


def _mean_turn(flow: FlowField) -> float:
    """Positive if the left half of the image has less flow than the right half."""
    length = np.nan_to_num(np.hypot(flow.vectors[..., 0], flow.vectors[..., 1]))
    return float((flow.confidence * length * np.sign(flow.points[..., 0])).sum())
