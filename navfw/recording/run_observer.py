"""What takes in a run while it goes on: recorder, live server, video."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from navfw.signals import Pose, SensorReading, Twist

if TYPE_CHECKING:
    from navfw.recording.top_view import WorldOutline
    from navfw.stack import Stack


class RunObserver(Protocol):
    """Takes in every control tick of a run, after the stack; it must change nothing in it."""

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Take in one control tick: reading, the stack's command for it, and the true pose."""
        ...

    def close(self) -> None:
        """End: the run is over."""
        ...


@dataclass(frozen=True, slots=True)
class SeenRun:
    """What the channels show besides the readings: the stack at work, and the world around it."""

    stack: Stack
    outline: WorldOutline
