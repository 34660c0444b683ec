"""Locomotion control for a unicycle: limits on speed, acceleration and cornering; wheel trim."""

from __future__ import annotations

import math
from collections import deque
from typing import ClassVar

from pydantic import Field

from navfw.interfaces import Controller
from navfw.robot import RobotModel
from navfw.signals import Command, Encoders, Odometry, Twist

#: Time over which commanded and measured rotation of a wheel are compared [s].
WINDOW = 0.6  # chosen
#: Least commanded distance of a wheel for a comparison [m].
MIN_DISTANCE = 0.06  # chosen
#: Share of the speed from which a wheel is healthy: slip and unequal radii explain the rest.
_HEALTHY = 0.88  # chosen
#: Share of the speed below which a wheel is blocked or its encoder silent, not weak.
MIN_SHARE = 0.4  # chosen
#: Time constant of the estimate of a wheel's share [s].
TIME_CONSTANT = 0.5  # chosen


class WheelTrim:
    """Estimates by the encoders which share of its commanded speed each wheel reaches.

    Commands of weak wheels are raised accordingly, those of healthy wheels are not changed.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._radians_per_tick = 2.0 * math.pi / robot.ticks_per_turn
        self.reset()

    def reset(self) -> None:
        """Take both wheels for healthy, and forget all readings."""
        self._shares = [1.0, 1.0]
        self._commanded = (0.0, 0.0)
        self._sums = (0.0, 0.0)
        # time [s], commanded and measured rotation [rad] of the wheels (left, right)
        self._past: deque[tuple[float, tuple[float, float], tuple[float, float]]] = deque()

    @property
    def shares(self) -> tuple[float, float]:
        """Estimated share of the commanded speed that each wheel (left, right) reaches."""
        left, right = self._shares
        return left, right

    def update(self, encoders: Encoders) -> None:
        """Update the estimate by the newest encoder reading."""
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
        """Return the twist to command so that the robot drives ``twist``; remember it."""
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


class Unicycle(Controller):
    """Follows the fused command as fast as the drive's limits allow.

    Speed and turning rate approach the command with bounded acceleration, and deceleration up to
    the robot's ``max_brake``; forward speed is limited in curves so that lateral acceleration stays
    within bounds. A command older than ``stale`` is void: the robot brakes to a standstill. An
    emergency command never drives forward.
    """

    name: ClassVar[str] = "unicycle"

    class Params(Controller.Params):
        """The age limit of commands."""

        stale: float = Field(
            0.5, gt=0.0, le=5.0, description="age from which a command is void [s]"
        )

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self.reset()

    def reset(self) -> None:
        """Start again from a standstill."""
        self._v = 0.0
        self._w = 0.0

    def control(self, command: Command | None, odometry: Odometry, dt: float) -> Twist:
        """Return the twist for the next ``dt`` [s] toward ``command``; brake if it is not fresh."""
        v = w = 0.0
        if command is not None and odometry.time - command.time <= self.params.stale:
            v, w = self._within_limits(command.twist)
            if command.emergency:
                v = min(v, 0.0)
        self._v = self._ramp_speed(v, dt)
        turn_step = self.robot.max_turn_accel * dt
        self._w += min(max(w - self._w, -turn_step), turn_step)
        return Twist(self._v, self._w)

    def _within_limits(self, twist: Twist) -> tuple[float, float]:
        """Limit (v, w) to the drive's speeds and the cornering limit; standstill if not finite."""
        robot = self.robot
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            return 0.0, 0.0
        w = min(max(twist.w, -robot.max_w), robot.max_w)
        top = robot.max_v if abs(w) < 1e-6 else min(robot.max_v, robot.max_lateral / abs(w))
        return min(max(twist.v, -robot.max_reverse), top), w

    def _ramp_speed(self, target: float, dt: float) -> float:
        """Move the speed one step toward ``target``; slowing down may be as hard as braking."""
        v = self._v
        slowing = abs(target) < abs(v) or target * v < 0.0
        step = (self.robot.max_brake if slowing else self.robot.max_accel) * dt
        if target * v < 0.0:
            target = 0.0  # first to a standstill: the other direction is speeding up
        return v + min(max(target - v, -step), step)
