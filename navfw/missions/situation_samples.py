"""Drives of which it is noted what OFFIS said, and where the robot truly was: to learn from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from navfw.localization.situation_model import observed_situations
from navfw.missions.runner import Simulator, run_task
from navfw.missions.session import Session
from navfw.missions.stack_observer import StackObserver
from navfw.signals import Odometry, Percept, Pose, SensorReading
from navfw.stack import Stack, StackState
from navfw.topomap import TopoMap

__all__ = ["SituationDrive", "SituationSample", "record_situations"]

SPACING = 0.25
"""One look is taken in so much of the way [m]."""


@dataclass(frozen=True, slots=True)
class SituationSample:
    """A camera frame: odometry, what OFFIS said (degrees; None: nothing), and the true pose."""

    odometry: Odometry
    situations: Mapping[str, float] | None
    true: Pose


@dataclass(frozen=True)
class SituationDrive:
    """A drive through the world of a map, frame by frame."""

    topo_map: TopoMap
    start: Pose
    moments: tuple[SituationSample, ...]
    outcome: str

    def observations(self) -> Iterator[tuple[str, Mapping[str, float]]]:
        """The kind of the place where the robot truly was, and what OFFIS said there."""
        kinds = [place.kind for place in self.topo_map.places.values()]
        waiting = 0.0
        last = self.start
        for moment in self.moments:
            waiting += math.hypot(moment.true.x - last.x, moment.true.y - last.y)
            last = moment.true
            if moment.situations is not None and waiting >= SPACING:
                waiting = 0.0
                yield kinds[self.place_at(moment.true)], moment.situations

    def place_at(self, pose: Pose) -> int:
        """The index of the place that is nearest to ``pose``."""
        places = self.topo_map.places.values()
        return int(np.argmin([place.distance(pose.x, pose.y) for place in places]))


class _SituationRecorder(StackObserver):
    """Writes down what OFFIS says, and knows the truth."""

    def __init__(self, stack: Stack, simulator: Simulator) -> None:
        super().__init__(stack)
        self._simulator = simulator
        self._percept: Percept | None = None
        self.moments: list[SituationSample] = []

    def hear(self, reading: SensorReading, state: StackState) -> None:
        if reading.frame is None or state.odometry is None:
            return
        new = state.percept if state.percept is not self._percept else None
        self._percept = state.percept
        moment = SituationSample(
            state.odometry, observed_situations(new), self._simulator.true_pose()
        )
        self.moments.append(moment)


def record_situations(session: Session) -> SituationDrive:
    """Drive the session's mission (without its events), and note what OFFIS says.

    Raises:
        InputError: the stack refuses the mission before the robot has moved.

    """
    with session.simulation() as simulator:
        witness = _SituationRecorder(session.stack, simulator)
        run = run_task(session.task, witness, simulator)
    return SituationDrive(
        session.mission.topo_map,
        session.mission.start,
        tuple(witness.moments),
        str(run.verdict.outcome),
    )
