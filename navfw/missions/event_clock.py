"""Events during a run: when each begins and ends, and the record of those that happened."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from navfw.plugins.fault_injection import Failure
from navfw.signals import Pose
from navfw.sim.event_actions import EventAction


@dataclass(frozen=True, slots=True)
class Event:
    """A checked event: it begins at ``at`` [s], or within ``within`` [m] of ``point`` (map frame).

    ``lasting`` [s] may be infinite. ``spec`` is the event as the mission file has it. ``behavior``
    is the name of the behaviour that the event makes fail, else empty.
    """

    action: EventAction | Failure
    spec: Mapping[str, Any]
    at: float | None = None
    point: tuple[float, float] | None = None
    within: float = 0.0
    lasting: float = math.inf
    behavior: str = ""

    def due(self, time: float, robot: Pose) -> bool:
        """Whether it begins at ``time`` [s], with the robot's true pose ``robot``."""
        if self.at is not None:
            return time >= self.at - 1e-9
        assert self.point is not None  # noqa: S101 - an event has either a time or a point
        return math.hypot(robot.x - self.point[0], robot.y - self.point[1]) <= self.within


@dataclass(slots=True)
class EventRecord:
    """An event that happened, from ``began`` to ``ended`` [s]; None: to the end of the run."""

    spec: Mapping[str, Any]
    began: float
    ended: float | None = None

    def as_data(self) -> dict[str, Any]:
        """Plain data for ``result.json``."""
        return {"event": dict(self.spec), "began_s": self.began, "ended_s": self.ended}


class EventTarget(Protocol):
    """What an event's action applies to: the simulation, or a behaviour of the stack."""

    def begin(self, action: Any) -> None:
        """Apply the action."""

    def end(self, action: Any) -> None:
        """Revert the action."""


class EventClock:
    """Begins and ends the events of one run, and records their times."""

    def __init__(self, events: Iterable[tuple[Event, EventTarget]]) -> None:
        self._waiting = list(events)
        self._running: list[tuple[Event, EventTarget, EventRecord]] = []
        self._log: list[EventRecord] = []

    @property
    def log(self) -> tuple[EventRecord, ...]:
        """The events so far, in the order in which they began."""
        return tuple(self._log)

    def tick(self, time: float, robot: Pose) -> None:
        """End and begin the events due at ``time`` [s]; ``robot`` is the robot's true pose."""
        if not (self._running or self._waiting):
            return
        for event, target, record in self._running:
            if time - record.began >= event.lasting - 1e-9:
                target.end(event.action)
                record.ended = time
        self._running = [running for running in self._running if running[2].ended is None]
        due = [waiting for waiting in self._waiting if waiting[0].due(time, robot)]
        self._waiting = [waiting for waiting in self._waiting if waiting not in due]
        for event, target in due:
            target.begin(event.action)
            self._log.append(EventRecord(event.spec, time))
            self._running.append((event, target, self._log[-1]))
