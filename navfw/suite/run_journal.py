"""The rows of a suite: their journal, which alone is read, and the cells of the table.

Every run that has ended is written at once to an SQLite database. A run is one transaction: after a
kill or a power cut the journal has all of it or nothing. The primary key is the run with the
fingerprint of what it was made with (``Case.content``), so that no run is there twice, and runs of
a suite that was changed since stay beside the new ones.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from navfw.config.input_file import is_file, open_input
from navfw.errors import ConfigError
from navfw.missions.outcome import Outcome
from navfw.process.atomic import atomic_file
from navfw.suite.run_row import COLUMNS, REQUIRED, RunRow

_OPTIONAL = ("variant", "hazards")
_ADAPTER = TypeAdapter(RunRow)
_VERSION = 2
"""Version of the table, kept as SQLite's ``user_version``."""
_TABLE = f"""
CREATE TABLE run (
    content TEXT NOT NULL, key TEXT NOT NULL, cells TEXT NOT NULL, PRIMARY KEY (content, key)
);
PRAGMA user_version = {_VERSION};
"""
_DAMAGE = {sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}
"""Primary error codes of a file that is damaged, or no journal; not of a full disk."""
_AGAIN = "--restart drives the suite again"


def columns_of(rows: Iterable[RunRow]) -> tuple[str, ...]:
    """The columns of a table of ``rows``; those of ``_OPTIONAL`` are left out if all are empty."""
    rows = list(rows)
    unused = {name for name in _OPTIONAL if not any(getattr(row, name) for row in rows)}
    return tuple(name for name in COLUMNS if name not in unused)


def table_cells(rows: Iterable[RunRow]) -> list[list[str]]:
    """The cells of the table, its head first; floats keep every digit, None is empty."""
    rows = list(rows)
    columns = columns_of(rows)
    return [list(columns), *([_cell(getattr(row, name)) for name in columns] for row in rows)]


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return " ".join(value.split()) if isinstance(value, str) else str(value)


@dataclass(frozen=True)
class RunJournal:
    """The journal in ``file``; every method opens the database and closes it.

    Raises (all methods):
        ConfigError: the file is not a journal, is damaged, or cannot be read or written.

    """

    file: Path

    def create(self) -> None:
        """Create the file with its table, at once, as a kill may come; check one that is there."""
        if is_file(self.file):
            with self._opened() as database:
                (damage,) = database.execute("PRAGMA quick_check(1)").fetchone()
                (version,) = database.execute("PRAGMA user_version").fetchone()
            if damage != "ok":
                what = f"is damaged: {' '.join(damage.split())}; {_AGAIN}"
                raise ConfigError(what, file=self.file)
            if version != _VERSION:
                what = f"was written by another version of navfw; use that one, or {_AGAIN}"
                raise ConfigError(what, file=self.file)
            return
        with contextlib.closing(sqlite3.connect(":memory:")) as database:
            database.executescript(_TABLE)
            empty = database.serialize()
        with atomic_file(self.file) as unfinished:
            unfinished.write_bytes(empty)

    def add(self, content: str, *rows: RunRow) -> None:
        """Write the rows of runs that have ended; they replace earlier ones of the same runs."""
        with self._opened() as database, database:
            for row in rows:
                cells = json.dumps({name: _cell(getattr(row, name)) for name in COLUMNS})
                values = (content, json.dumps(row.key), cells)
                database.execute("INSERT OR REPLACE INTO run VALUES (?, ?, ?)", values)

    def rows(self, contents: Iterable[str]) -> list[RunRow]:
        """The rows that were made with one of ``contents``, in their order; of each as written."""
        by_content: dict[str, list[RunRow]] = {content: [] for content in contents}
        with self._opened() as database:
            for content, cells in database.execute("SELECT content, cells FROM run ORDER BY rowid"):
                if content in by_content:
                    by_content[content].append(self._row(cells))
        return list(itertools.chain.from_iterable(by_content.values()))

    def _row(self, cells: str) -> RunRow:
        """The row with these cells by column; an empty or missing one has its default."""
        try:
            texts = json.loads(cells).items()
            row = _ADAPTER.validate_python({n: text for n, text in texts if text or n in REQUIRED})
            Outcome(row.outcome)
        except (ValueError, TypeError, AttributeError, RecursionError):
            what = f"is damaged: a row has no valid cells; {_AGAIN}"
            raise ConfigError(what, file=self.file) from None
        return row

    @contextlib.contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        try:
            with open_input(self.file):  # no device, which might block
                database = sqlite3.connect(self.file, timeout=10.0)
            with contextlib.closing(database):
                yield database
        except (sqlite3.Error, UnicodeDecodeError) as error:  # names of a damaged schema
            code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
            hint = f"; {_AGAIN}" if code in _DAMAGE else ""
            what = f"cannot be read or written: {error}{hint}"
            raise ConfigError(what, file=self.file) from None
