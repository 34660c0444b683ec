"""The interfaces of the mission loop: the pilot and the simulator that it drives, and its ticks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from navfw.numerics import Array, Image
from navfw.signals import FlowField, Percept, Pose, Proposal, SensorReading, Twist, Waypoint
from navfw.stack.stack_state import StackState


class Pilot(Protocol):
    """The controller of the robot: ``navfw.stack.Stack``, or a fake."""

    def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        """Start at ``pose`` in ``map`` (None: unknown), with ``goals`` to visit in order."""

    def step(self, reading: SensorReading) -> Twist:
        """Take in the sensors' ``reading``; return the twist to drive until the next tick."""

    @property
    def state(self) -> StackState:
        """The pilot's state after the last step."""


class Simulator(Protocol):
    """The robot and its world: ``navfw.sim.simulation.Simulation``, or a fake."""

    def read(self) -> SensorReading:
        """Return the current sensor reading."""

    def drive(self, left: float, right: float) -> None:
        """Set the speeds of the left and right wheel [rad/s]."""

    def advance(self, dt: float) -> None:
        """Simulate ``dt`` [s]."""

    def true_pose(self) -> Pose:
        """Return the robot's true pose in ``map``."""

    @property
    def contacts(self) -> Sequence[str]:
        """Bodies touched, and drops fallen into, during the last ``advance``; not the floor."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""


@dataclass(frozen=True, slots=True)
class TickView:
    """One control tick: what the robot sensed, inferred and did, and its true pose.

    ``twist`` (2,) is v [m/s] and w [rad/s] that the stack gave to the wheels. ``true_pose`` (3,) is
    x, y [m], yaw [rad] in ``map``, from the simulator; the stack does not get it. ``state`` is the
    whole state of the stack.
    """

    reading: SensorReading
    state: StackState
    twist: Array
    true_pose: Array

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.reading.time

    @property
    def image(self) -> Image | None:
        """(height, width) uint8: the camera image that came with this tick; None if none came."""
        return None if self.reading.frame is None else self.reading.frame.image

    @property
    def flow(self) -> FlowField | None:
        """The newest derotated flow: ``points``, ``vectors`` (rows, cols, 2) [px], ...; or None."""
        return self.state.flows[-1] if self.state.flows else None

    @property
    def percept(self) -> Percept | None:
        """The newest percept: ``nearness`` (rows, cols) [1/m], ``label``, ...; or None."""
        return self.state.percept

    @property
    def proposals(self) -> Mapping[str, Proposal]:
        """By behaviour, ``desirability`` and ``prohibition`` (n_v, n_w) of the last decision."""
        return self.state.proposals or {}

    @property
    def command(self) -> Array | None:
        """(2,): v [m/s] and w [rad/s] that MOFIS decided on; None before the first decision."""
        command = self.state.command
        return None if command is None else np.array([command.twist.v, command.twist.w])

    @property
    def leader(self) -> str:
        """The name of the behaviour that led the last command; empty without a command."""
        return "" if self.state.command is None else self.state.command.leader

    @property
    def estimated_pose(self) -> Array | None:
        """(3,): the stack's pose estimate in ``map``, x, y [m], yaw [rad]; None without one."""
        if self.state.belief is None:
            return None
        pose = self.state.belief.pose
        return np.array([pose.x, pose.y, pose.yaw])


Watcher: TypeAlias = Callable[[TickView], object]
"""A function that is called with every control tick of a run; it must change nothing."""


def watcher_of(observe: Callable[[SensorReading, Twist, Pose], object]) -> Watcher:
    """Make a watcher that calls ``observe`` with the reading, the twist and the true pose."""
    return lambda tick: observe(
        tick.reading, Twist(*tick.twist.tolist()), Pose(*tick.true_pose.tolist())
    )
