"""What the sensors give: all that a stack may see."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.signals.geometry import Image

__all__ = ["Encoders", "Frame", "Inertial", "SensorReading"]


@dataclass(frozen=True, slots=True)
class Frame:
    """One camera image: ``image`` (height, width) uint8 luminance, taken at ``time`` [s].

    ``sides`` are what a wider lens shows left and right of it at that moment, when the robot has
    such a lens (``navfw.robot.SideViews``), else nothing.
    """

    time: float
    image: Image
    sides: tuple[Image, ...] = ()


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
    """All that the stack may see at one control tick; ``frame`` only when the camera delivered.

    ``landmark_frame`` is a larger image at a lower rate for landmark recognition, when configured.
    """

    time: float
    inertial: Inertial
    encoders: Encoders
    frame: Frame | None = None
    landmark_frame: Frame | None = None
