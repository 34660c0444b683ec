"""The rows of a suite: their journal, which alone is read, and the table exported from it.

Every run that has ended is written at once to an SQLite database. A run is one transaction: after a
kill or a power cut the journal has all of it or nothing. The primary key is the run with the
fingerprint of what it was made with (``Case.content``), so that no run is there twice, and runs of
a suite that was changed since stay beside the new ones. Rows are the cells of the table with a
checksum, as SQLite has none.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import itertools
import json
import math
import re
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from pydantic import TypeAdapter

from navfw.config.foreign_files import open_database
from navfw.config.input_file import is_file
from navfw.errors import ConfigError, InputError
from navfw.missions.outcome import Outcome
from navfw.process.atomic import atomic_file, write_text
from navfw.suite.failure_causes import Cause

_DEATHS = {Cause.PROCESS_DIED, Cause.TOO_LONG, Cause.TOO_MUCH_MEMORY}
"""Causes of runs that ended with their process."""


class RunKey(NamedTuple):
    """The columns that identify a run of a suite."""

    entry: str
    world: str
    mission: str
    seed: int
    stack: str
    variant: str = ""

    def file_name(self, *, generated: bool) -> str:
        """A name for files of the run, unique in the table, that tells which run it is.

        In a ``generated`` world the seed stands for the world.
        """
        where = () if generated else (self.world, self.mission)
        words = dict.fromkeys((self.entry, *where, self.variant or self.stack, str(self.seed)))
        return re.sub(r"[^\w.+-]+", "_", "-".join(words))


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow:
    """One run. Lengths in metres, times in seconds; None where a run has no such number.

    ``cause`` is the cause of a failure (``navfw.suite.failure_causes``), ``collision_cause`` the
    body that moved into the other: "robot" or "mover". ``picture`` is a file beside the table.
    ``variant`` is empty in suites without variants, ``hazards`` where worlds list none; their
    tables have no such column. Hazards are separated by commas.
    ``plugin_faults`` is the number of objections (``MissionResult.objections``). ``attempts``
    is the number of processes that the run took: 2 if the first one died. ``cpu_time_s`` is the
    processor time of the whole run, with its world, checks and picture, ``memory_mb`` the largest
    resident memory [MB] of the process since its start. Those of the localisation are explained at
    ``navfw.missions.run_metrics.LocalizationMetrics``.
    """

    entry: str
    family: str = ""
    world: str
    mission: str
    seed: int
    difficulty: float | None = None
    stack: str
    variant: str = ""
    hazards: str = ""
    outcome: str
    reason: str = ""
    cause: str = ""
    behavior: str = ""
    sim_time_s: float | None = None
    wall_time_s: float | None = None
    real_time_factor: float | None = None
    path_length_m: float | None = None
    shortest_path_m: float | None = None
    spl: float | None = None
    sct: float | None = None
    min_clearance_m: float | None = None
    clearance_p05_m: float | None = None
    collisions: int | None = None
    collision_cause: str = ""
    distance_to_goal_m: float | None = None
    estimate_error_m: float | None = None
    localized_after_m: float | None = None
    lost_s: float | None = None
    confidently_wrong_s: float | None = None
    emergencies: int | None = None
    route_changes: int | None = None
    plugin_faults: int | None = None
    barn_score: float | None = None
    command_hash: str = ""
    picture: str = ""
    attempts: int | None = None
    cpu_time_s: float | None = None
    memory_mb: float | None = None

    @property
    def key(self) -> RunKey:
        """The columns that identify the run."""
        return RunKey(self.entry, self.world, self.mission, self.seed, self.stack, self.variant)

    @property
    def configuration(self) -> str:
        """The variant that was driven; the stack, in a suite without variants."""
        return self.variant or self.stack

    @property
    def succeeded(self) -> bool:
        """Whether the mission was accomplished."""
        return self.outcome == Outcome.REACHED

    @property
    def failure(self) -> str:
        """Outcome and cause of a run that failed, by which failures are counted and grouped."""
        return f"{self.outcome}: {self.cause}"

    @property
    def died(self) -> bool:
        """Whether the process of the run ended without a result, or was ended at a limit."""
        return self.outcome == Outcome.FAULT and self.cause in _DEATHS

    @property
    def has_result(self) -> bool:
        """Whether the run ended by itself; ``navfw suite --resume`` drives all others again."""
        return self.outcome != Outcome.CANCELLED and not self.died


COLUMNS = tuple(field.name for field in dataclasses.fields(RunRow))
_REQUIRED = {"entry", "world", "mission", "seed", "stack", "outcome"}
_OPTIONAL = ("variant", "hazards")
_ADAPTER = TypeAdapter(RunRow)


def columns_of(rows: Iterable[RunRow]) -> tuple[str, ...]:
    """The columns of a table of ``rows``; those of ``_OPTIONAL`` are left out if all are empty."""
    rows = list(rows)
    unused = {name for name in _OPTIONAL if not any(getattr(row, name) for row in rows)}
    return tuple(name for name in COLUMNS if name not in unused)


def write_table(path: Path, rows: Iterable[RunRow]) -> None:
    """Write ``rows`` as CSV (see ``table_cells``).

    Raises:
        InputError: the file cannot be written; an existing file stays unchanged.

    """
    write_text(path, table_cells(rows))


def table_cells(rows: Iterable[RunRow]) -> list[list[str]]:
    """The cells of the table, its head first; floats keep every digit, None is empty."""
    rows = list(rows)
    columns = columns_of(rows)
    return [list(columns), *([_cell(getattr(row, name)) for name in columns] for row in rows)]


def _row_of(cells: Mapping[str, str]) -> RunRow:
    """The row with these cells by column; an empty or missing one has its default.

    Raises:
        ValueError: a required cell is missing, one is no number where a number is expected, or the
            outcome is unknown.

    """
    filled = {name: text for name, text in cells.items() if text or name in _REQUIRED}
    row = _ADAPTER.validate_python(filled)
    Outcome(row.outcome)
    return row


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return " ".join(value.split()) if isinstance(value, str) else str(value)


_VERSION = 1
"""Version of the tables, kept as SQLite's ``user_version``."""

"""The kind of file, by which it is bounded."""

_TABLES = f"""
CREATE TABLE run (
    content TEXT NOT NULL, key TEXT NOT NULL, cells TEXT NOT NULL, checksum TEXT NOT NULL,
    PRIMARY KEY (content, key)
);
CREATE TABLE death (content TEXT NOT NULL, key TEXT NOT NULL, reason TEXT NOT NULL);
PRAGMA user_version = {_VERSION};
"""
_DAMAGE = {
    *(sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_TOOBIG),
    *(sqlite3.SQLITE_ERROR, sqlite3.SQLITE_INTERRUPT),
}
"""Primary error codes of a damaged file: also those of a missing table, and of reading too long."""


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
        with atomic_file(self.file) as unfinished:
            unfinished.write_bytes(empty)

    def add(self, content: str, row: RunRow) -> None:
        """Write the row of a run that has ended; it replaces an earlier one of the same run."""
        self.add_all([(content, row)])

    def add_all(self, rows: Iterable[tuple[str, RunRow]]) -> None:
        """Write many rows, each with its content, in one transaction."""
        with self._opened() as database, database:
            for content, row in rows:
                key = json.dumps(row.key)
                cells = json.dumps({name: _cell(getattr(row, name)) for name in COLUMNS})
                values = (content, key, cells, _checksum(content, key, cells))
                database.execute("INSERT OR REPLACE INTO run VALUES (?, ?, ?, ?)", values)
                database.execute("DELETE FROM death WHERE content = ? AND key = ?", (content, key))

    def add_death(self, content: str, key: RunKey, reason: str) -> None:
        """Note that the process of a run died; forgotten when the run has a row."""
        with self._opened() as database, database:
            values = (content, json.dumps(key), reason)
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
            records = list(self._records(database, "run", "ASC"))
        return [self._checked(*record) for record in records]

    def deaths(self, contents: Collection[str]) -> Counter[RunKey]:
        """The number of deaths of the runs that have no row since."""
        with self._opened() as database:
            deaths = list(self._records(database, "death", "ASC"))
        try:
            keys = [(content, RunKey(*json.loads(str(key)))) for content, key, _ in deaths]
            return Counter(key for content, key in keys if content in contents)
        except (ValueError, TypeError, RecursionError):
            what = "is damaged: a death has no valid key"
            raise JournalDamagedError(what, file=self.file) from None

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
                for values in self._records(database, "run", order):
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
            return content, _row_of(json.loads(cells))
        except (ValueError, AttributeError):  # in spite of its checksum
            what = "is damaged: a row has no valid cells"
            raise JournalDamagedError(what, file=self.file) from None

    def _records(
        self, database: sqlite3.Connection, table: str, order: str
    ) -> Iterator[tuple[object, ...]]:
        """All records of a table; no more than the journal has room for, as pages may be shared."""
        room = self.file.stat().st_size
        for record in database.execute(f"SELECT * FROM {table} ORDER BY rowid {order}"):  # noqa: S608 - words of this module
            room -= sum(len(str(value)) for value in record)
            if room < 0:
                raise JournalDamagedError("is damaged: more rows than it can have", file=self.file)
            yield record

    @contextlib.contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        try:
            with open_database(self.file) as database:
                yield database
        except (sqlite3.Error, UnicodeDecodeError) as error:  # names of a damaged schema
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            if code in _DAMAGE or isinstance(error, UnicodeDecodeError):
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
        journal.deaths(())
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
        numbers = (f"{file.stem}-damaged-{number}" for number in itertools.count(1))
        places = (file.with_name(f"{name}{file.suffix}") for name in numbers)
        aside = next(place for place in places if not place.exists())
        rest = file.with_name(f"{file.name}-journal")
        if rest.exists():
            rest.rename(aside.with_name(f"{aside.name}-journal"))
        return file.rename(aside)
    except OSError as error:
        what = f"is damaged, and cannot be renamed: {error.strerror or error}"
        raise InputError(what, file=file) from None


def _checksum(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]
