"""A mission driven tick by tick from Python, with all that passes between the stages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from navfw.errors import InputError
from navfw.missions.outcome import MissionVerdict
from navfw.missions.session import MissionResult, Session
from navfw.signals import (
    Array,
    FlowField,
    Image,
    Percept,
    Pose,
    Proposal,
    SensorReading,
    Twist,
)
from navfw.stack.stack_state import StackState


@dataclass(frozen=True, slots=True)
class TickView:
    """One control tick: what the robot sensed, inferred and did; and its true pose.

    ``twist`` (2,) are v [m/s] and w [rad/s] that the stack gave to the wheels. ``true_pose`` (3,)
    is x, y [m], yaw [rad] in the map, from the simulator; the stack does not get it. ``state`` is
    the whole state of the stack.
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
        """(height, width) uint8: the camera image that came with this tick; None without one."""
        return None if self.reading.frame is None else self.reading.frame.image

    @property
    def flow(self) -> FlowField | None:
        """The newest derotated flow: ``points``, ``vectors`` (rows, cols, 2) [px] and more."""
        return self.state.flows[-1] if self.state.flows else None

    @property
    def percept(self) -> Percept | None:
        """The newest percept: ``nearness`` (rows, cols) [1/m], ``label``, ``sentence`` and more."""
        return self.state.percept

    @property
    def proposals(self) -> Mapping[str, Proposal]:
        """Each behaviour's ``desirability``, ``prohibition`` (n_v, n_w) of the last decision."""
        return self.state.proposals or {}

    @property
    def command(self) -> Array | None:
        """(2,): v [m/s] and w [rad/s] that MOFIS decided on; None before the first decision."""
        command = self.state.command
        return None if command is None else np.array([command.twist.v, command.twist.w])

    @property
    def leader(self) -> str:
        """The leading behaviour; empty without a command."""
        return "" if self.state.command is None else self.state.command.leader

    @property
    def estimated_pose(self) -> Array | None:
        """(3,): the pose that the stack believes in, x, y [m], yaw [rad]; None without one."""
        if self.state.belief is None:
            return None
        pose = self.state.belief.pose
        return np.array([pose.x, pose.y, pose.yaw])


class SteppedSession:
    """A mission to step through; a context manager, and an iterator over its ticks.

    The commands are those of ``navfw.run`` with the same arguments, bit for bit. ``result`` is the
    mission's result, once it has ended.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self._drive = session.drive(observers=(self,))
        self._open = False
        self._verdict: MissionVerdict | None = None
        self._last: TickView | None = None
        self._result: MissionResult | None = None

    def __enter__(self) -> Self:
        self._drive.__enter__()
        self._open = True
        return self

    def __exit__(self, *exception: object) -> None:
        if self._open:
            self._open = False
            self._drive.__exit__(*exception)

    def __iter__(self) -> Iterator[TickView]:
        while (tick := self.step()) is not None:
            yield tick

    @property
    def ended(self) -> bool:
        """Whether the mission has ended."""
        return self._verdict is not None

    def step(self) -> TickView | None:
        """Drive one control tick; None once the mission has ended.

        Raises:
            InputError: the session is not open, or the stack refuses the mission.
            KeyboardInterrupt: the user has stopped the run.

        """
        if self._verdict is not None:
            return None
        if not self._open:
            raise InputError("the session is not open: use it as in `with open_session(...) as s:`")
        self._last = None
        self._verdict = self._drive.advance()
        if self._verdict is not None:
            run = self._drive.loop.result(self._verdict)
            self.__exit__()
            self._result = self.session.result(self._drive, run)
            if self._verdict.outcome == "cancelled":
                raise KeyboardInterrupt
        return self._last

    def explain(self) -> dict[str, Any]:
        """Why the last command was given, as plain data (``Stack.explain``)."""
        return self.session.stack.explain()

    @property
    def result(self) -> MissionResult:
        """The result of the mission.

        Raises:
            InputError: the mission has not ended.

        """
        if self._result is None:
            raise InputError("the mission has not ended: step until `ended`")
        return self._result

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Take in one tick of the loop (``navfw.recording.run_observer.RunObserver``)."""
        self._last = TickView(
            reading,
            self.session.stack.state,
            np.array([twist.v, twist.w]),
            np.array([pose.x, pose.y, pose.yaw]),
        )

    def close(self) -> None:
        """The run has ended (``RunObserver``)."""
