"""Drives to learn from: landmark positions for a map, OFFIS situations for a situation model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfw.errors import MapError
from navfw.features.combined_landmarks import Landmarks
from navfw.features.landmark_appearance import landmark_kind
from navfw.localization.situation_model import observed_situations
from navfw.missions.runner import MissionLoop, Progress, RunResult
from navfw.missions.session import Session
from navfw.signals import Odometry, Percept, Pose, SensorReading, Twist
from navfw.stack import Stack
from navfw.topomap import TopoMap
from navfw.topomap.landmark_mapping import LandmarkEstimate, LandmarkMapper, with_landmarks

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


@dataclass(frozen=True)
class LearningDrive:
    """The mission's run, the landmarks found, and the map with these landmarks."""

    run: RunResult
    learnt: tuple[LandmarkEstimate, ...]
    topo_map: TopoMap

    def as_data(self, session: Session) -> dict[str, Any]:
        """Plain data; ``error_m`` is the distance [m] from the true position in the world."""
        marks = {f"{mark.kind}-{mark.id}": mark for mark in session.world.landmarks}
        rows = []
        for landmark in self.learnt:
            true = marks.get(landmark.identity)
            error = None if true is None else math.dist((landmark.x, landmark.y), true.at)
            rows.append(
                {
                    "identity": landmark.identity,
                    "x": landmark.x,
                    "y": landmark.y,
                    "sigma_m": landmark.sigma,
                    "observations": landmark.observations,
                    "error_m": error,
                }
            )
        return {
            "outcome": str(self.run.verdict.outcome),
            "reason": self.run.verdict.reason,
            "world": session.world_name,
            "mission": session.mission_name,
            "seed": session.seed,
            "learnt": len(rows),
            "landmarks": rows,
        }


class _LandmarkRecorder:
    """Passes the stack's landmark detections to a ``LandmarkMapper``."""

    def __init__(self, stack: Stack, mapper: LandmarkMapper) -> None:
        self._stack = stack
        self._mapper = mapper
        self._last = -math.inf

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        state = self._stack.state
        if state.landmark_detections and state.time > self._last:
            self._last = state.time
            taken = state.landmark_detections[0].time  # the image may be older than the decision
            self._mapper.integrate(self._stack.history.at(taken), state.landmark_detections)

    def close(self) -> None:
        """The mapper has it all."""


def learn_landmarks(
    session: Session, progress: Callable[[Progress], None] | None = None, least: int = 3
) -> LearningDrive:
    """Drive the session's mission; landmarks detected at least ``least`` times go into the map.

    A stack whose feature recognition takes no landmark frames gets the recogniser ``landmarks``.

    Raises:
        MapError: the start is unknown, or no landmark was detected often enough.

    """
    stack = session.stack
    if not session.task.start_known:
        raise MapError(
            "learning landmarks needs a known start; choose a mission without start: unknown",
            file=session.mission.file,
        )
    if not stack.features.landmark_frames:
        stack.features.plugin = Landmarks(stack.robot)
    mapper = LandmarkMapper(session.mission.start)
    with session.simulation() as simulator:
        observers = [_LandmarkRecorder(stack, mapper)]
        run = MissionLoop(session.task, stack, simulator, progress, observers).run()
    learnt = mapper.estimate(least)
    if not learnt:
        raise MapError(
            f"no landmark was detected {least} times (the mission ended {run.verdict.outcome});"
            " check that the world has landmarks along the path",
            file=session.mission.file,
        )
    return LearningDrive(run, tuple(learnt), with_landmarks(stack.topo_map, learnt, _default_size))


def _default_size(kind: str) -> float:
    """Side [m] of landmarks of a kind that are not in the map yet."""
    return landmark_kind(kind).default_size
