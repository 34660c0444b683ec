"""The outcome of a mission and its reason."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["MissionVerdict", "Outcome"]


class Outcome(StrEnum):
    """How a mission ended."""

    REACHED = "reached"
    """the stack has finished, and the robot truly stands in the success zone"""
    COLLIDED = "collided"
    """the robot touched something other than the floor, or fell into a drop"""
    TIMEOUT = "timeout"
    """the mission's time limit was reached"""
    STUCK = "stuck"
    """no progress for too long"""
    LOST = "lost"
    """the stack has finished, but a goal was not reached; or the time limit was reached and the
    stack's belief is lost"""
    FAULT = "fault"
    """the stack or the simulator failed"""
    CANCELLED = "cancelled"
    """stopped by the user"""

    @property
    def succeeded(self) -> bool:
        """Whether the mission was accomplished."""
        return self is Outcome.REACHED

    @property
    def exit_code(self) -> int:
        """The exit code of ``navfw run``: 0 accomplished, 1 not."""
        return 0 if self.succeeded else 1


@dataclass(frozen=True, slots=True)
class MissionVerdict:
    """The outcome with its ``reason``, the last leading behaviour, the control tick and time [s].

    ``trace`` is the Python traceback of an exception, empty otherwise.
    """

    outcome: Outcome
    reason: str
    behavior: str
    tick: int
    time: float
    trace: str = ""

    def __str__(self) -> str:
        led = f" (leading behaviour: {self.behavior})" if self.behavior else ""
        return f"{self.outcome} after {self.time:.1f} s: {self.reason}{led}"
