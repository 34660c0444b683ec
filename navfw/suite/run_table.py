"""The rows of a suite, one per run, and their table: CSV for other programs, never read back."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from navfw.missions.outcome import Outcome
from navfw.process.atomic import write_text
from navfw.suite.failure_causes import Cause

if TYPE_CHECKING:
    from pydantic import TypeAdapter

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
    resident memory [MB] of the process since its start.
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


def cells_of_row(row: RunRow) -> dict[str, str]:
    """The cells of a row by column, as in the table."""
    return {name: _cell(getattr(row, name)) for name in COLUMNS}


def row_of_cells(cells: Mapping[str, str]) -> RunRow:
    """The row with these cells by column; an empty or missing one has its default.

    Raises:
        ValueError: a required cell is missing, one is no number where a number is expected, or the
            outcome is unknown.

    """
    filled = {name: text for name, text in cells.items() if text or name in _REQUIRED}
    row: RunRow = _adapter().validate_python(filled)
    Outcome(row.outcome)
    return row


@functools.cache
def _adapter() -> TypeAdapter[RunRow]:
    from pydantic import TypeAdapter

    return TypeAdapter(RunRow)


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return " ".join(value.split()) if isinstance(value, str) else str(value)
