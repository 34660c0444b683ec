"""Bags that a crash or a full disk cut off: their intact part, as a bag."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import sys
from contextlib import closing, suppress
from pathlib import Path
from typing import BinaryIO

from navfw.config.extras import extra_imports
from navfw.config.input_file import is_file, open_input

with extra_imports("bags"):
    from lz4.frame import LZ4FrameDecompressor

    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd

_MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _LAST = 0x06, 0x0E  # defined
"""Codes of an MCAP record: of a chunk, and the last one of a file's data and its index."""
_HEAD = struct.Struct("<BQ")
"""Code and length of a record."""
_END = _HEAD.pack(0x02, 20) + bytes(20) + _MAGIC
"""The end of a file without an index."""
_PAGE = 512  # defined
"""What the sizes of SQLite's pages are multiples of [byte]."""
_MAX_PART = 1 << 28
"""Largest chunk that is unpacked [byte]."""
_TABLES = ("schema", "metadata", "message_definitions", "topics", "messages")
"""Tables of rosbag2's SQLite files, that with the most rows last."""


def is_unfinished(file: Path) -> bool:
    """Whether a file of SQLite ends within a page, or there is a log of messages beside it."""
    log = Path(f"{file}-wal")
    is_short = file.suffix == ".db3" and file.stat().st_size % _PAGE > 0
    return is_short or (is_file(log) and log.stat().st_size > 0)


def mended(path: Path, folder: Path) -> Path | None:
    """A copy in ``folder`` of the intact part of a bag's file; None if it is not cut off.

    Raises:
        ConfigError: the file cannot be read.
        Exception: it is damaged otherwise; of many kinds.

    """
    target = folder / path.name
    if path.suffix == ".mcap":
        return target if _mend_mcap(path, target) else None
    if path.suffix == ".db3":
        return target if _mend_db3(path, target, folder / "cut.db3") else None
    return None


def _mend_mcap(path: Path, target: Path) -> bool:
    """Copy the records of an MCAP file up to the one that is cut, and what that chunk holds."""
    with open_input(path) as stream, target.open("wb") as out:
        size = stream.seek(0, 2)
        stream.seek(max(size - len(_MAGIC), 0))
        if stream.read() == _MAGIC or stream.seek(0) or stream.read(len(_MAGIC)) != _MAGIC:
            return False
        out.write(_MAGIC)
        while len(head := stream.read(_HEAD.size)) == _HEAD.size:
            code, length = _HEAD.unpack(head)
            if not 0 < code <= _LAST or code == 0x02:
                break
            if stream.tell() + length > size:
                if code == _CHUNK:
                    out.write(_whole_records(_unpacked(stream.read(_MAX_PART))))
                break
            out.write(head)
            _copy(stream, out, length)
        out.write(_END)
    return True


def _copy(stream: BinaryIO, out: BinaryIO, length: int) -> None:
    while length > 0:
        part = stream.read(min(length, 1 << 20))
        out.write(part)
        length -= len(part)


def _unpacked(chunk: bytes) -> bytes:
    """The records at the beginning of a chunk that is cut off."""
    with suppress(struct.error, ValueError, RuntimeError, zstd.ZstdError):
        (width,) = struct.unpack_from("<I", chunk, 28)
        kind, packed = chunk[32 : 32 + width], chunk[40 + width :]
        if kind == b"zstd":
            return zstd.ZstdDecompressor().decompress(packed)
        return bytes(LZ4FrameDecompressor().decompress(packed)) if kind == b"lz4" else packed
    return b""


def _whole_records(data: bytes) -> bytes:
    end = 0
    while end + _HEAD.size <= len(data):
        after = end + _HEAD.size + _HEAD.unpack_from(data, end)[1]
        if after > len(data):
            break
        end = after
    return data[:end]


def _mend_db3(path: Path, target: Path, copy: Path) -> bool:
    """Copy the rows of a SQLite file up to the first that is lost, those of its log as well."""
    for ending in ("", "-wal"):
        if is_file(Path(f"{path}{ending}")):
            shutil.copyfile(f"{path}{ending}", f"{copy}{ending}")
    with closing(sqlite3.connect(copy)) as cut, closing(sqlite3.connect(target)) as whole:
        cut.execute("PRAGMA writable_schema=ON")  # otherwise a file that is cut is not opened
        made = dict(cut.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
        for name in (name for name in _TABLES if name in made):
            whole.execute(made[name])
            with suppress(sqlite3.DatabaseError):
                for row in cut.execute(f"SELECT * FROM {name}"):  # noqa: S608 - one of _TABLES
                    marks = ",".join("?" * len(row))
                    whole.execute(f"INSERT INTO {name} VALUES ({marks})", row)  # noqa: S608
        whole.commit()
    return True
