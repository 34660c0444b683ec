"""Recorded gyro rates, and the camera's rotation between two images by integration."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import InputError
from navfw.perceive.gyro_columns import COLUMNS, RATES, GyroColumn, column_of
from navfw.signals import Array

_MAX_RATE = 10.0
"""Largest rate [rad/s]: a camera that turns faster sees nothing but blur, so larger values have
another unit."""
_MAX_INTERVAL = 2.0
"""Longest usual interval of samples [s]: longer ones are probably not in seconds."""
_MAX_BYTES = 50_000_000
"""Largest size of a record [byte]: 15 minutes of readings at 1 kHz."""
_MIN_DURATION = 10.0  # s
_MAX_TILT = 0.5 * math.pi
"""Net pitch and roll [rad] of a record of at least ``_MIN_DURATION`` that no camera has: beyond,
its mean rate is the gyro's offset."""
_OPTION = "--gyro"


@dataclass(frozen=True, slots=True)
class GyroRecord:
    """Samples in ascending order: ``times`` (n,) [s], ``rates`` (n, 3) [rad/s] roll, pitch, yaw.

    ``measured`` names the rates in the record; the others are 0. ``longest_gap`` [s] is the largest
    interval between neighbouring samples of a continuous record. ``notes`` are remarks for the
    user: samples without a number, which are left out, offsets and unused columns. ``file`` and
    ``option`` name the record in messages.
    """

    times: Array
    rates: Array
    longest_gap: float
    measured: frozenset[str] = frozenset(RATES)
    notes: tuple[str, ...] = ()
    file: str = ""
    option: str = _OPTION
    source: str = "gyro"

    def rotation_between(self, begin: float, end: float) -> Array | None:
        """Rotation vector (3,) [rad] about base_link's x, y, z from ``begin`` to ``end`` [s].

        None if the record does not cover that time or has a gap in it.
        """
        inside = (self.times > begin) & (self.times < end)
        first = int(np.searchsorted(self.times, begin, side="right")) - 1
        last = int(np.searchsorted(self.times, end, side="left"))
        # the ends of the record may be off by one interval
        if first < 0 and self.times[0] - begin <= self.longest_gap:
            first = 0
        if last >= self.times.size and end - self.times[-1] <= self.longest_gap:
            last = self.times.size - 1
        if first < 0 or last >= self.times.size or last < first:
            return None
        steps = np.diff(self.times[first : last + 1])
        if steps.size and steps.max() > self.longest_gap:
            return None
        knots = np.concatenate([[begin], self.times[inside], [end]])
        rates = np.stack(
            [np.interp(knots, self.times, self.rates[:, axis]) for axis in range(3)], axis=1
        )
        middle = 0.5 * (rates[1:] + rates[:-1])
        return np.asarray((middle * np.diff(knots)[:, None]).sum(axis=0))

    def translation_between(self, _begin: float, _end: float) -> Array | None:
        """None: a gyro does not measure translation."""
        return None

    def shifted(self, seconds: float) -> Self:
        """The same record with times later by ``seconds``."""
        return replace(self, times=self.times + seconds)


def load_gyro_record(path: Path) -> GyroRecord:
    """Read a CSV file with the columns time, yaw_rate and, if known, pitch_rate and roll_rate.

    Without a header these are the columns, in s and rad/s. A header may name them in other words
    and units (``navfw.perceive.gyro_columns``), in any order, among columns of other quantities.
    Rows with a missing or NaN value are left out and make a gap.

    Raises:
        InputError: the file is not readable, lacks a column, has a misspelt one or an unknown unit,
            a value that is not a number, times that do not increase, values that can only be in
            another unit, or fewer than two samples; with file and line.

    """
    columns: list[GyroColumn | None] = []
    samples: list[tuple[float, float, float, float]] = []
    notes: list[str] = []
    left_out = 0
    for line, row in _rows(path):
        if not columns:
            columns, is_header = _columns(path, line, row)
            if is_header:
                unused = [cell for cell, column in zip(row, columns, strict=True) if column is None]
                notes += [f"gyro columns not used: {', '.join(unused)}"] if unused else []
                if any(column is not None and column.by_axis for column in columns):
                    notes.append("the gyro's axes x, y, z are taken as ahead, left, up")
                continue
        sample = _numbers(path, line, row, columns)
        if not all(map(math.isfinite, sample)):
            left_out += 1
            continue
        _check(path, line, sample, samples[-1][0] if samples else -math.inf)
        samples.append(sample)
    if len(samples) < 2:
        raise InputError(
            f"has {len(samples) or 'no'} usable gyro sample; at least two are needed",
            file=shown_path(path),
        )
    if left_out:
        total = left_out + len(samples)
        notes.append(f"{left_out} of {total} gyro samples are not numbers")
    table = np.array(samples)
    interval = float(np.median(np.diff(table[:, 0])))
    if interval > _MAX_INTERVAL:
        raise InputError(
            f"samples are {interval:g} s apart; if the times have another unit, name it in the "
            "header: time_ms, time_us or time_ns",
            file=shown_path(path),
        )
    rates, offsets = _without_offsets(table[:, 0], table[:, 1:])
    measured = frozenset(column.name for column in columns if column is not None) & frozenset(RATES)
    return GyroRecord(
        times=table[:, 0],
        rates=rates,
        longest_gap=2.5 * interval,
        measured=measured,
        notes=(*notes, *offsets),
        file=shown_path(path),
    )


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line that is neither empty nor a comment."""
    text = read_input_text(path, _MAX_BYTES)
    # programs of countries with decimal commas separate by semicolons, others by tabs
    separator = max(",;\t", key=text.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not cells[0].startswith("#"):
                yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"is not a CSV file: {error}", file=path, line=reader.line_num) from None


def _columns(path: Path, line: int, row: list[str]) -> tuple[list[GyroColumn | None], bool]:
    """The columns, and whether ``row`` is the header."""
    file = shown_path(path)
    try:
        float(row[0])
    except ValueError:
        pass
    else:
        if not 2 <= len(row) <= len(COLUMNS):
            raise InputError(
                f"has {len(row)} columns and no header; expected {', '.join(COLUMNS[:2])} [, "
                f"{', '.join(COLUMNS[2:])}]",
                file=file,
                line=line,
            )
        return [GyroColumn(name, 1.0) for name in COLUMNS[: len(row)]], False
    try:
        columns = [column_of(cell) for cell in row]
    except ValueError as error:
        raise InputError(str(error), file=file, line=line) from None
    names = [column.name for column in columns if column is not None]
    for needed in COLUMNS[:2]:
        if needed not in names:
            raise InputError(
                f"has no column {needed!r}; name the one that holds it so", file=file, line=line
            )
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"has several columns of {name!r}; keep one", file=file, line=line)
    return columns, True


def _numbers(
    path: Path, line: int, row: list[str], columns: Sequence[GyroColumn | None]
) -> tuple[float, float, float, float]:
    """Time [s], roll, pitch and yaw rate [rad/s] of a row; an empty cell is NaN."""
    if len(row) != len(columns):
        raise InputError(
            f"has {len(row)} values, not {len(columns)}", file=shown_path(path), line=line
        )
    values = dict.fromkeys(COLUMNS, 0.0)
    for column, cell in zip(columns, row, strict=True):
        if column is None:
            continue
        try:
            values[column.name] = column.unit * float(cell) if cell else math.nan
        except ValueError:
            raise InputError(
                f"{cell!r} is not a number", file=shown_path(path), line=line, key=column.name
            ) from None
    return values["time"], values["roll_rate"], values["pitch_rate"], values["yaw_rate"]


def _check(
    path: Path, line: int, sample: tuple[float, float, float, float], previous: float
) -> None:
    """Refuse a sample that is not later than the ``previous`` one [s], or turns too fast."""
    time, fastest = sample[0], max(map(abs, sample[1:]))
    if time <= previous:
        raise InputError(
            f"time {time:g} s does not come after {previous:g} s; sort the rows by time",
            file=shown_path(path),
            line=line,
        )
    if fastest > _MAX_RATE:
        raise InputError(
            f"a rate of {fastest:g} rad/s is above {_MAX_RATE:g}; are these degrees per second? "
            "Name the unit in the header: yaw_rate_deg_s, or yaw_rate [mdeg/s]",
            file=shown_path(path),
            line=line,
        )


def _without_offsets(times: Array, rates: Array) -> tuple[Array, list[str]]:
    """``rates`` without the offsets of roll and pitch that can be told, and notes on them."""
    duration = float(times[-1] - times[0])
    notes = []
    rates = rates.copy()
    for axis, name in ((0, "roll"), (1, "pitch")):
        offset = float(rates[:, axis].mean())
        if duration >= _MIN_DURATION and abs(offset) * duration > _MAX_TILT:
            rates[:, axis] -= offset
            notes.append(f"the gyro's {name} rate has an offset of {offset:.4f} rad/s: removed")
    return rates, notes
