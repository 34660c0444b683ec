"""A stack that watches while somebody else drives the robot, and maps what it sees."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from navfw.features.recognizers import Aruco
from navfw.localization.place_probabilities import observed_situations
from navfw.mapping import GrowingMap
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Frame,
    LandmarkDetection,
    OccupiedDisc,
    Odometry,
    Percept,
    Pose,
    SensorReading,
    Twist,
    Waypoint,
)
from navfw.stack.continuity import Continuity
from navfw.stack.map_growth import MapGrowth
from navfw.stack.sensing_stack import SensingStack
from navfw.stack.stackfile import StackConfig
from navfw.stack.vision import View
from navfw.topomap import TopoMap

_NEXT = 0.2  # chosen
"""Distance [m], or turn [rad], from one sighting to the next: nearer frames show the same."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """What a frame shows of where it was taken: markers, and degrees of OFFIS situations.

    ``pose`` (odom) is of the frame, ``key`` the number of the key pose that comes next.
    """

    key: int
    pose: Pose
    markers: Sequence[LandmarkDetection]
    situations: Mapping[str, float] | None


@dataclass(slots=True)
class MappedPart:
    """A part of a drive, from ``begin`` to ``end`` [s], in which the map ``growing`` has grown.

    ``why`` says why it ended there; empty at the end of the drive, and while it goes on.
    """

    growing: GrowingMap
    begin: float
    end: float
    why: str = ""
    sightings: list[Sighting] = field(default_factory=list)

    @property
    def path(self) -> float:
        """Length [m] of the part up to the last key pose."""
        return self.growing.keys[-1].path if self.growing.keys else 0.0


class MappingStack(SensingStack):
    """A ``SensingStack`` that grows a map.

    The stack file says ``growing_map: true``. ``parts`` are those of
    the drive so far: where a reading cannot be of the same drive as those before (``Continuity``),
    another map begins at the origin. The state's belief is in the map of the last part.
    """

    def __init__(self, config: StackConfig, robot: RobotModel, topo_map: TopoMap) -> None:
        super().__init__(config, robot, topo_map)
        self._markers = Aruco(robot)
        self._larger = False  # whether there are images for landmarks
        self._continuity = Continuity(robot)
        self.parts: list[MappedPart] = []

    @property
    def growing(self) -> GrowingMap:
        """The map of the last part so far."""
        return self.growth.growing_map

    def _start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        self.parts.clear()
        self._continuity = Continuity(self.robot)
        super()._start(pose, goals)

    def _watch(self, reading: SensorReading) -> None:
        """Begin the first part, or another one if the last has ended before ``reading``."""
        why = self._continuity.update(reading)
        if why:
            self.parts[-1].growing.end()
            self.parts[-1].why = why
            self.growth = MapGrowth(self.robot, self.resolved.settings.growing_map)
            super()._start(Pose(0.0, 0.0, 0.0), [])
            self._continuity = Continuity(self.robot)
            self._continuity.update(reading)
        if why or not self.parts:
            self.parts.append(MappedPart(self.growth.growing_map, reading.time, reading.time))
        self.parts[-1].end = reading.time

    def _step(self, reading: SensorReading) -> Twist:
        self._watch(reading)
        return super()._step(reading)

    def _take(
        self,
        reading: SensorReading,
        view: View,
        odometry: Odometry,
        seen_from: Pose,
        moving: tuple[OccupiedDisc, ...],
    ) -> tuple[Belief, Percept | None]:
        self._larger |= reading.landmark_frame is not None
        shown = reading.landmark_frame if self._larger else reading.frame
        self._sight(shown, view.percept, seen_from)
        self.growth.update(odometry, self.local_map, moving, view.percept, seen_from)
        belief = Belief(odometry.time, self.growing.pose, np.zeros((3, 3)))
        return belief, view.percept or self.state.percept

    def _sight(self, shown: Frame | None, percept: Percept | None, pose: Pose) -> None:
        """Keep what is ``shown``, unless the robot is still where it was at the last sighting."""
        if shown is None or not self.safety.senses.seeing:
            return
        part = self.parts[-1]
        if part.sightings:
            step = part.sightings[-1].pose.relative(pose)
            if math.hypot(step.x, step.y) < _NEXT and abs(step.yaw) < _NEXT:
                return
        seen = self._markers.recognize(shown), observed_situations(percept)
        part.sightings.append(Sighting(len(part.growing.keys), pose, *seen))
