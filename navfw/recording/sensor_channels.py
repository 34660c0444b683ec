"""The channels of sensor readings and camera images: what a replay needs, bit for bit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

from navfw.recording.channel_list import (
    CAMERA_IMAGE,
    LANDMARK_IMAGE,
    LEFT_IMAGE,
    READING,
    RIGHT_IMAGE,
)
from navfw.recording.reading_message import SCHEMA, SCHEMA_NAME, pack_reading
from navfw.signals import Image, SensorReading, Twist

if TYPE_CHECKING:
    from foxglove import Context

__all__ = ["IMAGE_FORMAT", "SensorChannels", "nanoseconds"]

IMAGE_FORMAT = "png"
"""Format of the images. It loses nothing; WebP and JPEG 2000 are a tenth smaller and take five to
ten times as long, an eighth of the run."""


def nanoseconds(time: float) -> int:
    """Simulated ``time`` [s] as MCAP counts it [ns]; times before the run count as its start."""
    return max(0, round(1e9 * time))


class SensorChannels:
    """Logs sensor readings, each with its images before it."""

    def __init__(self, context: Context) -> None:
        from foxglove import Channel, Schema
        from foxglove.channels import CompressedImageChannel

        schema = Schema(name=SCHEMA_NAME, encoding="ros2msg", data=SCHEMA.encode())
        self._reading = Channel(READING, schema=schema, message_encoding="cdr", context=context)
        self._images = {
            topic: CompressedImageChannel(topic, context=context)
            for topic in (CAMERA_IMAGE, LANDMARK_IMAGE, LEFT_IMAGE, RIGHT_IMAGE)
        }

    def log(self, reading: SensorReading, twist: Twist) -> None:
        """Log one control tick: the reading, and the stack's command for it."""
        now = nanoseconds(reading.time)
        frame, landmarks = reading.frame, reading.landmark_frame
        if frame is not None:
            self._log_image(CAMERA_IMAGE, frame.image, now)
            for topic, side in zip((LEFT_IMAGE, RIGHT_IMAGE), frame.sides, strict=False):
                self._log_image(topic, side, now)
        if landmarks is not None:
            self._log_image(LANDMARK_IMAGE, landmarks.image, now)
        self._reading.log(pack_reading(reading, twist), log_time=now)

    def _log_image(self, topic: str, image: Image, now: int) -> None:
        from foxglove.messages import CompressedImage, Timestamp

        channel = self._images[topic]
        if not channel.has_sinks():
            return
        packed = cv2.imencode(f".{IMAGE_FORMAT}", image)[1].tobytes()
        taken = Timestamp(*divmod(now, 10**9))
        frame = topic.removeprefix("/").removesuffix("/image")
        message = CompressedImage(timestamp=taken, frame_id=frame, data=packed, format=IMAGE_FORMAT)
        channel.log(message, log_time=now)
