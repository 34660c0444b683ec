"""A stack that watches while somebody else drives the robot, and maps what it sees."""

from __future__ import annotations

from navfw.errors import ConfigError
from navfw.mapping import GrowingMap
from navfw.signals import Frame, Odometry, SensorReading, Twist
from navfw.stack.stack import Stack
from navfw.stack.vision import ready_frame, straight_reading


class MappingStack(Stack):
    """Runs the perceiving half of a stack: odometry, vision, local map; and the growing map.

    Nothing is planned or decided. The stack file says ``growing_map: true``; ``growing`` is the map
    so far.
    """

    @property
    def growing(self) -> GrowingMap:
        """The map so far.

        Raises:
            ConfigError: the stack grows none.

        """
        if self.growth.growing_map is None:
            raise ConfigError("expected growing_map: true in the stack")
        return self.growth.growing_map

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
        view, _ = self._perceive(reading, frame, seen_from)
        for correction in view.yaw_corrections:
            (self.floor_odometry or self.odometer).correct(correction)
        if self.safety.senses.seeing:
            self.local_map.sight.observe_image(frame.image)
        pose = seen_from.pose
        self.local_map.update(odometry, view.percepts, view.stixels, pose, view.low_things)
        self.tracker.update(view.moving_objects, pose)
        self.tracker.prune(odometry.time, odometry.pose, self.local_map.occupancy.occupied_at)
        moving = self.tracker.occupied_discs(odometry.time)
        self.local_map.forget_track(moving)
        self.growing.update(odometry, self.local_map, moving, view.percept, pose)
