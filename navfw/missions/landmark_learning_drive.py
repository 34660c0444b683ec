"""Drive a mission to learn where the landmarks are, from what the stack sees alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from navfw.errors import MapError
from navfw.features.combined_landmarks import Landmarks
from navfw.missions.runner import Progress, RunResult, run_task
from navfw.missions.session import Session
from navfw.missions.stack_observer import StackObserver
from navfw.signals import SensorReading
from navfw.stack import Stack, StackState
from navfw.topomap import TopoMap
from navfw.topomap.landmark_mapping import LandmarkEstimate, LandmarkMapper, with_landmarks

__all__ = ["LearningDrive", "learn_landmarks"]


@dataclass(frozen=True)
class LearningDrive:
    """What came of it: the mission's run, the landmarks found, the map with them."""

    run: RunResult
    learnt: tuple[LandmarkEstimate, ...]
    topo_map: TopoMap

    def as_data(self, session: Session) -> dict[str, Any]:
        """Plain data; ``error_m`` is how far each is from where the world has it."""
        marks = {f"{mark.kind}-{mark.id}": mark for mark in session.world.landmarks}
        rows = []
        for found in self.learnt:
            true = marks.get(found.identity)
            error = None if true is None else math.dist((found.x, found.y), true.at)
            rows.append(
                {
                    "identity": found.identity,
                    "x": found.x,
                    "y": found.y,
                    "sigma_m": found.sigma,
                    "observations": found.observations,
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


class _LandmarkRecorder(StackObserver):
    """Writes down which landmarks the stack sees."""

    def __init__(self, stack: Stack, mapper: LandmarkMapper) -> None:
        super().__init__(stack)
        self._mapper = mapper
        self._heard = -math.inf

    def hear(self, reading: SensorReading, state: StackState) -> None:
        del reading
        if state.landmark_detections and state.time > self._heard:
            self._heard = state.time
            seen = state.landmark_detections[0].time  # the image may be older than the decision
            self._mapper.integrate(self.stack.history.at(seen), state.landmark_detections)


def learn_landmarks(
    session: Session, progress: Callable[[Progress], None] | None = None, least: int = 3
) -> LearningDrive:
    """Drive the session's mission; landmarks seen ``least`` times or more go into the map.

    A stack without feature recognition that asks for landmark frames is given ``landmarks``.

    Raises:
        MapError: the robot is not told where it starts, or saw nothing often enough.

    """
    stack = session.stack
    if not session.task.start_known:
        raise MapError(
            "landmarks are learnt from a known start; choose a mission that does not say"
            " start: unknown",
            file=session.mission.file,
        )
    if not stack.features.landmark_frames:
        stack.features = Landmarks(stack.robot)
    mapper = LandmarkMapper(session.mission.start)
    with session.simulation() as simulator:
        run = run_task(session.task, _LandmarkRecorder(stack, mapper), simulator, progress)
    learnt = mapper.estimate(least)
    if not learnt:
        raise MapError(
            f"no landmark was seen {least} times on the way (the mission ended"
            f" {run.verdict.outcome}); has the world any?",
            file=session.mission.file,
        )
    return LearningDrive(run, tuple(learnt), with_landmarks(stack.topo_map, learnt))
