"""Reading a recording: the messages of its channels with their simulated times, and its images.

>>> run = open_run("runs/office-lobby-to-lab-0")                         # doctest: +SKIP
>>> for message in run.messages("/command"):                             # doctest: +SKIP
...     print(message.time, message.content["leader"])
>>> image = run.image_at(12.5)                                           # doctest: +SKIP

``docs/recordings.md`` lists the channels with their schemas.

The records of the MCAP file are parsed by the library ``mcap``. Nothing of a record or chunk is
unpacked before its size is checked.
"""

from __future__ import annotations

import io
import json
import re
import struct
from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.image_file import decode_image
from navfw.config.input_file import is_file, open_input, shown_path
from navfw.errors import ConfigError
from navfw.numerics import Image
from navfw.process.atomic import AtomicFolder
from navfw.recording import channel_list as topics
from navfw.recording.ros_messages import message_types
from navfw.recording.run_folder import RECORDING

with extra_imports("record"):
    import zstandard
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, DataEnd, Header, McapRecord, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader, breakup_chunk, get_chunk_data_stream
    from mcap.well_known import MessageEncoding, SchemaEncoding
    from mcap_protobuf.decoder import DecoderFactory

_EXPANSION = 8
"""Largest size of all unpacked chunks, in units of the largest file."""
_MAX_CHUNK = 1 << 26
"""Largest size of one record, and of one unpacked chunk [byte]; navfw writes 1 MB."""

_HEAD = struct.Struct("<BQH")  # of a record, with the channel of a message
_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """A message of channel ``topic`` at simulated ``time`` [s].

    ``content`` is a dict for JSON, and otherwise a message with the fields of its schema, of
    Foxglove or of ROS 2 (``message.content.data``).
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

    def __init__(self, path: str | Path, max_bytes: int = topics.MAX_BYTES) -> None:
        self.path = Path(path)
        self.metadata: dict[str, str] = {}
        self.complete = False
        self._max_bytes = max_bytes
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, Schema] = {}
        self._protobuf = DecoderFactory()
        self._scan()
        self.topics = {
            channel.topic: self._schemas[channel.schema_id].name
            for channel in self._channels.values()
        }

    def messages(self, *wanted: str) -> Iterator[RecordedMessage]:
        """The decoded messages of ``wanted`` topics (none given: of all), in the order of the file.

        Raises:
            ConfigError: a message is damaged.

        """
        decoders = {channel.topic: self._decoder(channel) for channel in self._of(*wanted)}
        for topic, log_time, data in self.packed(*wanted):
            try:
                content = decoders[topic](data)
            except Exception as error:  # of the decoders of protobuf, CDR and JSON
                reason = str(error) or type(error).__name__
                raise self.refused(f"a message of {topic} is damaged ({reason})") from None
            yield RecordedMessage(topic, 1e-9 * log_time, content)

    def packed(self, *wanted: str) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time [ns] and bytes of the messages of ``wanted`` topics, as ``messages``.

        Raises:
            ConfigError: the file is damaged.

        """
        of = {channel.id: channel.topic for channel in self._of(*wanted)}
        for record in self._records(of):
            if isinstance(record, Message) and record.channel_id in of:
                yield of[record.channel_id], record.log_time, record.data

    def _of(self, *wanted: str) -> list[Channel]:
        """The channels of ``wanted`` topics; without any, all."""
        channels = self._channels.values()
        return [channel for channel in channels if not wanted or channel.topic in wanted]

    def image_at(self, time: float, topic: str = topics.CAMERA_IMAGE) -> Image | None:
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

    def _records(self, wanted: Container[int] | None = None) -> Iterator[McapRecord]:
        """The records up to the end of the data, those in chunks unpacked, in the file's order.

        Of chunks, with ``wanted`` channels, the messages of these alone.
        """
        with open_input(self.path, self._max_bytes) as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise self.refused("expected an MCAP file, as navfw run --record writes it")
            stream.seek(-len(_MAGIC), io.SEEK_END)  # as a whole file ends
            ended = stream.read() == _MAGIC and stream.tell() > len(_MAGIC)
            try:
                yield from self._unpacked(stream, wanted)
            except Exception as error:
                if not ended and not stream.read(1):
                    return  # the file is cut off within this record
                # mcap, zstandard and struct raise errors of many kinds for damaged content
                reason = str(error) or type(error).__name__
                raise self.refused(f"the file is damaged ({reason})") from None

    def refused(self, what: str) -> ConfigError:
        """The error that the file is no recording."""
        return ConfigError(f"not a recording: {what}", file=self.path)

    def _unpacked(self, stream: BinaryIO, wanted: Container[int] | None) -> Iterator[McapRecord]:
        room = _EXPANSION * self._max_bytes
        stream.seek(0)
        reader = StreamReader(
            stream, emit_chunks=True, validate_crcs=True, record_size_limit=_MAX_CHUNK
        )
        for record in reader.records:
            if isinstance(record, DataEnd):
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            room -= _unpacked_size(record)
            if room < 0:
                raise ValueError(f"its chunks unpack to more than {_EXPANSION} times its limit")
            inner = breakup_chunk(record, True) if wanted is None else _messages_in(record, wanted)
            yield from inner

    def _scan(self) -> None:
        """Read the whole file once: metadata, channels, and whether it is intact."""
        records = self._records()
        self._check_header(next(records, None))
        for record in records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._add_channel(record)
            elif isinstance(record, Metadata):
                self.complete |= record.name == topics.END
                if record.name == topics.RUN:
                    self.metadata = dict(record.metadata)
            elif isinstance(record, Message) and record.channel_id not in self._channels:
                raise self.refused("the file is damaged (a message without a channel)")

    def _check_header(self, header: object) -> None:
        profile = header.profile if isinstance(header, Header) else ""
        version = profile.removeprefix(topics.PROFILE)
        if not profile.startswith(topics.PROFILE) or not version.isdecimal():
            of = f"of profile {profile!r}" if profile else "without a profile"
            raise self.refused(f"an MCAP file {of}, expected one of navfw run --record")
        if int(version[:9]) != topics.FORMAT_VERSION:
            what = f"it has version {version[:9]} of the format, this navfw reads"
            raise self.refused(f"{what} {topics.FORMAT_VERSION}; record the run again")

    def _add_channel(self, channel: Channel) -> None:
        """Add a channel; one of navfw's own must have the schema that navfw gives it."""
        schema = self._schemas.get(channel.schema_id)
        expected = _SCHEMAS.get(channel.topic)
        if schema is None:
            raise self.refused(f"channel {channel.topic} has no schema")
        if expected not in (None, schema.name):
            what = f"channel {channel.topic} has schema {schema.name}, expected {expected}"
            raise self.refused(what)
        if channel.topic == topics.READING and schema.data != topics.SCHEMA.encode():
            raise self.refused(f"the fields of {channel.topic} are not those of this version")
        self._channels[channel.id] = channel

    def _decoder(self, channel: Channel) -> Callable[[bytes], Any]:
        schema = self._schemas[channel.schema_id]
        if channel.message_encoding == MessageEncoding.JSON:
            return json.loads
        if schema.encoding == SchemaEncoding.ROS2 and schema.name in message_types().types:
            return partial(message_types().deserialize_cdr, typename=schema.name)
        try:
            if schema.encoding == SchemaEncoding.Protobuf:
                decoder = self._protobuf.decoder_for(channel.message_encoding, schema)
                if decoder is not None:
                    return decoder
        except Exception as error:  # protobuf raises errors of many kinds for damaged schemas
            what = f"the schema of {channel.topic} is damaged ({error})"
            raise self.refused(what) from None
        return bytes


def _messages_in(chunk: Chunk, wanted: Container[int]) -> Iterator[Message]:
    """The messages of ``wanted`` channels; stepping over the others halves the time of a pass."""
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data, at = stream.read(size), 0
    while at < size:
        opcode, length, channel = _HEAD.unpack_from(data, at)
        at += _HEAD.size - 2
        if opcode == Opcode.MESSAGE and channel in wanted:
            yield Message.read(ReadDataStream(io.BytesIO(data[at : at + length])), length)
        at += length


def _unpacked_size(chunk: Chunk) -> int:
    """The size of a chunk's content [byte].

    Raises:
        ValueError: it is too large, differs from what the chunk declares, or is packed otherwise
            than navfw packs it.

    """
    size = chunk.uncompressed_size
    if size > _MAX_CHUNK:
        raise ValueError(f"a chunk has {size} bytes, more than {_MAX_CHUNK}")
    if chunk.compression == "zstd":
        declared = zstandard.frame_content_size(chunk.data)
    elif chunk.compression == "":
        declared = len(chunk.data)
    else:
        raise ValueError(f"compressed with {chunk.compression!r}, expected zstd")
    if declared not in (-1, size):
        raise ValueError(f"a chunk of {size} bytes has {declared}")
    return size


_SCHEMAS = {info.topic: info.schema for info in (*topics.CHANNELS, topics.DRIVEN_CHANNEL)}


def image_of(message: RecordedMessage, path: Path) -> Image:
    """The image in a message of ``CompressedImage``: (height, width) uint8, luminance.

    Raises:
        ConfigError: the image is damaged or too large; the message has ``path`` and time.

    """
    where = f"{shown_path(path)}: {message.topic} at {message.time:.2f} s"
    image = decode_image(bytes(message.content.data), where, cv2.IMREAD_GRAYSCALE)
    return np.asarray(image, dtype=np.uint8)


def recording_in(folder: str | Path) -> Path:
    """The recording in a run folder.

    Raises:
        ConfigError: there is none; the message says how to get one.

    """
    path = Path(folder) / RECORDING
    if is_file(path):
        return path
    raise ConfigError("contains no sensor readings; run again with --record", file=folder)


def open_run(folder: str | Path) -> RecordedRun:
    """The recording of a run folder.

    Raises:
        ConfigError: there is none, or as ``RecordedRun``.

    """
    return RecordedRun(recording_in(folder))


_FILES = re.compile(r"metadata\.yaml|.*\.(mcap|db3)")
"""What a bag's folder holds."""


def export_bag(folder: Path, target: Path) -> dict[str, int]:
    """Write the recording in a run ``folder`` as the bag ``target``, a folder; atomically.

    Returns the number of messages by topic. Times are simulated, images are ``CompressedImage``.

    Raises:
        InputError: there is no recording, or it is damaged; the target holds other files, or cannot
            be written.

    """
    with extra_imports("bags"):
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    run = open_run(folder)
    kinds = {
        topic: kind
        for topic, kind in run.topics.items()
        if topic != topics.READING and kind in message_types().types
    }
    counts = dict.fromkeys(map(_name, kinds), 0)
    with AtomicFolder(target, _FILES, "--to") as atomic:
        inner = atomic.path / target.name
        writer = Writer(inner, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            links = {
                topic: writer.add_connection(_name(topic), kind, typestore=message_types())
                for topic, kind in kinds.items()
            }
            for topic, log_time, data in run.packed(*kinds):
                writer.write(links[topic], log_time, data)
                counts[_name(topic)] += 1
        for file in inner.iterdir():
            file.rename(atomic.path / file.name)
        inner.rmdir()
    return counts


def _name(topic: str) -> str:
    """The name of ``topic`` in a bag: images as ``image_transport`` calls packed ones."""
    return f"{topic}/compressed" if topic in topics.IMAGES else topic
