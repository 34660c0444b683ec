"""A wheel that lags behind gets more: what is asked of the drive is what it is to do."""

from __future__ import annotations

import math
from collections import deque

from navfw.robot import RobotModel
from navfw.signals import Encoders, Twist

__all__ = ["WheelTrim"]

#: What each wheel did is compared with what it was told over so long [s].
WINDOW = 0.6
#: Ways shorter than this [m] say nothing about a wheel.
LEAST_WAY = 0.06
#: A wheel that reaches this share of its speed is sound: slip and unequal radii do no more.
SOUND = 0.88
#: One that reaches less is not weak: it is blocked, or not counted.
WEAKEST = 0.4
#: What is learnt of a wheel replaces what was known of it with this time constant [s].
LEARNING = 0.5


class WheelTrim:
    """Learns from the encoders which share of its speed each wheel reaches, and makes up for it.

    Nothing is changed for sound wheels.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._radians_per_tick = 2.0 * math.pi / robot.ticks_per_turn
        self.reset()

    def reset(self) -> None:
        """Both wheels are sound."""
        self._shares = [1.0, 1.0]
        self._told = (0.0, 0.0)
        self._sums = (0.0, 0.0)
        # (time [s], what the wheels (left, right) were told and did since the start [rad])
        self._past: deque[tuple[float, tuple[float, float], tuple[float, float]]] = deque()

    @property
    def shares(self) -> tuple[float, float]:
        """Which share of its speed each wheel (left, right) reaches, as far as known."""
        left, right = self._shares
        return left, right

    def update(self, encoders: Encoders) -> None:
        """Take note of what the wheels have done."""
        done = (
            encoders.left * self._radians_per_tick,
            encoders.right * self._radians_per_tick,
        )
        dt = 0.0
        if self._past:
            dt = encoders.time - self._past[-1][0]
            self._sums = (
                self._sums[0] + self._told[0] * dt,
                self._sums[1] + self._told[1] * dt,
            )
        self._past.append((encoders.time, self._sums, done))
        while encoders.time - self._past[0][0] > WINDOW:
            self._past.popleft()
        if dt > 0.0 and encoders.time - self._past[0][0] > 0.8 * WINDOW:
            for index in range(2):
                self._learn(index, dt)

    def apply(self, twist: Twist) -> Twist:
        """What to tell the drive so that it does ``twist``."""
        speeds = self._robot.wheel_speeds(twist)
        if min(self._shares) < SOUND:
            weak = [share if share < SOUND else 1.0 for share in self._shares]
            speeds = (speeds[0] / weak[0], speeds[1] / weak[1])
            twist = self._robot.twist(*speeds)
        self._told = speeds
        return twist

    def _learn(self, index: int, dt: float) -> None:
        _, told_then, done_then = self._past[0]
        _, told_now, done_now = self._past[-1]
        told = told_now[index] - told_then[index]
        done = done_now[index] - done_then[index]
        if abs(told) * self._robot.wheel_radius < LEAST_WAY:
            return
        share = done / told
        if WEAKEST <= share <= 1.3:
            rate = -math.expm1(-dt / LEARNING)
            self._shares[index] += rate * (min(share, 1.0) - self._shares[index])
