"""The outcome of a mission and its reason."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


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
    UNSURE = "unsure"
    """the robot is at its goal by an estimate that is too uncertain, and found no more evidence"""
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


class FaultKind(StrEnum):
    """What ended a run with the outcome fault."""

    EXCEPTION = "exception"
    """an exception"""
    PLUGIN_FAILED = "plugin_failed"
    """a plugin failed at the start of the run, or a stage failed for too long"""
    SENSOR_FAILED = "sensor_failed"
    """the stack stopped, because a sensor had failed for good"""
    NOTHING_SEEN = "nothing_seen"
    """the stack stopped, because nothing could be seen of the path ahead"""
    BAD_COMMAND = "bad_command"
    """the stack commanded a value that is not finite"""
    CODE_REPLACED = "code_replaced"
    """functions of navfw were replaced during the run"""
    TOO_LONG = "too_long"
    """the run exceeded its wall-clock limit"""


@dataclass(frozen=True, slots=True)
class MissionVerdict:
    """The outcome with its ``reason``, the last leading behaviour, the control tick and time [s].

    ``fault`` is the kind of a fault, None for other outcomes. ``trace`` is the Python traceback of
    an exception, empty otherwise.
    """

    outcome: Outcome
    reason: str
    behavior: str
    tick: int
    time: float
    fault: FaultKind | None = None
    trace: str = ""

    def __str__(self) -> str:
        led = f" (leading behaviour: {self.behavior})" if self.behavior else ""
        return f"{self.outcome} after {self.time:.1f} s: {self.reason}{led}"
