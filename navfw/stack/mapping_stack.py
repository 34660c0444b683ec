"""A stack that watches while somebody else drives the robot, and maps what it sees."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.features.recognizers import Aruco
from navfw.localization.place_probabilities import observed_situations
from navfw.mapping import GrowingMap
from navfw.robot import RobotModel
from navfw.signals import Belief, Frame, LandmarkDetection, Percept, Pose, SensorReading, Twist
from navfw.stack.stack import Stack
from navfw.stack.stack_state import StackState
from navfw.stack.stackfile import StackConfig
from navfw.stack.vision import ready_frame, straight_reading
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


class MappingStack(Stack):
    """Runs the perceiving half of a stack: odometry, vision, local map; and the growing map.

    Nothing is planned or decided. The stack file says ``growing_map: true``; ``growing`` is the map
    so far, in which the state's belief is; ``sightings`` are those since the stack was loaded.
    """

    def __init__(self, config: StackConfig, robot: RobotModel, topo_map: TopoMap) -> None:
        super().__init__(config, robot, topo_map)
        self._markers = Aruco(robot)
        self._larger = False  # whether there are images for landmarks
        self.sightings: list[Sighting] = []

    @property
    def growing(self) -> GrowingMap:
        """The map so far."""
        return self.growth.growing_map

    def _step(self, reading: SensorReading) -> Twist:
        measured = self.odometer.update(reading.inertial, reading.encoders)
        self.history.add(measured)
        self.safety.update(reading, measured)
        reading = straight_reading(reading, self._lens)
        frame = ready_frame(reading.frame, self.robot, self._reduction, self.history)
        odometry = self._corrected(measured, frame)
        if frame is not None:
            seen_from = self._corrected(self.history.at(frame.time))
            view, _ = self._perceive(reading, frame, seen_from)
            self._larger |= reading.landmark_frame is not None
            shown = reading.landmark_frame if self._larger else reading.frame
            self._sight(shown, view.percept, seen_from.pose)
            moving = self._observe(frame, view, odometry, seen_from.pose)
            self.growth.update(odometry, self.local_map, moving, view.percept, seen_from.pose)
            belief = Belief(odometry.time, self.growing.pose, np.zeros((3, 3)))
            percept = view.percept or self.state.percept
            self.state = StackState(reading.time, odometry, belief, view.flows, percept)
        return odometry.twist

    def _sight(self, shown: Frame | None, percept: Percept | None, pose: Pose) -> None:
        """Keep what is ``shown``, unless the robot is still where it was at the last sighting."""
        if shown is None or not self.safety.senses.seeing:
            return
        if self.sightings:
            step = self.sightings[-1].pose.relative(pose)
            if math.hypot(step.x, step.y) < _NEXT and abs(step.yaw) < _NEXT:
                return
        seen = self._markers.recognize(shown), observed_situations(percept)
        self.sightings.append(Sighting(len(self.growing.keys), pose, *seen))
