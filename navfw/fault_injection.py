"""Behaviours made to fail on purpose: what a mission's events, and their replay, do to a stack."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from navfw.interfaces import Behavior
from navfw.mofis.context import Context
from navfw.mofis.watchdog import BehaviorTimeout
from navfw.signals import Proposal

__all__ = ["Failure", "FaultInjector", "inject_faults"]

Failure = Literal["raises", "hangs", "returns_nan"]


class FaultInjector(Behavior):
    """Stands in front of a behaviour; without a failure in force it passes all questions on."""

    name: ClassVar[str] = "saboteur"

    def __init__(self, behavior: Behavior) -> None:
        super().__init__(behavior.robot, behavior.params)
        self.behavior = behavior
        self.handles_moving_obstacles = behavior.handles_moving_obstacles
        self._active: list[Failure] = []

    def begin(self, failure: Failure) -> None:
        """From the next question on; the newest failure counts."""
        self._active.append(failure)

    def end(self, failure: Failure) -> None:
        """Leave the behaviour in peace."""
        self._active.remove(failure)

    def reset(self) -> None:
        """Start a run."""
        self._active.clear()
        self.behavior.reset()

    def propose(self, context: Context) -> Proposal:
        """The behaviour's proposal, or the failure in force."""
        match self._active[-1] if self._active else None:
            case "raises":
                raise RuntimeError("made to raise by an event of the mission")
            case "hangs":
                raise BehaviorTimeout("made to hang by an event of the mission")
            case "returns_nan":
                nothing = np.full(context.commands.shape, np.nan)
                return Proposal(1.0, nothing, nothing, "made to return NaN")
            case _:
                return self.behavior.propose(context)


def inject_faults(behaviors: dict[str, Behavior], name: str) -> FaultInjector:
    """Put a saboteur in front of the behaviour ``name``, unless there is one; return it."""
    found = behaviors[name]
    if not isinstance(found, FaultInjector):
        found = behaviors[name] = FaultInjector(found)
    return found
