"""Drives to learn from: landmark positions for a map, OFFIS situations for a situation model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfw.errors import MapError
from navfw.features.landmark_appearance import landmark_kind
from navfw.features.recognizers import Aruco
from navfw.localization.place_probabilities import observed_situations
from navfw.missions.pilot import TickView
from navfw.missions.runner import MissionLoop
from navfw.missions.session import Session
from navfw.signals import Odometry, Percept, Pose
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


def record_situations(session: Session) -> SituationDrive:
    """Drive the session's mission, without its events, and record the OFFIS situations.

    Raises:
        InputError: the stack refuses the mission before the robot has moved.

    """
    samples: list[SituationSample] = []
    percept: Percept | None = None

    def sample(tick: TickView) -> None:
        nonlocal percept
        if tick.image is None or tick.state.odometry is None:
            return
        new = tick.percept if tick.percept is not percept else None
        percept = tick.percept
        true = Pose(*tick.true_pose.tolist())
        samples.append(SituationSample(tick.state.odometry, observed_situations(new), true))

    with session.simulation() as simulator:
        run = MissionLoop(session.task, session.stack, simulator, sample).run()
    mission, outcome = session.mission, str(run.verdict.outcome)
    return SituationDrive(mission.topo_map, mission.start, tuple(samples), outcome)


@dataclass(frozen=True)
class LearningDrive:
    """The mission's run, the landmarks found, and the map with these landmarks."""

    run: MissionLoop
    learnt: tuple[LandmarkEstimate, ...]
    topo_map: TopoMap

    def as_data(self, session: Session) -> dict[str, Any]:
        """Plain data; ``error_m`` is the distance [m] from the true position in the world."""
        marks = {f"{mark.kind}-{mark.id}": mark.at for mark in session.world.landmarks}
        rows = [
            {
                "identity": (name := learnt.identity),
                "x": learnt.x,
                "y": learnt.y,
                "sigma_m": learnt.sigma,
                "observations": learnt.observations,
                "error_m": math.dist((learnt.x, learnt.y), marks[name]) if name in marks else None,
            }
            for learnt in self.learnt
        ]
        return {
            "outcome": str(self.run.verdict.outcome),
            "reason": self.run.verdict.reason,
            "world": session.world_name,
            "mission": session.mission_name,
            "seed": session.seed,
            "learnt": len(rows),
            "landmarks": rows,
        }


def learn_landmarks(session: Session, least: int = 3) -> LearningDrive:
    """Drive the session's mission; landmarks detected at least ``least`` times go into the map.

    A stack whose feature recognition takes no landmark frames gets the recogniser ``aruco``.

    Raises:
        MapError: the start is unknown, or no landmark was detected often enough.

    """
    stack = session.stack
    if not session.task.start_known:
        raise MapError(
            "learning landmarks needs a known start; choose a mission without start: unknown",
            file=session.mission.file,
        )
    if not stack.features.plugin.landmark_frames:
        stack.features.plugin = Aruco(stack.robot)
    mapper = LandmarkMapper(session.mission.start)
    last = -math.inf

    def integrate(tick: TickView) -> None:
        nonlocal last
        state = tick.state
        if state.landmark_detections and state.time > last:
            last = state.time
            taken = state.landmark_detections[0].time  # the image may be older than the decision
            mapper.integrate(stack.history.at(taken), state.landmark_detections)

    with session.simulation() as simulator:
        run = MissionLoop(session.task, stack, simulator, integrate).run()
    learnt = mapper.estimate(least)
    if not learnt:
        raise MapError(
            f"no landmark was detected {least} times (the mission ended {run.verdict.outcome});"
            " check that the world has landmarks along the path",
            file=session.mission.file,
        )
    learnt_map = with_landmarks(
        stack.topo_map, learnt, lambda kind: landmark_kind(kind).default_size
    )
    return LearningDrive(run, tuple(learnt), learnt_map)
