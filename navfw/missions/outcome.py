"""How a mission ended, in one word and in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["MissionVerdict", "Outcome"]


class Outcome(StrEnum):
    """How a mission ended."""

    REACHED = "reached"
    """the stack says it has finished, and truly stands in the success zone"""
    COLLIDED = "collided"
    """the robot touched something other than the floor, or fell into a drop"""
    TIMEOUT = "timeout"
    """the mission's time was up"""
    STUCK = "stuck"
    """no progress for too long"""
    LOST = "lost"
    """the stack says it has finished, but is elsewhere; or its time is up, and it says that it does
    not know where it is"""
    FAULT = "fault"
    """the stack or the simulator failed"""
    CANCELLED = "cancelled"
    """a person stopped it"""

    @property
    def succeeded(self) -> bool:
        """Whether the mission was accomplished."""
        return self is Outcome.REACHED

    @property
    def exit_code(self) -> int:
        """What ``navfw run`` exits with: 0 accomplished, 1 not."""
        return 0 if self.succeeded else 1


@dataclass(frozen=True, slots=True)
class MissionVerdict:
    """The outcome with its ``reason``, the behaviour that led last, the control tick and time [s].

    ``trace`` is the Python traceback of a fault, for whoever has to mend it.
    """

    outcome: Outcome
    reason: str
    behavior: str
    tick: int
    time: float
    trace: str = ""

    def __str__(self) -> str:
        led = f" ({self.behavior} led)" if self.behavior else ""
        return f"{self.outcome} after {self.time:.1f} s: {self.reason}{led}"
