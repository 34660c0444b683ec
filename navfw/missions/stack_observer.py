"""A pilot that runs a stack and observes every step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from navfw.signals import Pose, SensorReading, Twist, Waypoint
from navfw.stack import Stack
from navfw.stack.stack_state import StackState


class StackObserver(ABC):
    """Forwards all calls to ``stack`` and calls ``observe`` after each step."""

    def __init__(self, stack: Stack) -> None:
        self.stack = stack

    @property
    def state(self) -> StackState:
        """The stack's state."""
        return self.stack.state

    @property
    def timings(self) -> Mapping[str, float]:
        """The stack's computing time [s] by stage."""
        return self.stack.timings

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Start the stack at ``pose`` in ``map`` (None: unknown), with ``goals`` in order."""
        self.stack.start(pose, goals)

    def step(self, reading: SensorReading) -> Twist:
        """The stack's twist for ``reading``; then ``observe``."""
        twist = self.stack.step(reading)
        self.observe(reading, self.stack.state)
        return twist

    @abstractmethod
    def observe(self, reading: SensorReading, state: StackState) -> None:
        """Take in one step: the sensor reading, and the stack's state after it."""
