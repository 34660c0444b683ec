"""Locomotion control for a unicycle: limits on speed, acceleration and cornering."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from navfw.interfaces import Controller
from navfw.robot import RobotModel
from navfw.signals import Command, Odometry, Twist


class Unicycle(Controller):
    """Follows the fused command as fast as the drive's limits allow.

    Speed and turning rate move toward the command with bounded acceleration; forward speed is
    limited in curves so that lateral acceleration stays within bounds; slowing down is as hard as
    braking, speeding up is gentler. A command older than ``stale`` is void, and an emergency
    command never drives forward.
    """

    name: ClassVar[str] = "unicycle"

    class Params(Controller.Params):
        """The age limit of commands."""

        stale: Annotated[
            float, Field(gt=0.0, le=5.0, description="age from which a command is void [s]")
        ] = 0.5

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self.reset()

    def reset(self) -> None:
        """Back to standstill."""
        self._v = 0.0
        self._w = 0.0

    def control(self, command: Command | None, odometry: Odometry, dt: float) -> Twist:
        """The next twist toward ``command``; without a fresh one, brake to a standstill."""
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
        """(v, w) within the drive's speeds and the cornering limit; standstill if not finite."""
        robot = self.robot
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            return 0.0, 0.0
        w = min(max(twist.w, -robot.max_w), robot.max_w)
        top = robot.max_v if abs(w) < 1e-6 else min(robot.max_v, robot.max_lateral / abs(w))
        return min(max(twist.v, -robot.max_reverse), top), w

    def _ramp_speed(self, target: float, dt: float) -> float:
        """Forward speed one step nearer to ``target``; slowing down may be as hard as braking."""
        v = self._v
        slowing = abs(target) < abs(v) or target * v < 0.0
        step = (self.robot.max_brake if slowing else self.robot.max_accel) * dt
        if slowing and target * v < 0.0:
            target = 0.0  # first to a standstill: the other direction is speeding up
        return v + min(max(target - v, -step), step)
