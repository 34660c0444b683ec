"""Recover the intact part of bags that a crash or a full disk cut off."""

from __future__ import annotations

import os
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
"""Codes of MCAP records: of a chunk, and the highest code in a file's data and its index."""
_HEAD = struct.Struct("<BQ")
"""The head of a record: its code and its length [byte]."""
_END = _HEAD.pack(0x02, 20) + bytes(20) + _MAGIC
"""The end of a file that has no index."""
_SQLITE = struct.Struct(">16xH10xI")  # defined
"""The size of a page [byte], 1 for 65536, and the number of pages in the head of SQLite's files."""
_MAX_PART = 1 << 28
"""Largest chunk that is unpacked [byte]."""
_TABLES = ("schema", "metadata", "message_definitions", "topics", "messages")
"""Tables of rosbag2's SQLite files."""


def is_cut(path: Path) -> bool:
    """Return whether a bag's file lacks its end, or has messages in a log (``-wal``) beside it.

    Raises:
        ConfigError: it cannot be read.

    """
    log = Path(f"{path}-wal")
    with open_input(path) as file:
        head, size = file.read(_SQLITE.size), file.seek(0, os.SEEK_END)
        if path.suffix == ".mcap":
            file.seek(-min(len(_MAGIC), size), os.SEEK_END)
            return head.startswith(_MAGIC) and file.read() != _MAGIC
    if path.suffix != ".db3" or len(head) < _SQLITE.size:
        return False
    page, pages = _SQLITE.unpack(head)
    return size < (page if page > 1 else 1 << 16) * pages or (
        is_file(log) and log.stat().st_size > 0
    )


def mended(path: Path, folder: Path) -> Path:
    """Write the intact part of the bag's file at ``path`` into ``folder``, and return its path.

    Raises:
        Exception: it is damaged otherwise; of many kinds.

    """
    target = folder / path.name
    if path.suffix == ".mcap":
        _mend_mcap(path, target)
    else:
        _mend_db3(path, target, folder / "cut.db3")
    return target


def _mend_mcap(path: Path, target: Path) -> None:
    """Copy the records of an MCAP file up to the one that is cut, and what that chunk holds."""
    shutil.copyfile(path, target)
    with target.open("r+b") as file:
        end, chunk = _whole_records(file, len(_MAGIC))
        for rest in (_unpacked(chunk), _END):
            file.seek(end)
            file.write(rest)
            file.truncate()
            end, _ = _whole_records(file, end)


def _whole_records(file: BinaryIO, end: int) -> tuple[int, bytes]:
    """Where the whole records behind ``end`` end, and the content of a chunk that is cut there."""
    size = file.seek(0, os.SEEK_END)
    file.seek(end)
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        code, length = _HEAD.unpack(head)
        if not 0 < code <= _LAST or code == 0x02:
            break
        if file.tell() + length > size:
            return end, file.read(_MAX_PART) if code == _CHUNK else b""
        end = file.seek(length, os.SEEK_CUR)
    return end, b""


def _unpacked(chunk: bytes) -> bytes:
    """Return the records at the beginning of a chunk that is cut off."""
    with suppress(struct.error, ValueError, RuntimeError, zstd.ZstdError):
        (width,) = struct.unpack_from("<I", chunk, 28)
        kind, packed = chunk[32 : 32 + width], chunk[40 + width :]
        if kind == b"zstd":
            return zstd.ZstdDecompressor().decompress(packed)
        return bytes(LZ4FrameDecompressor().decompress(packed)) if kind == b"lz4" else packed
    return b""


def _mend_db3(path: Path, target: Path, copy: Path) -> None:
    """Copy the rows of a SQLite file up to the first that is lost, those of its log as well."""
    for ending in ("", "-wal"):
        if is_file(Path(f"{path}{ending}")):
            shutil.copyfile(f"{path}{ending}", f"{copy}{ending}")
    with closing(sqlite3.connect(copy)) as cut, closing(sqlite3.connect(target)) as whole:
        cut.execute("PRAGMA writable_schema=ON")  # otherwise a file that is cut is not opened
        for name in _TABLES:
            with suppress(sqlite3.DatabaseError):
                rows = cut.execute(f"SELECT * FROM {name}")  # noqa: S608 - one of _TABLES
                columns = ",".join(f'"{about[0]}"' for about in rows.description)
                whole.execute(f"CREATE TABLE {name} ({columns})")
                marks = ",".join("?" * len(rows.description))
                whole.executemany(f"INSERT INTO {name} VALUES ({marks})", rows)  # noqa: S608
        whole.commit()
