"""The journal of a suite: every run that has ended, written at once to an SQLite database.

A run is one transaction: after a kill or a power cut the journal has all of it or nothing. The
primary key is the run with the fingerprint of what it was made with (``Case.content``), so that no
run is there twice, and runs of a suite that was changed since stay beside the new ones. Rows are
the cells of the table (``navfw.suite.run_table``) with a checksum, as SQLite has none.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import os
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from navfw.config.input_file import is_file, no_such_file
from navfw.errors import ConfigError, InputError
from navfw.process.atomic import atomic_file
from navfw.suite.run_table import RunKey, RunRow, cells_of_row, row_of_cells

_VERSION = 1
"""Version of the tables, kept as SQLite's ``user_version``."""

_MAX_JOURNAL = 2_000_000_000
"""Largest size of a journal [byte]; the largest suite takes a tenth of it."""

WAIT = 10.0
"""Longest time [s] to wait for another process that reads or writes the journal."""

_TABLES = f"""
CREATE TABLE run (
    content TEXT NOT NULL, key TEXT NOT NULL, cells TEXT NOT NULL, checksum TEXT NOT NULL,
    PRIMARY KEY (content, key)
);
CREATE TABLE death (content TEXT NOT NULL, key TEXT NOT NULL, reason TEXT NOT NULL);
PRAGMA user_version = {_VERSION};
"""
_DAMAGE = {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR}
"""Primary error codes of a damaged file; SQLITE_ERROR is that of a table that is not there."""


class JournalDamagedError(ConfigError):
    """The journal is damaged; ``ready_journal`` keeps what is intact."""


@dataclass(frozen=True)
class RunJournal:
    """The journal in ``file``; every method opens the database and closes it.

    Raises (all methods):
        JournalDamagedError: the file is not a journal, or parts of it cannot be read.
        InputError: it cannot be read or written.

    """

    file: Path

    def create(self) -> None:
        """Create the file with its tables, if it is not there: at once, as a kill may come."""
        if is_file(self.file):
            return
        with contextlib.closing(sqlite3.connect(":memory:")) as database:
            database.executescript(_TABLES)
            empty = database.serialize()
        with atomic_file(self.file) as part:
            part.write_bytes(empty)

    def add(self, content: str, row: RunRow) -> None:
        """Write the row of a run that has ended; it replaces an earlier one of the same run."""
        self.add_all([(content, row)])

    def add_all(self, rows: Iterable[tuple[str, RunRow]]) -> None:
        """Write many rows, each with its content, in one transaction."""
        with self._opened() as database, database:
            for content, row in rows:
                key, cells = _key_text(row.key), json.dumps(cells_of_row(row))
                values = (content, key, cells, _checksum(content, key, cells))
                database.execute("INSERT OR REPLACE INTO run VALUES (?, ?, ?, ?)", values)
                database.execute("DELETE FROM death WHERE content = ? AND key = ?", (content, key))

    def add_death(self, content: str, key: RunKey, reason: str) -> None:
        """Note that the process of a run died; forgotten when the run has a row."""
        with self._opened() as database, database:
            values = (content, _key_text(key), reason)
            database.execute("INSERT INTO death VALUES (?, ?, ?)", values)

    def rows(self, contents: Iterable[str]) -> list[RunRow]:
        """The rows that were made with one of ``contents``, in their order; of each as written."""
        by_content: dict[str, list[RunRow]] = {content: [] for content in contents}
        for content, row in self.all_rows():
            by_content.get(content, []).append(row)
        return list(itertools.chain.from_iterable(by_content.values()))

    def all_rows(self) -> list[tuple[str, RunRow]]:
        """All rows with their contents, also those of a suite that was changed since.

        A row that differs from its checksum is damage.
        """
        with self._opened() as database:
            records = list(database.execute("SELECT * FROM run ORDER BY rowid"))
        return [self._checked(*record) for record in records]

    def deaths(self, contents: Collection[str]) -> Counter[RunKey]:
        """The number of deaths of the runs that have no row since."""
        with self._opened() as database:
            deaths = list(database.execute("SELECT content, key FROM death"))
        return Counter(RunKey(*json.loads(key)) for content, key in deaths if content in contents)

    def check(self) -> None:
        """Have SQLite look for damage in the whole file."""
        with self._opened() as database:
            (version,) = database.execute("PRAGMA user_version").fetchone()
            if version > _VERSION:
                what = f"was written by a newer navfw (version {version} of the journal)"
                raise InputError(f"{what}; use that one, or choose another --out", file=self.file)
            (damage,) = database.execute("PRAGMA quick_check(1)").fetchone()
            if damage != "ok":
                raise JournalDamagedError(f"is damaged: {damage}", file=self.file)

    def intact(self) -> list[tuple[str, RunRow]]:
        """All rows of a damaged journal that can be read, from its beginning and from its end."""
        rows: dict[str, tuple[str, RunRow]] = {}
        for order in ("ASC", "DESC"):
            with contextlib.suppress(InputError), self._opened() as database:
                for values in database.execute(f"SELECT * FROM run ORDER BY rowid {order}"):  # noqa: S608 - one of two words
                    with contextlib.suppress(ConfigError):
                        content, row = self._checked(*values)
                        rows.setdefault(json.dumps([content, row.key]), (content, row))
        return list(rows.values())

    def _checked(
        self, content: object, key: object, cells: object, checksum: object
    ) -> tuple[str, RunRow]:
        """The content and the row of one line of the database, by its checksum."""
        if not (isinstance(content, str) and isinstance(key, str) and isinstance(cells, str)):
            raise JournalDamagedError("is damaged: a row is not text", file=self.file)
        if checksum != _checksum(content, key, cells):
            raise JournalDamagedError("is damaged: a row differs from its checksum", file=self.file)
        try:
            return content, row_of_cells(json.loads(cells))
        except (ValueError, AttributeError):  # in spite of its checksum
            what = "is damaged: a row has no valid cells"
            raise JournalDamagedError(what, file=self.file) from None

    @contextlib.contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        if not is_file(self.file):
            raise no_such_file(self.file)
        if self.file.stat().st_size > _MAX_JOURNAL:
            what = f"is larger than {_MAX_JOURNAL // 1_000_000} MB, so it is not read"
            raise InputError(what, file=self.file)
        # the first reading after a kill rolls back what that left unfinished, so it may write
        mode = "rw" if os.access(self.file, os.W_OK) else "ro"
        place = f"{self.file.absolute().as_uri()}?mode={mode}"
        try:
            with contextlib.closing(sqlite3.connect(place, WAIT, uri=True)) as database:
                yield database
        except sqlite3.Error as error:
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            if code in _DAMAGE:
                raise JournalDamagedError(f"is damaged: {error}", file=self.file) from None
            raise InputError(f"cannot be read or written: {error}", file=self.file) from None


def ready_journal(journal: RunJournal) -> str:
    """Make ``journal`` usable; returns what was done, in a sentence, or "" for an intact one.

    A damaged journal is moved aside, and its intact rows go to a new one.

    Raises:
        InputError: the journal is of a newer version, or the folder cannot be written.

    """
    if not journal.file.exists():
        journal.create()
        return ""
    try:
        journal.check()
        journal.all_rows()
    except JournalDamagedError as error:
        kept = journal.intact()
        aside = _moved_aside(journal.file)
        journal.create()
        journal.add_all(kept)
        intact = f"{len(kept)} finished runs are intact and kept"
        return f"{error}; it is kept as {aside.name}. {intact}; all others are driven again"
    return ""


def _moved_aside(file: Path) -> Path:
    """Rename a damaged journal, with SQLite's own file of its last transaction."""
    try:
        for number in itertools.count(1):
            aside = file.with_name(f"{file.stem}-damaged-{number}{file.suffix}")
            if not aside.exists():
                rest = file.with_name(f"{file.name}-journal")
                if rest.exists():
                    rest.rename(aside.with_name(f"{aside.name}-journal"))
                return file.rename(aside)
    except OSError as error:
        what = f"is damaged, and cannot be renamed: {error.strerror or error}"
        raise InputError(what, file=file) from None
    raise AssertionError("numbers have no end")


def _key_text(key: RunKey) -> str:
    return json.dumps(key)


def _checksum(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]
