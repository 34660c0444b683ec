"""Files in XML and SQLite from elsewhere: nothing in them includes or executes anything.

XML has neither document type nor entities, and a bounded depth; a query has a bounded time.
"""

from __future__ import annotations

import os
import re
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from navfw.config.input_file import MAX_TEXT, open_input, read_input, shown_path
from navfw.config.yaml_text import MAX_DEPTH
from navfw.errors import ConfigError

_LINE = "navfw-line"
"""Attribute with the line of an element."""


def read_xml(path: Path, what: str, *, doctype: bool = False) -> Element:
    """The root element of the file; ``line_of`` gives the line of each element.

    A document type, with ``doctype``, may be named, but declares no entities and is not read.

    Raises:
        ConfigError: the file cannot be read, is too large, nested too deep, or not XML; the message
            says that ``what`` was expected, as in "an SDF world".

    """
    return parse_xml(read_input(path, MAX_TEXT), shown_path(path), what, doctype=doctype)


def parse_xml(content: bytes, name: str, what: str, *, doctype: bool = False) -> Element:
    """The root element of ``content``, that of the file ``name``; see ``read_xml``."""
    parser = expat.ParserCreate()
    builder = TreeBuilder()
    depth = 0

    def refuse(*_: object) -> None:
        message = "document types and entities are not allowed; write the text itself"
        raise ConfigError(message, file=name, line=parser.CurrentLineNumber)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise ConfigError("is nested too deep", file=name, line=parser.CurrentLineNumber)
        builder.start(tag, {**attributes, _LINE: str(parser.CurrentLineNumber)})

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    if not doctype:
        parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(content, True)
        root: Element = builder.close()
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, "malformed")
        raise ConfigError(
            f"expected {what}, but it is not XML: {reason}", file=name, line=error.lineno
        ) from None
    except (LookupError, ValueError) as error:  # the declared encoding
        raise ConfigError(
            f"cannot be decoded: {error}; save it as UTF-8", file=name, line=1
        ) from None
    return root


def line_of(element: Element) -> int:
    """The line [from 1] of an element in its file."""
    return int(element.get(_LINE, "1"))


_WAIT = 10.0
"""Longest time [s] to wait for another process that reads or writes the file."""
_STEPS, _SECONDS = 10_000, 10.0
"""Instructions of SQLite between two looks at the time, and the longest time of all queries [s]."""
_MAX_VALUE = 1_000_000
"""Largest text or blob that is read [byte]; a message of a bag is read by rosbags."""

_COMPUTED = re.compile(r"\b(as|virtual)\b", re.IGNORECASE)
"""Words of generated columns and virtual tables; no table of navfw, optuna or ROS has them."""


@contextmanager
def open_database(path: Path) -> Iterator[sqlite3.Connection]:
    """The database in a file, for reading and, if possible, writing.

    A query that ends later than ``_SECONDS`` from now raises ``sqlite3.OperationalError``.

    Raises:
        ConfigError: the file is none that may be read, or its schema has views, triggers or tables
            whose content is computed.
        sqlite3.Error: it is no database, or is damaged.

    """
    with open_input(path):
        pass
    end = time.monotonic() + _SECONDS
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
    """Check a database, a ``kind`` of file, that a library will open; raises ConfigError."""
    try:
        with open_database(path):
            pass
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise ConfigError(f"not a readable {kind}: {error}", file=shown_path(path)) from None
