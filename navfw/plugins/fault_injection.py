"""Fault injection: events of a mission, or of its replay, make a behaviour fail."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from navfw.context import Context
from navfw.interfaces import Behavior
from navfw.process import PluginTimeout
from navfw.signals import Proposal

Failure = Literal["raises", "hangs", "returns_nan"]
"""How a behaviour fails: an exception, a time-out, or a proposal of NaN."""


class FaultInjector(Behavior):
    """Wraps a behaviour and, while a failure is active, fails instead of it."""

    name: ClassVar[str] = "fault_injector"

    def __init__(self, behavior: Behavior) -> None:
        super().__init__(behavior.robot, behavior.params)
        self.behavior = behavior
        self.handles_moving_obstacles = behavior.handles_moving_obstacles
        self._active: list[Failure] = []

    def begin(self, failure: Failure) -> None:
        """Activate ``failure`` from the next proposal on; the one activated last applies."""
        self._active.append(failure)

    def end(self, failure: Failure) -> None:
        """Deactivate ``failure``."""
        self._active.remove(failure)

    def reset(self) -> None:
        """Deactivate all failures and reset the wrapped behaviour."""
        self._active.clear()
        self.behavior.reset()

    def propose(self, context: Context) -> Proposal:
        """Return the wrapped behaviour's proposal, or fail in the active way.

        Raises:
            RuntimeError: the failure ``raises`` is active.
            PluginTimeout: the failure ``hangs`` is active.

        """
        match self._active[-1] if self._active else None:
            case "raises":
                raise RuntimeError("injected exception (event of the mission)")
            case "hangs":
                raise PluginTimeout("injected time-out (event of the mission)")
            case "returns_nan":
                invalid = np.full(context.commands.shape, np.nan)
                return Proposal(1.0, invalid, invalid, "injected NaN (event of the mission)")
            case _:
                return self.behavior.propose(context)


def inject_faults(behaviors: dict[str, Behavior], name: str) -> FaultInjector:
    """Wrap the behaviour ``name`` in ``behaviors`` in a fault injector, once, and return it."""
    behavior = behaviors[name]
    if not isinstance(behavior, FaultInjector):
        behavior = behaviors[name] = FaultInjector(behavior)
    return behavior
