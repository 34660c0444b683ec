"""Recording of a run as MCAP, in memory until it is saved."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

from navfw.config.extras import extra_imports
from navfw.recording.channel_list import END, FORMAT_VERSION, MAX_BYTES, PROFILE, RUN
from navfw.recording.run_observer import SeenRun
from navfw.signals import Frame, Pose, SensorReading, Twist

_CHUNK = 1 << 18
"""Size of a chunk before compression [byte]: a second or two, which a cut file loses at most."""


class RunRecorder:
    """Collects a run in memory until ``save``: its readings, and what is ``seen`` of it.

    At most ``max_bytes`` of images, and of the file: ``complete`` is false once that limit has been
    reached, and what follows is left out.
    """

    def __init__(
        self,
        metadata: Mapping[str, str] | None = None,
        seen: SeenRun | None = None,
        max_bytes: int = MAX_BYTES,
    ) -> None:
        with extra_imports("record"):
            from foxglove import Context, open_mcap
            from foxglove.mcap import MCAPWriteOptions

        from navfw.recording.run_channels import RunChannels

        context = Context()
        self.complete = True
        self._max_bytes = max_bytes
        self._unpacked = 0
        self._file = io.BytesIO()
        options = MCAPWriteOptions(
            profile=f"{PROFILE}{FORMAT_VERSION}",
            chunk_size=_CHUNK,
            compression_level=1,
            compression_threads=0,
        )
        self._writer = open_mcap(self._file, context=context, writer_options=options)
        self._writer.write_metadata(RUN, dict(metadata or {}))
        self._channels = RunChannels(context, seen)
        self._closed = False

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Add one control tick: the reading, the stack's command for it, and the true pose."""
        frames = [frame for frame in (reading.frame, reading.landmark_frame) if frame is not None]
        self._unpacked += 96 + sum(map(_size, frames))
        if max(self._unpacked, self._file.tell()) > self._max_bytes:
            self.complete = False
        if self.complete:
            self._channels.observe(reading, twist, pose)

    def close(self) -> None:
        """End the recording: nothing can be added afterwards."""
        if self._closed:
            return
        self._closed = True
        self._channels.close()
        if self.complete:
            self._writer.write_metadata(END, {"complete": "yes"})  # empty ones are not written
        self._writer.close()

    def save(self, path: Path) -> None:
        """Write the recording to ``path``, ended if it was not."""
        self.close()
        path.write_bytes(self._file.getbuffer())


def _size(frame: Frame) -> int:
    """The size of a frame's images [byte]."""
    return frame.image.nbytes + sum(side.nbytes for side in frame.sides)
