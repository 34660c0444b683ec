"""Read a recording: the messages of its channels with their simulated times, and its images.

>>> run = open_run("runs/office-lobby-to-lab-0")                         # doctest: +SKIP
>>> for message in run.messages("/command"):                             # doctest: +SKIP
...     print(message.time, message.content["leader"])
>>> image = run.image_at(12.5)                                           # doctest: +SKIP

``docs/recordings.md`` lists the channels with their schemas.

The records of the MCAP file are parsed by the library ``mcap``.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.image_file import decode_image
from navfw.config.input_file import open_input, shown_path
from navfw.errors import ConfigError
from navfw.numerics import Image
from navfw.process.atomic import AtomicFolder
from navfw.recording import channel_list as topics
from navfw.recording.ros_messages import message_types
from navfw.recording.run_folder import recording_in

with extra_imports("record"):
    from mcap.records import Channel, DataEnd, Header, McapRecord, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader
    from mcap.well_known import MessageEncoding
    from mcap_protobuf.decoder import DecoderFactory

_MAX_RECORD = 1 << 26
"""Largest size of one record, a chunk included [byte]; navfw's chunks have 0.3 MB."""
_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """A message of channel ``topic`` at simulated ``time`` [s].

    ``content`` is a dict for JSON, otherwise an object with the fields of its schema, of Foxglove
    or of ROS 2 (``message.content.data``).
    """

    topic: str
    time: float
    content: Any


class RecordedRun:
    """Reads the recording in an MCAP file that ``navfw run --record`` wrote.

    ``metadata`` describes the run (``config``: the resolved configuration as JSON), ``topics`` has
    the schema of each channel in the file by its topic. ``complete`` is False if the recording ends
    before its run: the recorder reached its limit, or the file is cut off. Then the messages are
    those of the intact part. ``chase`` draws views of the robot from behind, if it is set.

    Raises:
        ConfigError: the file cannot be read, is too large, or damaged; it is not a recording, or
            one of another version.

    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.metadata: dict[str, str] = {}
        self.complete = False
        self.chase: topics.Chase | None = None
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, Schema] = {}
        self._protobuf = DecoderFactory()
        self._scan()
        self.topics = {
            channel.topic: self._schemas[channel.schema_id].name
            for channel in self._channels.values()
        }

    def messages(self, *wanted: str) -> Iterator[RecordedMessage]:
        """Yield the decoded messages of ``wanted`` topics (none given: of all) in the file's order.

        Raises:
            ConfigError: a message is damaged.

        """
        channels = self._channels.values()
        decoders = {c.topic: self._decoder(c) for c in channels if not wanted or c.topic in wanted}
        for topic, log_time, data in self.packed(*decoders):
            try:
                content = decoders[topic](data)
            except Exception as error:  # of the decoders of protobuf, CDR and JSON
                reason = str(error) or type(error).__name__
                raise self.refused(f"a message of {topic} is damaged ({reason})") from None
            yield RecordedMessage(topic, 1e-9 * log_time, content)

    def packed(self, *wanted: str) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time [ns] and raw bytes of messages of ``wanted`` topics, in file order.

        Raises:
            ConfigError: the file is damaged.

        """
        of = {channel.id: channel.topic for channel in self._channels.values()}
        for record in self._records():
            if isinstance(record, Message) and of[record.channel_id] in wanted:
                yield of[record.channel_id], record.log_time, record.data

    def image_at(self, time: float, topic: str = topics.CAMERA_IMAGE) -> Image | None:
        """Return the newest image (height, width) of ``topic`` at ``time`` [s]; None before any.

        Raises:
            ConfigError: the image is damaged.

        """
        newest = None
        for message in self.messages(topic):
            if message.time > time + 1e-9:
                break
            newest = message
        return None if newest is None else image_of(newest, self.path)

    def _records(self) -> Iterator[McapRecord]:
        """Yield the records up to the end of the data, those in chunks unpacked, in file order."""
        with open_input(self.path, topics.MAX_BYTES) as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise self.refused("expected an MCAP file, as navfw run --record writes it")
            stream.seek(-len(_MAGIC), io.SEEK_END)  # as a whole file ends
            ended = stream.read() == _MAGIC and stream.tell() > len(_MAGIC)
            stream.seek(0)
            reader = StreamReader(stream, validate_crcs=True, record_size_limit=_MAX_RECORD)
            try:
                yield from takewhile(lambda record: not isinstance(record, DataEnd), reader.records)
            except Exception as error:
                if not ended and not stream.read(1):
                    return  # the file is cut off within this record
                # mcap, zstandard and struct raise errors of many kinds for damaged content
                reason = str(error) or type(error).__name__
                raise self.refused(f"the file is damaged ({reason})") from None

    def refused(self, what: str) -> ConfigError:
        """Return the error, for the caller to raise, that the file is not a recording."""
        return ConfigError(f"not a recording: {what}", file=self.path)

    def _scan(self) -> None:
        """Read the whole file once: metadata, channels, and whether it is intact."""
        records = self._records()
        header = next(records, None)
        profile = header.profile if isinstance(header, Header) else ""
        expected = f"{topics.PROFILE}{topics.FORMAT_VERSION}"
        if profile != expected:
            what = f"an MCAP file of profile {profile!r}, this navfw reads {expected!r}"
            raise self.refused(f"{what}; record the run again by navfw run --record")
        for record in records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                schema = self._schemas.get(record.schema_id)
                if schema is None:
                    raise self.refused(f"channel {record.topic} has no schema")
                if record.topic == topics.READING and schema.data != topics.SCHEMA.encode():
                    raise self.refused(f"the fields of {record.topic} are not of this version")
                self._channels[record.id] = record
            elif isinstance(record, Metadata):
                self.complete |= record.name == topics.END
                if record.name == topics.RUN:
                    self.metadata = dict(record.metadata)
            elif isinstance(record, Message) and record.channel_id not in self._channels:
                raise self.refused("the file is damaged (a message without a channel)")

    def _decoder(self, channel: Channel) -> Callable[[bytes], Any]:
        schema = self._schemas[channel.schema_id]
        if channel.message_encoding == MessageEncoding.JSON:
            return json.loads
        if schema.name in message_types().types:
            return partial(message_types().deserialize_cdr, typename=schema.name)
        try:
            return self._protobuf.decoder_for(channel.message_encoding, schema) or bytes
        except Exception as error:  # protobuf raises errors of many kinds for damaged schemas
            what = f"the schema of {channel.topic} is damaged ({error})"
            raise self.refused(what) from None


_OF_DAMAGE = ArithmeticError, AttributeError, LookupError, TypeError, ValueError, cv2.error


@contextmanager
def located_damage(file: Path, what: str) -> Iterator[None]:
    """Raise a ConfigError that names ``file`` if fields of ``what`` are missing or impossible."""
    try:
        yield
    except _OF_DAMAGE as error:
        reason = f"{type(error).__name__}: {error}"
        raise ConfigError(f"{what} is damaged ({reason})", file=file) from None


def image_of(message: RecordedMessage, path: Path) -> Image:
    """Decode the image in a message of ``CompressedImage``: (height, width) uint8, luminance.

    Raises:
        ConfigError: the image is damaged or too large; the message has ``path`` and time.

    """
    where = f"{shown_path(path)}: {message.topic} at {message.time:.2f} s"
    image = decode_image(bytes(message.content.data), where, cv2.IMREAD_GRAYSCALE)
    return np.asarray(image, dtype=np.uint8)


def open_run(folder: str | Path, chase: topics.Chase | None = None) -> RecordedRun:
    """Open the recording in a run folder; ``chase`` draws the robot in its world, if known.

    Raises:
        ConfigError: there is none, or as ``RecordedRun``.

    """
    run = RecordedRun(recording_in(folder))
    run.chase = chase
    return run


_FILES = re.compile(r"metadata\.yaml|.*\.(mcap|db3)")
"""Names of the files in a bag's folder."""


def export_bag(folder: Path, target: Path) -> dict[str, int]:
    """Write the recording in a run ``folder`` as a bag of ROS 2, the folder ``target``, atomically.

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
        if topic not in (topics.READING, topics.DECISION) and kind in message_types().types
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
    """Return the name of ``topic`` in a bag: of images as ``image_transport`` names packed ones."""
    return f"{topic}/compressed" if topic in topics.IMAGES else topic
