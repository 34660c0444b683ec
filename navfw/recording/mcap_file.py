"""Reading MCAP files of bounded size: their records, checked, and how much of a file is intact.

The records are parsed by the library ``mcap``. Nothing of a record or chunk is unpacked before its
size is checked.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from navfw.config.extras import extra_imports
from navfw.config.input_file import open_input
from navfw.errors import ConfigError
from navfw.recording.run_folder import MAX_BYTES

with extra_imports("record"):
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, DataEnd, Header, Message, Metadata, Schema
    from mcap.stream_reader import breakup_chunk
    from zstandard import frame_content_size

_EXPANSION = 8
"""Largest size of all unpacked chunks, in units of the largest file."""
_MAX_CHUNK = 1 << 26
"""Largest size of one record, and of one unpacked chunk [byte]; navfw writes chunks of 1 MB."""

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
"""Kind and length of a record."""


class McapFile:
    """The records of one MCAP file, read anew by each call of ``records``."""

    def __init__(self, path: Path, max_bytes: int = MAX_BYTES) -> None:
        self.path = path
        self._max_bytes = max_bytes

    def records(self) -> Iterator[Header | Metadata | Schema | Channel | Message]:
        """Headers, metadata, schemas, channels and messages, in the order of the file.

        Of a file without its end, the intact part.

        Raises:
            ConfigError: the file cannot be read, is too large, no MCAP file, or damaged.

        """
        with open_input(self.path, self._max_bytes) as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise self.refused("expected an MCAP file, as navfw run --record writes it")
            records = self._parsed(stream)
            while (record := self._next(records)) is not None:
                yield record

    def refused(self, what: str) -> ConfigError:
        """The error that this file is not a recording."""
        return ConfigError(f"not a recording: {what}", file=self.path)

    def _next(
        self, records: Iterator[Header | Metadata | Schema | Channel | Message]
    ) -> Header | Metadata | Schema | Channel | Message | None:
        """The next record, None at the end."""
        try:
            return next(records, None)
        except Exception as error:
            # mcap, zstandard and struct raise errors of many kinds for damaged content
            reason = str(error) or type(error).__name__
            raise self.refused(f"the file is damaged ({reason})") from None

    def _parsed(self, stream: BinaryIO) -> Iterator[Header | Metadata | Schema | Channel | Message]:
        left = _EXPANSION * self._max_bytes
        for opcode, body in self._framed(stream):
            if opcode == Opcode.CHUNK:
                chunk = Chunk.read(ReadDataStream(io.BytesIO(body)))
                left -= _unpacked_size(chunk)
                if left < 0:
                    raise ValueError(f"its chunks unpack to more than {_EXPANSION} times its limit")
                for record in breakup_chunk(chunk, validate_crc=True):
                    if isinstance(record, Schema | Channel | Message):
                        yield record
            elif opcode == Opcode.HEADER:
                yield Header.read(ReadDataStream(io.BytesIO(body)))
            elif opcode == Opcode.METADATA:
                yield Metadata.read(ReadDataStream(io.BytesIO(body)))

    def _framed(self, stream: BinaryIO) -> Iterator[tuple[int, bytes]]:
        """Kind and content of the records up to the end of the data, or of the file."""
        ended = _ends_with_magic(stream)
        checksum = zlib.crc32(_MAGIC)
        while True:
            head = stream.read(_HEAD.size)
            opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, 0)
            if length > _MAX_CHUNK and ended:
                raise ValueError(f"a record has {length} bytes, more than {_MAX_CHUNK}")
            body = stream.read(min(length, _MAX_CHUNK))
            if len(head) < _HEAD.size or len(body) < length:
                if ended:
                    raise ValueError("a record ends beyond the file")
                return
            if opcode == Opcode.DATA_END:
                expected = DataEnd.read(ReadDataStream(io.BytesIO(body))).data_section_crc
                if expected not in (0, checksum):
                    raise ValueError("its checksum differs")
                return
            checksum = zlib.crc32(body, zlib.crc32(head, checksum))
            yield opcode, body


def _ends_with_magic(stream: BinaryIO) -> bool:
    """Whether a file ends as a whole MCAP file does; the position in it is kept."""
    here = stream.tell()
    stream.seek(-len(_MAGIC), io.SEEK_END)
    ended = stream.read() == _MAGIC and stream.tell() > len(_MAGIC)
    stream.seek(here)
    return ended


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
        declared = frame_content_size(chunk.data)
    elif chunk.compression == "":
        declared = len(chunk.data)
    else:
        raise ValueError(f"compressed with {chunk.compression!r}, expected zstd")
    if declared not in (-1, size):
        raise ValueError(f"a chunk of {size} bytes has {declared}")
    return size
