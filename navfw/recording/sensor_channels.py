"""The channels of sensor readings and camera images: what a replay needs, bit for bit."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
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

_IMAGE_FORMAT = "png"
"""Format of the images. It loses nothing; WebP and JPEG 2000 are a tenth smaller and take five to
ten times as long, an eighth of the run."""


def nanoseconds(time: float) -> int:
    """Simulated ``time`` [s] as MCAP counts it [ns]; times before the run count as its start."""
    return max(0, round(1e9 * time))


class SensorChannels:
    """Logs sensor readings, each with its images before it.

    Images are compressed in a thread of their own, and whatever comes later waits for them; the
    thread sees nothing but the images, which nobody changes.
    """

    def __init__(self, context: Context) -> None:
        from foxglove import Channel, Schema
        from foxglove.channels import CompressedImageChannel

        schema = Schema(name=SCHEMA_NAME, encoding="ros2msg", data=SCHEMA.encode())
        self._reading = Channel(READING, schema=schema, message_encoding="cdr", context=context)
        self._images = {
            topic: CompressedImageChannel(topic, context=context)
            for topic in (CAMERA_IMAGE, LANDMARK_IMAGE, LEFT_IMAGE, RIGHT_IMAGE)
        }
        self._packer = ThreadPoolExecutor(max_workers=1)
        self._waiting: deque[tuple[str, int, Future[bytes] | bytes]] = deque()

    def log(self, reading: SensorReading, twist: Twist) -> None:
        """Log one control tick: the reading, and the stack's command for it."""
        now = nanoseconds(reading.time)
        frame, landmarks = reading.frame, reading.landmark_frame
        if frame is not None:
            self._pack(CAMERA_IMAGE, frame.image, now)
            for topic, side in zip((LEFT_IMAGE, RIGHT_IMAGE), frame.sides, strict=False):
                self._pack(topic, side, now)
        if landmarks is not None:
            self._pack(LANDMARK_IMAGE, landmarks.image, now)
        self._waiting.append((READING, now, pack_reading(reading, twist)))
        self._send(wait=False)

    def close(self) -> None:
        """Log what still waits; nothing can be logged afterwards."""
        self._send(wait=True)
        self._packer.shutdown()

    def _pack(self, topic: str, image: Image, now: int) -> None:
        if self._images[topic].has_sinks():
            self._waiting.append((topic, now, self._packer.submit(_packed, image)))

    def _send(self, *, wait: bool) -> None:
        """Log what is ready, in order; with ``wait`` all of it."""
        while self._waiting:
            topic, now, data = self._waiting[0]
            if isinstance(data, Future):
                if not (wait or data.done()):
                    return
                data = data.result()
            self._waiting.popleft()
            if topic == READING:
                self._reading.log(data, log_time=now)
            else:
                self._log_image(topic, data, now)

    def _log_image(self, topic: str, data: bytes, now: int) -> None:
        from foxglove.messages import CompressedImage, Timestamp

        frame = topic.removeprefix("/").removesuffix("/image")
        message = CompressedImage(
            timestamp=Timestamp(*divmod(now, 10**9)),
            frame_id=frame,
            data=data,
            format=_IMAGE_FORMAT,
        )
        self._images[topic].log(message, log_time=now)


def _packed(image: Image) -> bytes:
    """An image in ``_IMAGE_FORMAT``; OpenCV lets other threads run meanwhile."""
    return cv2.imencode(f".{_IMAGE_FORMAT}", image)[1].tobytes()
