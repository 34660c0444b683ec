"""A stack whose commands are not those that the robot was given."""

from __future__ import annotations

from dataclasses import replace

from navfw.signals import SensorReading, Twist
from navfw.stack.stack import Stack

_STAND = Twist(0.0, 0.0)  # defined


def halt(stack: Stack) -> None:
    """Report to ``stack`` that the robot was commanded to stand, in place of its last command.

    That its wheels do not turn is then no fault.
    """
    stack.verdict = replace(stack.verdict, twist=_STAND)
    stack.safety.follow(_STAND)
    stack.trim.apply(_STAND)
    stack.controller.reset()


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
