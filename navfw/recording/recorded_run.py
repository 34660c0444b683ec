"""Reading a recording: the messages of its channels with their simulated times, and its images.

>>> run = open_run("runs/office-lobby-to-lab-0")                         # doctest: +SKIP
>>> for message in run.messages("/command"):                             # doctest: +SKIP
...     print(message.time, message.content["leader"])
>>> image = run.image_at(12.5)                                           # doctest: +SKIP

``docs/recordings.md`` lists the channels with their schemas.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.image_file import decode_image
from navfw.config.input_file import is_file, shown_path
from navfw.errors import ConfigError
from navfw.recording.channel_list import CAMERA_IMAGE, CHANNELS, READING
from navfw.recording.mcap_file import McapFile
from navfw.recording.reading_message import SCHEMA, unpack_reading
from navfw.recording.run_folder import MAX_BYTES, OLD_RECORDING, RECORDING
from navfw.recording.run_recorder import END, FORMAT_VERSION, PROFILE, RUN
from navfw.signals import Image

with extra_imports("record"):
    from mcap.records import Channel, Header, Message, Metadata, Schema
    from mcap.well_known import MessageEncoding, SchemaEncoding
    from mcap_protobuf.decoder import DecoderFactory

_SCHEMAS = {channel.topic: channel.schema for channel in CHANNELS}


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """A message of channel ``topic`` at simulated ``time`` [s].

    ``content`` is a ``ReadingRow`` for sensor readings, a dict for JSON, and otherwise a protobuf
    message with the fields of its Foxglove schema (``message.content.data``).
    """

    topic: str
    time: float
    content: Any


class RecordedRun:
    """The recording in an MCAP file that ``navfw run --record`` wrote.

    ``metadata`` describes the run (``config``: the resolved configuration as JSON), ``topics`` has
    the schema of each channel in the file by its topic. ``complete`` is false if the recording ends
    before its run: the recorder reached its limit, or the file is cut off. Then the messages are
    those of the intact part.

    Raises:
        ConfigError: the file cannot be read, is too large, or damaged; it is not a recording, or
            one of another version.

    """

    def __init__(self, path: str | Path, max_bytes: int = MAX_BYTES) -> None:
        self.path = Path(path)
        self.metadata: dict[str, str] = {}
        self.complete = False
        self._file = McapFile(self.path, max_bytes)
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, Schema] = {}
        self._protobuf = DecoderFactory()
        self._scan()
        self.topics = {
            channel.topic: self._schemas[channel.schema_id].name
            for channel in self._channels.values()
        }

    def messages(self, *topics: str) -> Iterator[RecordedMessage]:
        """The decoded messages of ``topics`` (none given: of all), in the order of the file.

        Raises:
            ConfigError: a message is damaged.

        """
        wanted = {
            number: self._decoder(channel)
            for number, channel in self._channels.items()
            if not topics or channel.topic in topics
        }
        for record in self._file.records():
            if not isinstance(record, Message) or record.channel_id not in wanted:
                continue
            topic = self._channels[record.channel_id].topic
            try:
                content = wanted[record.channel_id](record.data)
            except Exception as error:  # of the decoders of protobuf and JSON
                reason = str(error) or type(error).__name__
                raise self._file.refused(f"a message of {topic} is damaged ({reason})") from None
            yield RecordedMessage(topic, 1e-9 * record.log_time, content)

    def image_at(self, time: float, topic: str = CAMERA_IMAGE) -> Image | None:
        """The newest image of ``topic`` at ``time`` [s] (height, width); None before the first.

        Raises:
            ConfigError: the image is damaged.

        """
        newest = None
        for message in self.messages(topic):
            if message.time > time + 1e-9:
                break
            newest = message
        return None if newest is None else image_of(newest, self.path)

    def _scan(self) -> None:
        """Read the whole file once: metadata, channels, and whether it is intact."""
        records = self._file.records()
        self._check_header(next(records, None))
        for record in records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._add_channel(record)
            elif isinstance(record, Metadata):
                self.complete |= record.name == END
                if record.name == RUN:
                    self.metadata = dict(record.metadata)
            elif isinstance(record, Message) and record.channel_id not in self._channels:
                raise self._file.refused("the file is damaged (a message without a channel)")

    def _check_header(self, header: object) -> None:
        profile = header.profile if isinstance(header, Header) else ""
        version = profile.removeprefix(PROFILE)
        if not profile.startswith(PROFILE) or not version.isdecimal():
            of = f"of profile {profile!r}" if profile else "without a profile"
            raise self._file.refused(f"an MCAP file {of}, expected one of navfw run --record")
        if int(version[:9]) != FORMAT_VERSION:
            raise self._file.refused(
                f"it has version {version[:9]} of the format, this navfw reads {FORMAT_VERSION};"
                " record the run again"
            )

    def _add_channel(self, channel: Channel) -> None:
        """Add a channel; one of navfw's own must have the schema that navfw gives it."""
        schema = self._schemas.get(channel.schema_id)
        expected = _SCHEMAS.get(channel.topic)
        if schema is None:
            raise self._file.refused(f"channel {channel.topic} has no schema")
        if expected not in (None, schema.name):
            what = f"channel {channel.topic} has schema {schema.name}, expected {expected}"
            raise self._file.refused(what)
        if channel.topic == READING and schema.data != SCHEMA.encode():
            raise self._file.refused(f"the fields of {channel.topic} are not those of this version")
        self._channels[channel.id] = channel

    def _decoder(self, channel: Channel) -> Callable[[bytes], Any]:
        schema = self._schemas[channel.schema_id]
        if channel.topic == READING:
            return unpack_reading
        if channel.message_encoding == MessageEncoding.JSON:
            return json.loads
        try:
            if schema.encoding == SchemaEncoding.Protobuf:
                decoder = self._protobuf.decoder_for(channel.message_encoding, schema)
                if decoder is not None:
                    return decoder
        except Exception as error:  # protobuf raises errors of many kinds for damaged schemas
            what = f"the schema of {channel.topic} is damaged ({error})"
            raise self._file.refused(what) from None
        return bytes


def image_of(message: RecordedMessage, path: Path) -> Image:
    """The image in a message of ``foxglove.CompressedImage``: (height, width) uint8, luminance.

    Raises:
        ConfigError: the image is damaged or too large; the message has ``path`` and time.

    """
    where = f"{shown_path(path)}: {message.topic} at {message.time:.2f} s"
    image = decode_image(message.content.data, where, cv2.IMREAD_GRAYSCALE)
    return np.asarray(image, dtype=np.uint8)


def recording_in(folder: str | Path) -> Path:
    """The recording in a run folder.

    Raises:
        ConfigError: there is none; the message says how to get one.

    """
    path = Path(folder) / RECORDING
    if is_file(path):
        return path
    if is_file(Path(folder) / OLD_RECORDING):
        what = f"{OLD_RECORDING} is of an earlier version of navfw, which this one does not read"
        raise ConfigError(f"{what}; run again with --record", file=folder)
    raise ConfigError("contains no sensor readings; run again with --record", file=folder)


def open_run(folder: str | Path) -> RecordedRun:
    """The recording of a run folder.

    Raises:
        ConfigError: there is none, or as ``RecordedRun``.

    """
    return RecordedRun(recording_in(folder))
