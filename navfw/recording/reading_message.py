"""The message of one sensor reading with its command, as ROS 2 CDR: exact to the last bit.

Every field has 8 bytes, so the little-endian CDR of the message is its fields one after another.
"""

from __future__ import annotations

import struct
from enum import IntFlag
from typing import NamedTuple

from navfw.signals import SensorReading, Twist

SCHEMA_NAME = "navfw_msgs/msg/SensorReading"

SCHEMA = """\
float64 time                 # simulated time of the control tick [s]
float64 roll_rate            # gyro [rad/s]
float64 pitch_rate
float64 yaw_rate
float64 inertial_time        # time of the gyro's measurement [s]
float64 encoders_time        # time of the encoders' measurement [s]
int64 left                   # wheel ticks since power-on
int64 right
float64 frame_time           # time of the camera image of this tick [s], 0 without one
float64 landmark_frame_time  # time of the larger image for landmarks [s], 0 without one
int64 pictures               # images of this tick: 1 camera, 2 landmarks, 4 side views
float64 v                    # the stack's command [m/s]
float64 w                    # the stack's command [rad/s]
"""
"""The ROS 2 definition of the message."""

_HEADER = b"\x00\x01\x00\x00"
"""CDR, little-endian."""
_FIELDS = struct.Struct("<6d2q2dq2d")


class ImageFlags(IntFlag):
    """The images that belong to a reading."""

    CAMERA = 1
    LANDMARKS = 2
    SIDES = 4


class ReadingRow(NamedTuple):
    """The fields of the message, in its order; units are in ``SCHEMA``."""

    time: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    inertial_time: float
    encoders_time: float
    left: int
    right: int
    frame_time: float
    landmark_frame_time: float
    pictures: int
    v: float
    w: float


def pack_reading(reading: SensorReading, twist: Twist) -> bytes:
    """The message of ``reading`` and of the stack's command for it."""
    inertial, encoders = reading.inertial, reading.encoders
    frame, landmarks = reading.frame, reading.landmark_frame
    pictures = ImageFlags(0)
    if frame is not None:
        pictures |= ImageFlags.CAMERA
        if frame.sides:
            pictures |= ImageFlags.SIDES
    if landmarks is not None:
        pictures |= ImageFlags.LANDMARKS
    return _HEADER + _FIELDS.pack(
        reading.time,
        inertial.roll_rate,
        inertial.pitch_rate,
        inertial.yaw_rate,
        inertial.time,
        encoders.time,
        encoders.left,
        encoders.right,
        0.0 if frame is None else frame.time,
        0.0 if landmarks is None else landmarks.time,
        int(pictures),
        twist.v,
        twist.w,
    )


def unpack_reading(data: bytes) -> ReadingRow:
    """The fields of a message.

    Raises:
        ValueError: it is not such a message.

    """
    if len(data) != len(_HEADER) + _FIELDS.size or not data.startswith(_HEADER):
        raise ValueError("a sensor reading has another layout")
    return ReadingRow(*_FIELDS.unpack_from(data, len(_HEADER)))
