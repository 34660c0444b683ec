"""Sensor readings: the only input of a stack beside the map file."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.numerics.arrays import Image
from navfw.signals.immutability import freeze


@dataclass(frozen=True, slots=True)
class Frame:
    """One camera image: ``image`` (height, width) uint8 luminance, taken at ``time`` [s].

    ``sides`` are the left and right side views of the same time, if the robot has a wider lens
    (``navfw.robot.SideViews``).
    """

    time: float
    image: Image
    sides: tuple[Image, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "image", "sides")


@dataclass(frozen=True, slots=True)
class Inertial:
    """Rate gyro: angular velocity [rad/s] about base_link x, y, z (roll, pitch, yaw rate)."""

    time: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class Encoders:
    """Wheel encoders: ticks counted since power-on, signed, forward positive."""

    time: float
    left: int
    right: int


@dataclass(frozen=True, slots=True)
class SensorReading:
    """All sensor readings of one control tick; ``frame`` only when the camera delivered one.

    ``landmark_frame`` is a larger image at a lower rate for landmark recognition, when configured.
    """

    time: float
    inertial: Inertial
    encoders: Encoders
    frame: Frame | None = None
    landmark_frame: Frame | None = None
