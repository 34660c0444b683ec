"""Recorded drives: OFFIS situations with true poses, to learn a situation model from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from navfw.localization.situation_model import observed_situations
from navfw.missions.runner import MissionLoop
from navfw.missions.session import Session
from navfw.signals import Odometry, Percept, Pose, SensorReading, Twist
from navfw.stack import Stack
from navfw.topomap import TopoMap

SPACING = 0.25
"""Driven distance [m] from one sample to the next: nearer frames show the same surroundings."""


@dataclass(frozen=True, slots=True)
class SituationSample:
    """A camera frame: odometry, degrees of OFFIS situations (None: no inference), true pose."""

    odometry: Odometry
    situations: Mapping[str, float] | None
    true: Pose


@dataclass(frozen=True)
class SituationDrive:
    """A drive in the world of a map, one sample per camera frame."""

    topo_map: TopoMap
    start: Pose
    samples: tuple[SituationSample, ...]
    outcome: str

    def observations(self) -> Iterator[tuple[str, Mapping[str, float]]]:
        """Kind of the true place, and degrees of OFFIS situations, at least SPACING apart."""
        kinds = [place.kind for place in self.topo_map.places.values()]
        driven = 0.0
        last = self.start
        for sample in self.samples:
            driven += math.hypot(sample.true.x - last.x, sample.true.y - last.y)
            last = sample.true
            if sample.situations is not None and driven >= SPACING:
                driven = 0.0
                yield kinds[self.place_at(sample.true)], sample.situations

    def place_at(self, pose: Pose) -> int:
        """The index of the place nearest to ``pose``."""
        places = self.topo_map.places.values()
        return int(np.argmin([place.distance(pose.x, pose.y) for place in places]))


class _SituationRecorder:
    """Records the OFFIS situations and the true pose of every camera frame."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._percept: Percept | None = None
        self.samples: list[SituationSample] = []

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        state = self._stack.state
        if reading.frame is None or state.odometry is None:
            return
        new = state.percept if state.percept is not self._percept else None
        self._percept = state.percept
        self.samples.append(SituationSample(state.odometry, observed_situations(new), pose))

    def close(self) -> None:
        """The samples stay."""


def record_situations(session: Session) -> SituationDrive:
    """Drive the session's mission, without its events, and record the OFFIS situations.

    Raises:
        InputError: the stack refuses the mission before the robot has moved.

    """
    recorder = _SituationRecorder(session.stack)
    with session.simulation() as simulator:
        run = MissionLoop(session.task, session.stack, simulator, observers=[recorder]).run()
    return SituationDrive(
        session.mission.topo_map,
        session.mission.start,
        tuple(recorder.samples),
        str(run.verdict.outcome),
    )
