"""The channels of a recording and of the live server: topic, schema, rate and content."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.recording.reading_message import SCHEMA_NAME

__all__ = [
    "CAMERA_IMAGE",
    "CHANNELS",
    "LANDMARK_IMAGE",
    "LEFT_IMAGE",
    "READING",
    "RIGHT_IMAGE",
    "ChannelInfo",
]

READING = "/sensors/reading"
CAMERA_IMAGE = "/camera/image"
LANDMARK_IMAGE = "/camera/landmarks/image"
LEFT_IMAGE = "/camera/left/image"
RIGHT_IMAGE = "/camera/right/image"


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A channel: its ``topic``, the name of its ``schema``, how often, and what is in it."""

    topic: str
    schema: str
    rate: str
    content: str


_IMAGE = "foxglove.CompressedImage"

CHANNELS = (
    ChannelInfo(READING, SCHEMA_NAME, "60 Hz", "gyro, encoders, and the command of the stack"),
    ChannelInfo(CAMERA_IMAGE, _IMAGE, "10 Hz", "the camera's image, PNG"),
    ChannelInfo(LANDMARK_IMAGE, _IMAGE, "1.25 Hz", "the larger image for landmarks, if any"),
    ChannelInfo(LEFT_IMAGE, _IMAGE, "10 Hz", "left side view, of a wide lens"),
    ChannelInfo(RIGHT_IMAGE, _IMAGE, "10 Hz", "right side view, of a wide lens"),
)
"""All channels of a run."""
