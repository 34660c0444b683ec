"""SQLite files from elsewhere, whose schema may compute nothing: plain tables and indexes alone."""

from __future__ import annotations

import os
import re
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from navfw.config.input_file import INPUT_BOUNDS, open_input, shown_path
from navfw.errors import ConfigError

_WAIT = 10.0
"""Longest time [s] to wait for another process that reads or writes the file."""
_STEPS = 10_000
"""Instructions of SQLite between two looks at the time."""
_MAX_VALUE = 1_000_000
"""Largest text or blob that is read [byte]; a message of a bag is read by rosbags."""
_COMPUTED = re.compile(r"\b(as|virtual)\b", re.IGNORECASE)
"""Words of generated columns and virtual tables; no table of navfw, optuna or ROS has them."""


@contextmanager
def open_database(path: Path, kind: str) -> Iterator[sqlite3.Connection]:
    """The database of a ``kind`` of ``INPUT_BOUNDS``, for reading and, if possible, writing.

    A query that takes longer than the bound of the kind ends with ``sqlite3.OperationalError``.

    Raises:
        ConfigError: the file is none that may be read, or its schema has views, triggers or tables
            whose content is computed.
        sqlite3.Error: it is no database, or is damaged.

    """
    bounds = INPUT_BOUNDS[kind]
    with open_input(path, bounds.max_bytes):
        pass
    end = time.monotonic() + bounds.seconds
    # the first reading after a kill rolls back what that left unfinished, so it may write
    mode = "rw" if os.access(path, os.W_OK) else "ro"
    place = f"{path.absolute().as_uri()}?mode={mode}"
    with closing(sqlite3.connect(place, _WAIT, uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _MAX_VALUE)
        database.set_progress_handler(lambda: time.monotonic() > end, _STEPS)
        database.execute("PRAGMA trusted_schema = OFF")
        for what, name, text in database.execute("SELECT type, name, sql FROM sqlite_master"):
            if what not in {"table", "index"} or _COMPUTED.search(str(text)):
                message = f"has the {what} {str(name)!r:.40}, whose content would be computed"
                raise ConfigError(f"{message}; only plain tables are read", file=shown_path(path))
        yield database


def check_database(path: Path, kind: str) -> None:
    """Check a database that a library will open; raises ConfigError as ``open_database``."""
    try:
        with open_database(path, kind):
            pass
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise ConfigError(f"not a readable {kind}: {error}", file=shown_path(path)) from None
