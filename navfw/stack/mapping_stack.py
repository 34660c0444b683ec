"""A stack that watches while somebody else drives the robot, and maps what it sees."""

from __future__ import annotations

from collections.abc import Sequence

from navfw.mapping import GrowingMap
from navfw.robot import RobotModel
from navfw.signals import Frame, LandmarkDetection, Odometry, Pose, SensorReading, Twist, Waypoint
from navfw.stack.stack import Stack
from navfw.stack.stackfile import StackConfig
from navfw.stack.vision import ready_frame, straight_reading
from navfw.topomap import TopoMap


class MappingStack(Stack):
    """Runs the perceiving half of a stack: odometry, vision, local map; and the growing map.

    Nothing is planned or decided. ``growing`` is the map so far; ``sightings`` are the landmarks
    detected so far, with the robot's pose in ``odom``.
    """

    def __init__(self, config: StackConfig, robot: RobotModel, topo_map: TopoMap) -> None:
        super().__init__(config, robot, topo_map)
        self.growing = GrowingMap(self.robot)
        self.sightings: list[tuple[Odometry, tuple[LandmarkDetection, ...]]] = []

    def _start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
        super()._start(pose, goals)
        self.growing.reset(pose)
        self.sightings.clear()

    def _step(self, reading: SensorReading) -> Twist:
        measured = self.odometer.update(reading.inertial, reading.encoders)
        self.history.add(measured)
        self.safety.update(reading, measured)
        reading = straight_reading(reading, self._lens)
        frame = ready_frame(reading.frame, self.robot, self._reduction, self.history)
        odometry = self._corrected(measured, frame)
        if frame is not None:
            self._observe(reading, frame, odometry)
        return odometry.twist

    def _observe(self, reading: SensorReading, frame: Frame, odometry: Odometry) -> None:
        seen_from = self._corrected(self.history.at(frame.time))
        view, detections = self._perceive(reading, frame, seen_from)
        for correction in view.yaw_corrections:
            (self.floor_odometry or self.odometer).correct(correction)
        if detections:
            self.sightings.append((seen_from, detections))
        if self.safety.senses.seeing:
            self.local_map.sight.observe_image(frame.image)
        pose = seen_from.pose
        self.local_map.update(odometry, view.percepts, view.stixels, pose, view.low_things)
        self.tracker.update(view.moving_objects, pose)
        self.tracker.prune(odometry.time, odometry.pose, self.local_map.occupancy.occupied_at)
        moving = self.tracker.occupied_discs(odometry.time)
        self.local_map.forget_track(moving)
        self.growing.update(odometry, self.local_map, moving, view.percept, pose)
