"""Reading MCAP files of bounded size: their records, checked, and how much of a file is intact.

The records are parsed by the library ``mcap``. Nothing of a record or chunk is unpacked before its
size is checked.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from navfw.config.extras import extra_imports
from navfw.config.input_file import open_input
from navfw.errors import ConfigError
from navfw.recording.run_folder import MAX_BYTES

with extra_imports("record"):
    from mcap.records import Chunk, DataEnd, McapRecord
    from mcap.stream_reader import StreamReader, breakup_chunk

_EXPANSION = 8
"""Largest size of all unpacked chunks, in units of the largest file."""
_MAX_CHUNK = 1 << 26
"""Largest size of one record, and of one unpacked chunk [byte]; navfw writes chunks of 1 MB."""

_MAGIC = b"\x89MCAP0\r\n"


class McapFile:
    """The records of one MCAP file, read anew by each call of ``records``."""

    def __init__(self, path: Path, max_bytes: int = MAX_BYTES) -> None:
        self.path = path
        self._max_bytes = max_bytes

    def records(self) -> Iterator[McapRecord]:
        """The records up to the end of the data, those in chunks unpacked, in the file's order.

        Of a file without its end, the intact part.

        Raises:
            ConfigError: the file cannot be read, is too large, no MCAP file, or damaged.

        """
        with open_input(self.path, self._max_bytes) as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise self.refused("expected an MCAP file, as navfw run --record writes it")
            ended = _ends_with_magic(stream)
            try:
                yield from self._unpacked(stream)
            except Exception as error:
                if not ended and not stream.read(1):
                    return  # the file is cut off within this record
                # mcap, zstandard and struct raise errors of many kinds for damaged content
                reason = str(error) or type(error).__name__
                raise self.refused(f"the file is damaged ({reason})") from None

    def refused(self, what: str) -> ConfigError:
        """The error that this file is not a recording."""
        return ConfigError(f"not a recording: {what}", file=self.path)

    def _unpacked(self, stream: BinaryIO) -> Iterator[McapRecord]:
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
            yield from breakup_chunk(record, validate_crc=True)


def _ends_with_magic(stream: BinaryIO) -> bool:
    """Whether a file ends as a whole MCAP file does."""
    stream.seek(-len(_MAGIC), io.SEEK_END)
    return stream.read() == _MAGIC and stream.tell() > len(_MAGIC)


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
