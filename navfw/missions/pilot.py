"""What the loop of a mission drives: a pilot and a simulator, or fakes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from navfw.safety import PersistentFailure
from navfw.signals import Belief, Command, Percept, Pose, SensorReading, Sight, Twist, Waypoint


class PilotState(Protocol):
    """The part of a stack's state (``StackState``) that the runner reads."""

    @property
    def belief(self) -> Belief | None: ...  # noqa: D102
    @property
    def path(self) -> tuple[Waypoint, ...]: ...  # noqa: D102
    @property
    def percept(self) -> Percept | None: ...  # noqa: D102
    @property
    def command(self) -> Command | None: ...  # noqa: D102
    @property
    def finished(self) -> bool: ...  # noqa: D102
    @property
    def stuck(self) -> str | None: ...  # noqa: D102
    @property
    def unsure(self) -> bool: ...  # noqa: D102
    @property
    def sight(self) -> Sight: ...  # noqa: D102
    @property
    def fault(self) -> PersistentFailure | None:
        """What has failed for good, or None."""
        ...

    @property
    def faults(self) -> tuple[str, ...]:
        """All kinds of plugin faults so far, each with its count."""
        ...


class Pilot(Protocol):
    """The controller of the robot: ``navfw.stack.Stack`` or ``navfw.testing.fakes.FakePilot``."""

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Start at ``pose`` in ``map`` (None: unknown), with ``goals`` to visit in order."""
        ...

    def step(self, reading: SensorReading) -> Twist:
        """The twist to drive until the next control tick."""
        ...

    @property
    def state(self) -> PilotState:
        """Its state after the last step."""
        ...

    @property
    def timings(self) -> Mapping[str, float]:
        """Computing time [s] so far, by stage."""
        ...


class Simulator(Protocol):
    """The robot and its world: ``navfw.sim.simulation.Simulation``, or a fake."""

    def read(self) -> SensorReading:
        """The current sensor reading."""
        ...

    def drive(self, left: float, right: float) -> None:
        """Set the wheel speeds [rad/s]."""
        ...

    def advance(self, dt: float) -> None:
        """Simulate ``dt`` [s]."""
        ...

    def true_pose(self) -> Pose:
        """The robot's true pose."""
        ...

    @property
    def contacts(self) -> Sequence[str]:
        """Bodies touched, and drops fallen into, during the last ``advance``; not the floor."""
        ...

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...
