"""The rows of a suite's table, one per run, and the journal that stores them.

A new column is one line here: its name, its type, and where in the ``MissionResult`` it comes from.

Every run that has ended is written at once to an SQLite database, the journal; rows are read only
from there. A run is one transaction: after a kill or a power cut the journal has all of it or
nothing. The primary key is the run's ``RunKey`` with the fingerprint of what it was made with
(``Case.content``), so that no run is there twice, and old runs of a changed suite stay there.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from pydantic import TypeAdapter

from navfw.config.input_file import is_file, open_input
from navfw.errors import ConfigError
from navfw.missions.outcome import Cause, Outcome
from navfw.process.atomic import atomic_file

if TYPE_CHECKING:
    from navfw.missions.session import MissionResult

_DEATHS = {Cause.PROCESS_DIED, Cause.TOO_LONG, Cause.TOO_MUCH_MEMORY}
"""Causes of runs that ended with their process."""

_BARN_SPEED = 2.0
"""The BARN challenge's reference speed [m/s]: OT is the path's length divided by it."""

_LEFT_SHOWN = 5
"""Number of regions left unexplored in a row."""

V = TypeVar("V")


class RunKey(NamedTuple):
    """The columns that identify a run of a suite."""

    entry: str
    world: str
    mission: str
    seed: int
    stack: str
    variant: str = ""

    def file_name(self, *, generated: bool) -> str:
        """Return a base name for files of the run: readable, and unique in the table.

        For a ``generated`` world it leaves out world and mission, which the seed determines.
        """
        where = () if generated else (self.world, self.mission)
        words = dict.fromkeys((self.entry, *where, self.variant or self.stack, str(self.seed)))
        return re.sub(r"[^\w.+-]+", "_", "-".join(words))


def _of(source: Callable[[MissionResult], V], missing: V) -> V:
    """Return a column from ``source``; ``missing`` in the row of a run without a result."""
    return field(default=missing, metadata={"source": source})


def sct(succeeded: bool, time: float, shortest: float, max_speed: float) -> float:
    """Success weighted by completion time (Yokoyama, Ha, Batra 2021, arXiv 2103.08022).

    S T / max(C, T) with S 1 for success, else 0, C the ``time`` [s] taken and T the fastest time:
    the shortest path ``shortest`` [m] at ``max_speed`` [m/s], which no robot reaches, as it has to
    accelerate, turn and stop. The paper plans T with the robot's dynamics: its values are higher.

    >>> sct(True, time=40.0, shortest=10.0, max_speed=0.5)
    0.5
    """
    fastest = shortest / max_speed
    longest = max(time, fastest)
    return fastest / longest if succeeded and longest > 0.0 else float(succeeded)


def barn_score(succeeded: bool, time: float, path: float) -> float:
    """Return the BARN challenge's score of a run, 0 to 0.5: success x OT / clip(AT, 2 OT, 8 OT).

    OT is the time for the length [m] of the reference ``path`` at 2 m/s, AT the ``time`` [s] from
    the first 0.1 m to within 1 m of the goal (``run_metrics.traversal_time``). The best score is
    0.5; a robot of 0.5 m/s reaches at most 0.25.

    >>> barn_score(True, time=25.0, path=10.0)
    0.2
    """
    if not succeeded:
        return 0.0
    best = path / _BARN_SPEED
    return best / min(max(time, 2.0 * best), 8.0 * best) if best > 0.0 else 0.5


def slowest_reasons(why_slower: Mapping[str, float], count: int = 3) -> str:
    """Format the first ``count`` reasons with their shares of time (0 to 1) as text.

    >>> slowest_reasons({"go_to_xy: IF a THEN b": 0.25, "speeding up": 0.1})
    '25 % go_to_xy: IF a THEN b; 10 % speeding up'
    """
    shares = itertools.islice(why_slower.items(), count)
    return "; ".join(f"{100.0 * share:.0f} % {reason}" for reason, share in shares)


def _sct(run: MissionResult) -> float:
    speed = run.session.mission.spec.robot.max_v
    return sct(run.outcome.succeeded, run.sim_time_s, run.shortest_path_m, speed)


def _barn_score(run: MissionResult) -> float | None:
    path = run.session.mission.spec.success.reference
    if path is None:
        return None
    return barn_score(run.outcome.succeeded, run.traversal_s, path)


def _explored(run: MissionResult, name: str) -> float | None:
    return None if run.exploration is None else float(getattr(run.exploration, name))


def _unexplored(run: MissionResult) -> str:
    """Return the largest regions that an exploration left, as text."""
    left = () if run.exploration is None else run.exploration.unexplored[:_LEFT_SHOWN]
    return "; ".join(f"{r.area:.1f} m2 at ({r.x:.1f}, {r.y:.1f}): {r.why}" for r in left)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow:
    """One run of a suite. Lengths in metres, times in seconds; None: the run has no such number.

    ``cause`` is the cause of a failure (``navfw.missions.outcome.Cause``), ``reason`` explains it
    in words. ``collision_cause`` is the body that moved into the other: "robot" or "mover", "" for
    none. ``picture`` is a file, relative to the table; "" if none was kept.
    ``variant``, ``hazards`` (separated by commas) and the three figures of explorations are columns
    of the table only if a run has a value in them (``OPTIONAL``).
    ``plugin_faults`` is the number of objections (``MissionResult.objections``). ``attempts``
    is the number of processes that drove the run: 2 if the first one died. ``cpu_time_s`` is the
    processor time of the whole run including world, checks and picture, ``memory_mb`` the largest
    resident memory [MB] of the process since its start. The other columns are explained at
    ``navfw.missions.run_metrics.RunResult``.
    """

    entry: str
    family: str = ""
    world: str
    mission: str
    seed: int
    difficulty: float | None = None
    stack: str
    variant: str = ""
    hazards: str = _of(lambda run: ", ".join(run.session.world.hazards), "")
    outcome: str
    reason: str = _of(lambda run: run.reason, "")
    cause: str = _of(lambda run: str(run.cause), "")
    notes: str = _of(lambda run: run.notes, "")
    behavior: str = _of(lambda run: run.behavior, "")
    sim_time_s: float | None = _of(lambda run: run.sim_time_s, None)
    wall_time_s: float | None = _of(lambda run: run.wall_time_s, None)
    real_time_factor: float | None = _of(lambda run: run.real_time_factor, None)
    path_length_m: float | None = _of(lambda run: run.path_length_m, None)
    shortest_path_m: float | None = _of(lambda run: run.shortest_path_m, None)
    shortest_with_room_m: float | None = _of(lambda run: run.shortest_with_room_m, None)
    spl: float | None = _of(lambda run: run.spl, None)
    sct: float | None = _of(_sct, None)
    min_clearance_m: float | None = _of(lambda run: run.min_clearance_m, None)
    clearance_p05_m: float | None = _of(lambda run: run.clearance_p05_m, None)
    collisions: int | None = _of(lambda run: run.collisions, None)
    collision_cause: str = _of(lambda run: run.collision_cause or "", "")
    distance_to_goal_m: float | None = _of(lambda run: run.distance_to_goal_m, None)
    estimate_error_m: float | None = _of(lambda run: run.estimate_error_m, None)
    localized_after_m: float | None = _of(lambda run: run.localized_after_m, None)
    lost_s: float | None = _of(lambda run: run.lost_s, None)
    confidently_wrong_s: float | None = _of(lambda run: run.confidently_wrong_s, None)
    emergencies: int | None = _of(lambda run: run.emergencies, None)
    route_changes: int | None = _of(lambda run: run.route_changes, None)
    why_slower: str = _of(lambda run: slowest_reasons(run.why_slower), "")
    plugin_faults: int | None = _of(lambda run: len(run.objections), None)
    barn_score: float | None = _of(_barn_score, None)
    observed_share: float | None = _of(lambda run: _explored(run, "observed_share"), None)
    path_over_tour: float | None = _of(lambda run: _explored(run, "path_over_tour"), None)
    unexplored: str = _of(_unexplored, "")
    command_hash: str = _of(lambda run: run.command_hash, "")
    picture: str = ""
    attempts: int | None = None
    cpu_time_s: float | None = None
    memory_mb: float | None = None

    @classmethod
    def of(cls, columns: dict[str, Any], result: MissionResult) -> RunRow:
        """Make the row of a run from its ``result`` and the columns that were known before it."""
        sources = {f.name: f.metadata["source"] for f in fields(cls) if f.metadata}
        measured = {name: source(result) for name, source in sources.items()}
        if measured["cause"]:
            said = result.reason, result.cause_seen, result.notes
            measured["reason"] = "; ".join(filter(None, said))
        return cls(**columns, outcome=result.outcome, **measured)

    @property
    def key(self) -> RunKey:
        """The columns that identify the run."""
        return RunKey(self.entry, self.world, self.mission, self.seed, self.stack, self.variant)

    @property
    def configuration(self) -> str:
        """The variant that was driven, or the stack in a suite without variants."""
        return self.variant or self.stack

    @property
    def succeeded(self) -> bool:
        """Whether the mission was accomplished."""
        return self.outcome == Outcome.REACHED

    @property
    def failure(self) -> str:
        """Outcome and cause as one text, by which failures are counted and grouped."""
        return f"{self.outcome}: {self.cause}"

    @property
    def died(self) -> bool:
        """Whether the process of the run died, or was ended at its limit of time or memory."""
        return self.outcome == Outcome.FAULT and self.cause in _DEATHS

    @property
    def repeatable(self) -> bool:
        """Whether to drive the run again: its process died once, and not at its time limit."""
        return self.died and self.cause != Cause.TOO_LONG and self.attempts in {None, 1}

    @property
    def has_result(self) -> bool:
        """Whether the run was not cancelled and did not die; ``--resume`` drives others again."""
        return self.outcome != Outcome.CANCELLED and not self.died


COLUMNS = tuple(one.name for one in fields(RunRow))
_REQUIRED = {"entry", "world", "mission", "seed", "stack", "outcome"}
"""Columns that no row is without."""
OPTIONAL = ("variant", "hazards", "observed_share", "path_over_tour", "unexplored")
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
    """Return the columns of a table of ``rows``, without empty ones among ``OPTIONAL``."""
    rows = list(rows)
    unused = {name for name in OPTIONAL if not any(getattr(row, name) for row in rows)}
    return tuple(name for name in COLUMNS if name not in unused)


def table_cells(rows: Iterable[RunRow]) -> list[list[str]]:
    """Return the table's cells as text, header first; floats keep every digit, None is empty."""
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
    """The SQLite journal of a suite's runs in ``file``; each method opens and closes the database.

    Raises (all methods):
        ConfigError: the file is not a journal, is damaged, or cannot be read or written.

    """

    file: Path

    def create(self) -> None:
        """Create the file atomically with an empty table; if there is one already, check it."""
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
        """Write rows of runs of the fingerprint ``content``; they replace rows of the same runs."""
        with self._opened() as database, database:
            for row in rows:
                cells = json.dumps({name: _cell(getattr(row, name)) for name in COLUMNS})
                values = (content, json.dumps(row.key), cells)
                database.execute("INSERT OR REPLACE INTO run VALUES (?, ?, ?)", values)

    def rows(self, contents: Iterable[str]) -> list[RunRow]:
        """Read the rows of the fingerprints ``contents``, in their order, then as written."""
        by_content: dict[str, list[RunRow]] = {content: [] for content in contents}
        with self._opened() as database:
            for content, cells in database.execute("SELECT content, cells FROM run ORDER BY rowid"):
                if content in by_content:
                    by_content[content].append(self._row(cells))
        return list(itertools.chain.from_iterable(by_content.values()))

    def _row(self, cells: str) -> RunRow:
        """Return the row with these cells by column; an empty or missing one has its default."""
        try:
            texts = json.loads(cells).items()
            row = _ADAPTER.validate_python({n: text for n, text in texts if text or n in _REQUIRED})
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
