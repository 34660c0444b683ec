"""A pilot that drives as a stack does, with somebody beside who hears every step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from navfw.signals import Pose, SensorReading, Twist, Waypoint
from navfw.stack import Stack, StackState

__all__ = ["StackObserver"]


class StackObserver(ABC):
    """Passes everything on to ``stack``; after each step, ``hear`` may write down what was said."""

    def __init__(self, stack: Stack) -> None:
        self.stack = stack

    @property
    def state(self) -> StackState:
        """The stack's."""
        return self.stack.state

    @property
    def timings(self) -> Mapping[str, float]:
        """The stack's."""
        return self.stack.timings

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Have the stack begin."""
        self.stack.start(pose, goals)

    def step(self, reading: SensorReading) -> Twist:
        """Have the stack decide, and hear it."""
        twist = self.stack.step(reading)
        self.hear(reading, self.stack.state)
        return twist

    @abstractmethod
    def hear(self, reading: SensorReading, state: StackState) -> None:
        """What the sensors gave, and what the stack made of it."""
