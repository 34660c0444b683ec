"""The table of a suite: one row per run, as CSV, written atomically."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import re
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import ConfigError
from navfw.missions.outcome import Outcome
from navfw.process.atomic import write_text
from navfw.suite.failure_causes import Cause

_MAX_TABLE = 100_000_000
"""Largest size of a table [byte]; a larger file is refused before it is read."""


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
    ``variant`` is empty in suites without variants; their tables have no such column.
    ``plugin_faults`` is the number of kinds of plugin faults beside the injected ones. ``attempts``
    is the number of processes that the run took: 2 if the first one died. ``cpu_time_s`` is the
    processor time of the whole run, with its world, checks and picture, ``memory_mb`` the largest
    resident memory [MB] of the process since its start. Tables of older versions lack the last
    four.
    """

    entry: str
    family: str = ""
    world: str
    mission: str
    seed: int
    difficulty: float | None = None
    stack: str
    variant: str = ""
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
    emergencies: int | None = None
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
    def setting(self) -> tuple[str, ...]:
        """What the run was made in: its key without the seed, nor the world that a seed makes."""
        world = "" if self.family else self.world
        return (self.entry, self.family, world, self.mission, self.stack, self.variant)

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
_TYPES = typing.get_type_hints(RunRow)

_OPTIONAL = {"variant", "plugin_faults", "attempts", "cpu_time_s", "memory_mb"}
"""Columns that a table may lack."""


def columns_of(rows: Iterable[RunRow]) -> tuple[str, ...]:
    """The columns of a table of ``rows``; ``variant`` is left out if no row has one."""
    if any(row.variant for row in rows):
        return COLUMNS
    return tuple(name for name in COLUMNS if name != "variant")


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


def read_table(path: str | Path) -> list[RunRow]:
    """The rows of the table at ``path``.

    Raises:
        ConfigError: there is no such file, or it is not a suite's table; with file and line.

    """
    path = Path(path)
    name = shown_path(path)
    reader = csv.DictReader(io.StringIO(read_input_text(path, _MAX_TABLE), newline=""))
    try:
        columns = {*_OPTIONAL, *(reader.fieldnames or ())}
        missing = [column for column in COLUMNS if column not in columns]
        if missing:
            what = f"is not a table of navfw suite: it has no column {missing[0]!r}"
            raise ConfigError(what, file=name, line=1)
        rows = [row_of_cells(cells, name, reader.line_num) for cells in reader]
    except csv.Error as error:
        raise ConfigError(
            f"cannot be read as CSV: {error}", file=name, line=reader.line_num
        ) from None
    seen: set[RunKey] = set()
    for row in rows:
        if row.key in seen:
            raise ConfigError(f"contains the run {tuple(row.key)} twice", file=name)
        seen.add(row.key)
    return rows


def cells_of_row(row: RunRow) -> dict[str, str]:
    """The cells of a row by column, as in the table."""
    return {name: _cell(getattr(row, name)) for name in COLUMNS}


def row_of_cells(cells: Mapping[str, Any], file: str, line: int | None = None) -> RunRow:
    """The row with these cells by column; ``file`` and ``line`` are named in errors.

    Raises:
        ConfigError: a cell is missing, is no number where one is expected, or no outcome.

    """
    values: dict[str, Any] = {}
    for column in COLUMNS:
        text = cells.get(column, "" if column in _OPTIONAL else None)
        if text is None:
            raise ConfigError("the line has too few cells", file=file, line=line)
        try:
            values[column] = _value(text, _TYPES[column])
        except ValueError:
            what = f"expected a number, got {text!r:.40}"
            raise ConfigError(what, file=file, line=line, key=column) from None
    if values["outcome"] not in set(Outcome):
        what = f"expected one of {', '.join(Outcome)}, got {values['outcome']!r:.40}"
        raise ConfigError(what, file=file, line=line, key="outcome")
    return RunRow(**values)


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return " ".join(value.split()) if isinstance(value, str) else str(value)


def _value(text: str, kind: Any) -> object:
    if kind is str:
        return text
    if not text and type(None) in typing.get_args(kind):
        return None
    return int(text) if int in (kind, *typing.get_args(kind)) else float(text)
