"""A stack that says what it would command while another drives the robot."""

from __future__ import annotations

from dataclasses import replace

from navfw.signals import SensorReading, Twist
from navfw.stack.stack import Stack


class ShadowStack(Stack):
    """A stack that is not in command.

    The robot's own motion takes the place of the twist that was given to the wheels: that they do
    not follow the stack is no fault of theirs.
    """

    def _step(self, reading: SensorReading) -> Twist:
        super()._step(reading)
        wanted, driven = self.verdict.twist, self.history.at(reading.encoders.time).twist
        self.verdict = replace(self.verdict, twist=driven)
        self.safety.follow(driven)
        return wanted
