"""Drive a mission and estimate landmark positions from odometry and landmark detections."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from navfw.errors import MapError
from navfw.features.combined_landmarks import Landmarks
from navfw.features.landmark_appearance import landmark_kind
from navfw.missions.runner import MissionLoop, Progress, RunResult
from navfw.missions.session import Session
from navfw.signals import Pose, SensorReading, Twist
from navfw.stack import Stack
from navfw.topomap import TopoMap
from navfw.topomap.landmark_mapping import LandmarkEstimate, LandmarkMapper, with_landmarks


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
