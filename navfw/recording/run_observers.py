"""What takes in a run while it goes on; its recording as MCAP."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from navfw.config.extras import extra_imports
from navfw.recording import channel_list as topics
from navfw.recording.channel_list import SeenRun
from navfw.signals import Pose, SensorReading, Twist

_CHUNK = 1 << 18
"""Size of a chunk before compression [byte]: a second or two, which a cut file loses at most."""


class RunObserver(Protocol):
    """Takes in every control tick of a run, after the stack; it must change nothing in it."""

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Take in one control tick: reading, the stack's command for it, and the true pose."""
        ...

    def close(self) -> None:
        """End: the run is over."""
        ...


class RunRecorder:
    """Collects a run in memory until ``save``: its readings, and what is ``seen`` of it.

    At most ``max_bytes`` of images, and of the file: ``complete`` is false once that limit has been
    reached, and what follows is left out.
    """

    def __init__(
        self,
        metadata: Mapping[str, str] | None = None,
        seen: SeenRun | None = None,
        max_bytes: int = topics.MAX_BYTES,
    ) -> None:
        with extra_imports("record"):
            from foxglove import Context, open_mcap
            from foxglove.mcap import MCAPWriteOptions

        from navfw.recording.run_channels import RunChannels, context_channels

        context = Context()
        self.complete = True
        self._max_bytes = max_bytes
        self._unpacked = 0
        self._file = io.BytesIO()
        options = MCAPWriteOptions(
            profile=f"{topics.PROFILE}{topics.FORMAT_VERSION}",
            chunk_size=_CHUNK,
            compression_level=1,
            compression_threads=0,
        )
        self._writer = open_mcap(self._file, context=context, writer_options=options)
        self._writer.write_metadata(topics.RUN, dict(metadata or {}))
        self._channels = RunChannels(context_channels(context), seen)
        self._closed = False

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose | None) -> None:
        """Add one control tick: reading, the stack's command, and the true pose if it is known."""
        frames = [frame for frame in (reading.frame, reading.landmark_frame) if frame is not None]
        images = [image for frame in frames for image in (frame.image, *frame.sides)]
        self._unpacked += 96 + sum(image.nbytes for image in images)
        if max(self._unpacked, self._file.tell()) > self._max_bytes:
            self.complete = False
        if self.complete:
            self._channels.observe(reading, twist, pose)

    def log_driven(self, twist: Twist, time: float) -> None:
        """Add what another commanded the robot at ``time`` [s], in the stack's stead."""
        if self.complete:
            self._channels.log_driven(twist, time)

    def close(self) -> None:
        """End the recording: nothing can be added afterwards."""
        if self._closed:
            return
        self._closed = True
        self._channels.close()
        if self.complete:
            # metadata without an entry are not written
            self._writer.write_metadata(topics.END, {"complete": "yes"})
        self._writer.close()

    def save(self, path: Path) -> None:
        """Write the recording to ``path``, ended if it was not."""
        self.close()
        path.write_bytes(self._file.getbuffer())
