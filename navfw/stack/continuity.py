"""Whether readings belong to one drive: gaps, jumps of the wheels, a dark camera, being carried."""

from __future__ import annotations

import math

import numpy as np

from navfw.robot import RobotModel
from navfw.signals import SensorReading

GAP, _BLIND = 0.5, 3.0  # chosen
"""Time [s] without any reading, and without an image that shows something, at which a drive is
split."""

_DARK, _FLAT = 8.0, 2.5  # chosen
"""Mean grey level, and standard deviation, up to which an image shows nothing."""

_TOO_FAST = 3.0  # chosen
"""Speed of a wheel's rim, over the robot's top speed, that is a jump of its count."""

_CARRIED = 0.3  # chosen
"""Turn [rad] with both wheels at rest from which the robot was carried."""


class Continuity:
    """Says when a reading cannot belong to the same drive as those before."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._way_per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
        self._last: SensorReading | None = None
        self._seen: float | None = None
        self._driven = self._turned = 0.0
        self._rates: list[float] = []
        self._bias = 0.0

    def update(self, reading: SensorReading) -> str:
        """Return why the drive has ended before this reading; empty if it goes on."""
        last, self._last = self._last, reading
        if last is None:
            self._seen = reading.time
            return ""
        dt = reading.time - last.time
        if dt > GAP or dt < 0.0:
            return f"a gap of {dt:.1f} s"
        ticks = max(
            abs(reading.encoders.left - last.encoders.left),
            abs(reading.encoders.right - last.encoders.right),
        )
        rolled = self._way_per_tick * ticks
        if rolled > _TOO_FAST * self._robot.max_v * max(dt, 0.02) + 2.0 * self._way_per_tick:
            return f"the wheels jump by {rolled:.2f} m"
        self._driven += rolled
        if reading.frame is not None and shows(reading.frame.image):
            self._seen, self._driven = reading.time, 0.0
        if self._seen is not None and reading.time - self._seen > _BLIND and self._driven > 0.3:
            return f"no image shows anything for {reading.time - self._seen:.0f} s"
        return self._watch_turn(reading, rolled, dt)

    def _watch_turn(self, reading: SensorReading, rolled: float, dt: float) -> str:
        """Integrate the turn while the wheels rest: nothing else than being carried turns it."""
        rate = reading.inertial.yaw_rate
        if rolled > 0.0 or not math.isfinite(rate):
            self._turned, self._rates = 0.0, []
            return ""
        self._turned += (rate - self._bias) * dt
        self._rates.append(rate)
        if len(self._rates) > 30 and abs(self._turned) < 0.02:
            self._bias = float(np.mean(self._rates[-600:]))
        return "the robot was carried" if abs(self._turned) > _CARRIED else ""


def shows(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> bool:
    """Whether an image shows anything."""
    some = image[::4, ::4]
    return float(some.mean()) > _DARK and float(some.std()) > _FLAT
