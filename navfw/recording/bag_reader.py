"""Bags of ROS 1 and 2: their topics, and their messages in the order of reception.

The library rosbags reads files ``.bag``, ``.mcap`` and ``.db3``, and folders of ROS 2. A bag's own
definitions of messages are not used, as rosbags would execute code made of them: messages are of
the types that it ships.
"""

from __future__ import annotations

import bz2
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from navfw.config.document import load_yaml
from navfw.config.extras import extra_imports
from navfw.config.input_file import is_folder, open_input, shown_path
from navfw.errors import ConfigError, InputError, NavfwError, did_you_mean
from navfw.recording.ros_messages import message_types
from navfw.recording.run_folder import BAG_METADATA

with extra_imports("bags"):
    import lz4.frame
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag1.reader import decompressors
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd

_MAX_BAG = 20_000_000_000
"""Largest size of a bag's file [byte]; it is read message by message."""
_MAX_CHUNK = 1 << 28
"""Largest size of an unpacked chunk or message [byte]; a colour image of 4k has 25 MB."""
_MAX_METADATA = 10_000_000
_SHOWN = 200
"""Largest length of a reason that a message cites."""


def _bounded(unpacker: Callable[[], Any]) -> Callable[..., bytes]:
    def unpack(data: bytes, _: int = 0) -> bytes:
        content: bytes = unpacker().decompress(data, max_length=_MAX_CHUNK + 1)
        if len(content) > _MAX_CHUNK:
            raise ValueError(f"a chunk unpacks to more than {_MAX_CHUNK} bytes")
        return content

    return unpack


_unpacked = _bounded(zstd.ZstdDecompressor)
# rosbags looks these up, and bounds none of its own
decompressors.update(
    bz2=_bounded(bz2.BZ2Decompressor), lz4=_bounded(lz4.frame.LZ4FrameDecompressor)
)
DECOMPRESSORS.update(zstd=_unpacked, lz4=_bounded(lz4.frame.LZ4FrameDecompressor))


class BagMessage(NamedTuple):
    """A message ``content`` of type ``kind``, ``received`` on ``topic`` at a time [ns]."""

    topic: str
    kind: str
    received: int
    content: Any


class Bag:
    """The bag at ``path``.

    ``kinds`` has the type of each topic, as ``sensor_msgs/msg/Imu``, ``counts`` the number of its
    messages. ``begin`` [ns] is when the first was received, ``duration`` [s] the time to the last.

    Raises:
        ConfigError: it cannot be read, is too large, damaged, or packed as a whole.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = shown_path(path)
        self._ros1 = path.suffix == ".bag"
        self._check_files()
        with self._opened() as (reader, _):
            self.kinds = {each.topic: str(each.msgtype) for each in reader.connections}
            self.counts = dict.fromkeys(self.kinds, 0)
            for each in reader.connections:
                self.counts[each.topic] += each.msgcount
            self.begin = int(reader.start_time)
            self.duration = max(1e-9 * reader.duration, 0.0)

    def messages(self, *topics: str) -> Iterator[BagMessage]:
        """The messages on ``topics``, in the order of their reception.

        Raises:
            ConfigError: the bag or a message is damaged, or of another definition than usual.

        """
        with self._opened() as (reader, is_packed):
            wanted = [each for each in reader.connections if each.topic in topics]
            for each, received, data in reader.messages(wanted) if wanted else ():
                plain = _unpacked(data) if is_packed else data
                content = self._content(each.msgtype, each.digest, plain)
                yield BagMessage(each.topic, each.msgtype, received, content)

    def only(self, topic: str, *kinds: str) -> str:
        """The ``topic``, which must be in the bag and of one of ``kinds``.

        Raises:
            InputError: it is not; the message names the nearest one.

        """
        known = [name for name, kind in self.kinds.items() if kind in kinds]
        if topic not in known:
            hint = did_you_mean(topic, known)
            raise InputError(f"no images on {topic!r}: {hint}", file=self.file, key="--topic")
        return topic

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, bool]]:
        """The open reader, and whether its messages are packed."""
        try:
            with (rosbag1 if self._ros1 else rosbag2).Reader(self.path) as reader:
                is_packed = not self._ros1 and reader.compression_mode == "message"
                if is_packed:  # unpacked within bounds, not by rosbags
                    about = reader.storage.metadata
                    reader.storage.metadata = about._replace(compression_mode=None)
                yield reader, is_packed
        except NavfwError:
            raise
        except Exception as error:  # rosbags raises errors of many kinds for damaged content
            reason = " ".join(str(error).split())[:_SHOWN] or type(error).__name__
            hint = "; of a run's recording make one by navfw export" if "ros2" in reason else ""
            raise ConfigError(f"not a readable bag: {reason}{hint}", file=self.file) from None

    def _content(self, kind: str, digest: str, data: bytes) -> Any:
        types = message_types(ros1=self._ros1)
        if kind not in types.types:
            raise ValueError(f"messages of type {kind} are unknown")
        if not self._ros1:
            return types.deserialize_cdr(data, kind)
        if digest not in {types.generate_msgdef(kind)[1], "*"}:
            raise ValueError(f"{kind} has another definition than that of ROS 1 Noetic")
        return types.deserialize_ros1(data, kind)

    def _check_files(self) -> None:
        """Raise ConfigError unless all files are regular, of bounded size, and not packed."""
        files = [self.path]
        if is_folder(self.path):
            listed = load_yaml(self.path / BAG_METADATA, _MAX_METADATA).data
            about = listed.get("rosbag2_bagfile_information") if isinstance(listed, dict) else None
            names = about.get("relative_file_paths") if isinstance(about, dict) else None
            if not isinstance(about, dict) or not isinstance(names, list):
                what = "not a bag: expected rosbag2_bagfile_information with relative_file_paths"
                raise ConfigError(what, file=f"{self.file}/{BAG_METADATA}")
            if str(about.get("compression_mode")).lower() == "file":
                what = "its files are packed as a whole; unpack them by ros2 bag convert"
                raise ConfigError(what, file=self.file)
            files = [self.path / PurePath(str(name)).name for name in names]
        for file in files:
            with open_input(file, _MAX_BAG):
                pass
