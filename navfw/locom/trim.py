"""Wheel trim: compensates a wheel that reaches only a share of its commanded speed."""

from __future__ import annotations

import math
from collections import deque

from navfw.robot import RobotModel
from navfw.signals import Encoders, Twist

#: Time over which commanded and measured rotation of a wheel are compared [s].
WINDOW = 0.6
#: Least commanded distance of a wheel for a comparison [m].
MIN_DISTANCE = 0.06
#: Share of the speed from which a wheel is healthy: slip and unequal radii explain the rest.
_HEALTHY = 0.88
#: Share of the speed below which a wheel is blocked or its encoder silent, not weak.
MIN_SHARE = 0.4
#: Time constant of the estimate of a wheel's share [s].
TIME_CONSTANT = 0.5


class WheelTrim:
    """Estimates by the encoders which share of its speed each wheel reaches, and compensates.

    Commands of healthy wheels are not changed.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._radians_per_tick = 2.0 * math.pi / robot.ticks_per_turn
        self.reset()

    def reset(self) -> None:
        """Back to two healthy wheels."""
        self._shares = [1.0, 1.0]
        self._commanded = (0.0, 0.0)
        self._sums = (0.0, 0.0)
        # time [s], commanded and measured rotation [rad] of the wheels (left, right)
        self._past: deque[tuple[float, tuple[float, float], tuple[float, float]]] = deque()

    @property
    def shares(self) -> tuple[float, float]:
        """Share of its speed that each wheel (left, right) reaches, as estimated."""
        left, right = self._shares
        return left, right

    def update(self, encoders: Encoders) -> None:
        """Take in the newest encoder reading."""
        turned = self._radians_per_tick
        measured = (encoders.left * turned, encoders.right * turned)
        dt = 0.0
        if self._past:
            dt = encoders.time - self._past[-1][0]
            self._sums = (
                self._sums[0] + self._commanded[0] * dt,
                self._sums[1] + self._commanded[1] * dt,
            )
        self._past.append((encoders.time, self._sums, measured))
        while encoders.time - self._past[0][0] > WINDOW:
            self._past.popleft()
        if dt > 0.0 and encoders.time - self._past[0][0] > 0.8 * WINDOW:
            for index in range(2):
                self._estimate(index, dt)

    def apply(self, twist: Twist) -> Twist:
        """The twist to command so that the robot drives ``twist``."""
        speeds = self._robot.wheel_speeds(twist)
        if min(self._shares) < _HEALTHY:
            weak = [share if share < _HEALTHY else 1.0 for share in self._shares]
            speeds = (speeds[0] / weak[0], speeds[1] / weak[1])
            twist = self._robot.twist(*speeds)
        self._commanded = speeds
        return twist

    def _estimate(self, index: int, dt: float) -> None:
        _, commanded_then, measured_then = self._past[0]
        _, commanded_now, measured_now = self._past[-1]
        commanded = commanded_now[index] - commanded_then[index]
        measured = measured_now[index] - measured_then[index]
        if abs(commanded) * self._robot.wheel_radius < MIN_DISTANCE:
            return
        share = measured / commanded
        if MIN_SHARE <= share <= 1.3:
            rate = -math.expm1(-dt / TIME_CONSTANT)
            self._shares[index] += rate * (min(share, 1.0) - self._shares[index])
