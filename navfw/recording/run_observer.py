"""What takes in a run while it goes on: recorder, live server, video."""

from __future__ import annotations

from typing import Protocol

from navfw.signals import Pose, SensorReading, Twist

__all__ = ["RunObserver"]


class RunObserver(Protocol):
    """Takes in every control tick of a run, after the stack; it must change nothing in it."""

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Take in one control tick: reading, the stack's command for it, and the true pose."""
        ...
