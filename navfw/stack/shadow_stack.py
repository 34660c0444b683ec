"""A stack whose commands do not drive the robot, and a halt that overrides a stack's command."""

from __future__ import annotations

from dataclasses import replace

from navfw.signals import SensorReading, Twist
from navfw.stack.stack import Stack

_STAND = Twist(0.0, 0.0)  # defined


def halt(stack: Stack) -> None:
    """Tell ``stack`` that the robot was commanded to stand, instead of its last command."""
    was_driven(stack, _STAND)
    stack.controller.reset()


def was_driven(stack: Stack, twist: Twist) -> None:
    """Tell ``stack`` that the robot was commanded ``twist``, instead of its last command.

    So the stack does not take wheels that do not follow its own command for a fault.
    """
    stack.verdict = replace(stack.verdict, twist=twist)
    stack.safety.follow(twist)
    stack.trim.apply(twist)


class ShadowStack(Stack):
    """A stack that only watches, while something else drives the robot.

    It takes the robot's measured twist for the one that was commanded, so it does not take wheels
    that do not follow its own twists for a fault.
    """

    def _step(self, reading: SensorReading) -> Twist:
        super()._step(reading)
        wanted, driven = self.verdict.twist, self.history.at(reading.encoders.time).twist
        self.verdict = replace(self.verdict, twist=driven)
        self.safety.follow(driven)
        return wanted
