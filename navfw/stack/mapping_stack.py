"""A stack that watches while somebody else drives the robot, and maps what it sees."""

from __future__ import annotations

from navfw.mapping import GrowingMap
from navfw.signals import SensorReading, Twist
from navfw.stack.stack import Stack
from navfw.stack.vision import ready_frame, straight_reading


class MappingStack(Stack):
    """Runs the perceiving half of a stack: odometry, vision, local map; and the growing map.

    Nothing is planned or decided. The stack file says ``growing_map: true``; ``growing`` is the map
    so far.
    """

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
            self._observe(frame, view, odometry, seen_from.pose)
        return odometry.twist
