"""Read tables with a column of times: gyro rates, poses and lists of images.

Values are separated by commas, semicolons, tabs or blanks. A first line that does not begin with a
number is a header: it names the columns, in any order and among others, with units of time and of
rates, such as ``time_ms`` or ``yaw_rate [deg/s]``.
"""

from __future__ import annotations

import contextlib
import csv
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np

from navfw.assumption import Assumption
from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import InputError
from navfw.numerics import Array

TIME = "time"
TIME_NAMES = {TIME: TIME, "t": TIME, "timestamp": TIME, "stamp": TIME}
"""Names that a header may use for the column of times, and its name here."""
_TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
"""Units of time [s]."""
_DEGREE = math.pi / 180.0
_RATE_UNITS = {
    **{"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": _DEGREE, "mdeg/s": 1e-3 * _DEGREE},
    **{"°/s": _DEGREE, "dps": _DEGREE, "mdps": 1e-3 * _DEGREE},
}
"""Units of rates [rad/s]."""
LENGTH_UNITS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""Units of lengths [m]; quaternions have none."""
_EPOCH = (1e9, 1e10)
"""Times [s] since 1970 of the years 2001 to 2286: numbers in other units are far from them."""
_MAX_NUMBER = 1e19
"""Largest number of a cell: nanoseconds since 1970 have 2e18."""
_MAX_INTERVAL = 2.0
"""Longest usual interval of samples [s]: longer ones are probably not in seconds."""

_TimedColumn: TypeAlias = tuple[str, float]
"""A column's name, and the factor that converts its numbers to SI units."""


@dataclass(frozen=True, slots=True)
class TableFormat:
    """The columns of a kind of table.

    ``columns`` are their names in the order that they have without a header, the first ``needed``
    of them required; ``names`` maps each name that a header may use to one of them. The column
    ``text`` holds no numbers; a table that may have one may have others after it. ``units`` are
    those of columns besides the time, with their factors to SI units.
    """

    columns: tuple[str, ...]
    needed: int
    names: Mapping[str, str]
    text: str = ""
    units: Mapping[str, float] = field(default_factory=lambda: _RATE_UNITS)


def epoch_unit(time: float) -> float | None:
    """Return the unit [s] of a time since 1970, by its magnitude; None if it fits no unit."""
    units = (1.0, 1e-3, 1e-6, 1e-9)
    return next((unit for unit in units if _EPOCH[0] <= time * unit < _EPOCH[1]), None)


class TimedTable:
    """Reads the table in the file at ``path``, which messages name as ``file``.

    ``lines`` has the number of each row's line; ``numbers`` the values (n,) of each column, times
    [s] and rates [rad/s], nan if a cell is empty; ``texts`` the cells of the column without
    numbers; ``names`` the names in the header, without their units, and ``unused`` those that name
    other quantities. The times of rows without a missing number increase; if no header names their
    unit, it follows from their magnitude, and is ``assumed``.

    Raises:
        InputError: the file cannot be read, lacks a column or has it twice, or has an unknown unit;
            a row has another number of values, a value is not a number, or a time does not come
            after the one before; with file and line.

    """

    def __init__(self, path: Path, kind: TableFormat) -> None:
        self.file = shown_path(path)
        self.lines: list[int] = []
        self.numbers: dict[str, Array] = {}
        self.texts: list[str] = []
        self.names: set[str] = set()
        self.unused: list[str] = []
        self.assumed: list[Assumption] = []
        self.unit_named = False
        self._kind = kind
        rows = list(self._split(read_input_text(path)))
        comments = list(itertools.takewhile(_is_comment, rows))
        rows = [row for row in rows if not _is_comment(row)]
        rows = [*[row for row in comments if self._is_header(row[1], rows)][-1:], *rows]
        if not rows:
            return
        line, cells = rows[0]
        header = [cells[0].lstrip("#"), *cells[1:]]
        if _is_number(cells[0]):
            header = self._by_position(line, len(cells))
        else:
            del rows[0]
        columns = self._by_header(line, header)
        for line, cells in rows:
            self.lines.append(line)
            if len(cells) != len(columns):
                names = ", ".join(column[0] for column in columns if column is not None)
                raise self.error(f"has {len(cells)} values, not {len(columns)} ({names})", line)
        for k, column in enumerate(columns):
            if column is not None and column[0] == kind.text:
                self.texts = self.texts or [cells[k] for _, cells in rows]
            elif column is not None:
                numbers = [self._number(line, column[0], cells[k]) for line, cells in rows]
                self.numbers[column[0]] = column[1] * np.array(numbers)
        self._find_unit()
        self._check_order()

    def array(self, *names: str) -> Array:
        """Return the columns of these ``names`` (n, k); columns that the table lacks are 0."""
        zero = np.zeros(len(self.lines))
        return np.stack([self.numbers.get(name, zero) for name in names], axis=1)

    def interval(self, times: Array, name: str) -> float:
        """Return the usual interval [s] of ``times`` (n,) of samples that messages call ``name``.

        Raises:
            InputError: there are fewer than two, or the interval is too long to be in seconds.

        """
        if len(times) < 2:
            columns = ", ".join(self._kind.columns[: self._kind.needed])
            raise self.error(
                f"has {len(times) or 'no'} usable {name}; at least two rows of {columns} are needed"
            )
        interval = float(np.median(np.diff(times)))
        if interval > _MAX_INTERVAL:
            raise self.error(
                f"{name}s are {interval:g} s apart; expected times in seconds: if they have "
                "another unit, name it in the header: time_ms, time_us or time_ns"
            )
        return interval

    def _is_header(self, cells: Sequence[str], below: Sequence[tuple[int, list[str]]]) -> bool:
        """Return whether a comment names the columns of the table ``below`` it, as EuRoC's do."""
        written = [_name_and_unit(cell.lstrip("#"))[0] for cell in cells]
        named = {self._kind.names.get(name) for name in written}
        same = below and len(below[0][1]) == len(cells) and _is_number(below[0][1][0])
        return bool(same) and named.issuperset(self._kind.columns[: self._kind.needed])

    def _find_unit(self) -> None:
        """Convert times since 1970 whose magnitude says that they are not in seconds."""
        times = self.numbers.get(TIME, np.empty(0))
        times = times[np.isfinite(times)]
        unit = None if self.unit_named or not times.size else epoch_unit(float(np.median(times)))
        if unit is None or unit == 1.0:
            return
        self.numbers[TIME] *= unit
        name = next(name for name, value in _TIME_UNITS.items() if value == unit)
        reason = f"{self.file} does not name it, and its times are then since 1970"
        self.assumed.append(Assumption("unit of times", name, reason, "a header such as time_ns"))

    def _check_order(self) -> None:
        usable = np.flatnonzero(np.isfinite(self.array(*self.numbers)).all(axis=1))
        times = self.numbers[TIME][usable]
        for k in np.flatnonzero(np.diff(times) <= 0.0).tolist():
            what = f"time {times[k + 1]:.6f} s does not come after {times[k]:.6f} s"
            raise self.error(f"{what}; sort the rows by time", self.lines[usable[k + 1]])

    def error(self, message: str, line: int | None = None, key: str | None = None) -> InputError:
        """Return the error, for the caller to raise, about the table or its ``line``."""
        return InputError(message, file=self.file, line=line, key=key)

    def _split(self, text: str) -> Iterator[tuple[int, list[str]]]:
        """Yield line number and cells of each line that is not empty."""
        lines = [re.sub(r"^\s*#+\s*", "#", line) for line in text.splitlines()]
        rows = (line for line in lines if line.strip() and not line.lstrip().startswith("#"))
        first = next(rows, "")
        separator = max(",;\t", key=first.count)
        if separator not in first:
            separator = " "
            lines = [" ".join(line.split()) for line in lines]
        reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
        try:
            for row in reader:
                cells = [cell.strip() for cell in row]
                if separator == ";":  # programs of countries with decimal commas
                    cells = [re.sub(r"^([-+0-9]+),([0-9eE+-]+)$", r"\1.\2", cell) for cell in cells]
                if any(cells):
                    yield reader.line_num, cells
        except csv.Error as error:
            raise self.error(f"is not a CSV file: {error}", reader.line_num) from None

    def _by_position(self, line: int, count: int) -> list[str]:
        """Return the names of ``count`` columns without a header, "" for others."""
        columns, needed = self._kind.columns, self._kind.needed
        if count < needed or (count > len(columns) and not self._kind.text):
            optional = f" [, {', '.join(columns[needed:])}]" if columns[needed:] else ""
            what = f"expected {', '.join(columns[:needed])}{optional}"
            raise self.error(f"has {count} columns and no header; {what}", line)
        return [*columns, *[""] * count][:count]

    def _by_header(self, line: int, header: Sequence[str]) -> list[_TimedColumn | None]:
        columns = [self._named(line, word) for word in header]
        self.unused = [word for word, one in zip(header, columns, strict=True) if one is None]
        names = [column[0] for column in columns if column is not None]
        for name in self._kind.columns[: self._kind.needed]:
            if name not in names:
                hint = "; name the one that holds it so"
                raise self.error(f"has no column {name!r} in {', '.join(header)}{hint}", line)
        for name in names:
            if names.count(name) > 1 and name != self._kind.text:
                raise self.error(f"has several columns of {name!r}; keep one", line)
        return columns

    def _named(self, line: int, word: str) -> _TimedColumn | None:
        """Return the column with the name ``word`` in the header; None for another quantity."""
        written, unit = _name_and_unit(word)
        self.names.add(written)
        name = self._kind.names.get(written)
        if name is None:
            return None
        units = _TIME_UNITS if name == TIME else self._kind.units
        self.unit_named |= name == TIME and bool(unit)
        if unit and unit not in units:
            raise self.error(f"unknown unit in {word!r}; known: {', '.join(units)}", line)
        return name, units.get(unit, 1.0)

    def _number(self, line: int, name: str, cell: str) -> float:
        try:
            number = float(cell) if cell else math.nan
        except ValueError:
            what = "a time in seconds" if name == TIME else "a number"
            raise self.error(f"{cell!r:.40} is not {what}", line, name) from None
        if abs(number) > _MAX_NUMBER:  # false for nan, a missing number
            what = f"expected finite numbers, up to {_MAX_NUMBER:g}, got {cell!r:.40}"
            raise self.error(what, line, name)
        return number


def _name_and_unit(word: str) -> tuple[str, str]:
    """Split a header's ``word`` into name and unit: ``Yaw rate (deg/s)``, ``time_ms``, ``yaw``."""
    text = word.strip().lower().removeprefix("%").removeprefix("field.")  # of rostopic echo -p
    if bracketed := re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", text):
        text = bracketed[1]
    name = re.sub(r"[ .\-]+", "_", text)
    if bracketed:
        return name, bracketed[2].replace(" s^-1", "/s")
    for unit in (*_RATE_UNITS, *_TIME_UNITS):
        stem = name.removesuffix("_" + unit.replace("/", "_"))
        if stem not in {name, ""}:
            return stem, unit
    return name, ""


def _is_comment(row: tuple[int, list[str]]) -> bool:
    return row[1][0].startswith("#")


def _is_number(cell: str) -> bool:
    with contextlib.suppress(ValueError):
        float(cell)
        return True
    return False
