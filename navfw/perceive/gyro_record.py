"""Recorded gyro rates, and the camera's rotation between two images by integration."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.config.input_file import read_input_text
from navfw.errors import InputError, did_you_mean
from navfw.signals import Array

__all__ = ["COLUMNS", "RATES", "GyroRecord", "load_gyro_record", "rotation_from_vector"]

COLUMNS = ("time", "yaw_rate", "pitch_rate", "roll_rate")
"""Columns of a record: time [s] and rates [rad/s], positive for a turn to the left (yaw), nose down
(pitch) and right side down (roll)."""
RATES = COLUMNS[1:]
_ALIASES = {"t": "time", "yaw": "yaw_rate", "pitch": "pitch_rate", "roll": "roll_rate"}
_FASTEST = 50.0  # rad/s: above the range of gyros; larger values are probably degrees per second
_MAX_BYTES = 50_000_000
"""Largest size of a record [byte]: 15 minutes of readings at 1 kHz."""


@dataclass(frozen=True, slots=True)
class GyroRecord:
    """Samples in ascending order: ``times`` (n,) [s], ``rates`` (n, 3) [rad/s] roll, pitch, yaw.

    ``measured`` names the rates in the record; the others are 0. ``longest_gap`` [s] is the largest
    interval between neighbouring samples of a continuous record. Samples without a number are left
    out; ``note`` gives their number, None if there are none.
    """

    times: Array
    rates: Array
    longest_gap: float
    measured: frozenset[str] = frozenset(RATES)
    note: str | None = None

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


def rotation_from_vector(vector: Array) -> Array:
    """Rotation matrix (3, 3) about ``vector`` by its length [rad] (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross: Array = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-9:
        return np.eye(3) + cross
    a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + a * cross + b * (cross @ cross))


def load_gyro_record(path: Path) -> GyroRecord:
    """Read a CSV file of ``COLUMNS`` (the last two may be missing), with or without a header.

    Rows with a missing or NaN value are left out and make a gap.

    Raises:
        InputError: the file is not readable, has an unknown column, a value that is not a number,
            times that do not increase, rates that can only be degrees per second, or fewer than two
            samples; with file and line.

    """
    names: list[str] | None = None
    times: list[float] = []
    rates: list[tuple[float, float, float]] = []
    left_out = 0
    previous = -math.inf
    for line, row in _rows(path):
        if names is None:
            names, is_header = _columns(path, line, row)
            if is_header:
                continue
        time, *rate = _numbers(path, line, row, names)
        if not math.isfinite(time) or not all(map(math.isfinite, rate)):
            left_out += 1
            continue
        if time <= previous:
            raise InputError(
                f"time {time:g} s does not come after {previous:g} s", file=path, line=line
            )
        if max(map(abs, rate)) > _FASTEST:
            raise InputError(
                f"a rate of {max(map(abs, rate)):g} rad/s is above {_FASTEST:g}; are these "
                "degrees per second?",
                file=path,
                line=line,
            )
        previous = time
        times.append(time)
        rates.append((rate[0], rate[1], rate[2]))
    if len(times) < 2:
        raise InputError(
            f"has {len(times) or 'no'} usable gyro sample; at least two are needed", file=path
        )
    note = (
        f"{left_out} of {left_out + len(times)} gyro samples are not numbers" if left_out else None
    )
    steps = np.diff(times)
    measured = frozenset(names or ()) & frozenset(RATES)
    longest_gap = 2.5 * float(np.median(steps))
    return GyroRecord(np.array(times), np.array(rates), longest_gap, measured, note)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line that is neither empty nor a comment."""
    reader = csv.reader(io.StringIO(read_input_text(path, _MAX_BYTES), newline=""))
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not cells[0].startswith("#"):
                yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"is not a CSV file: {error}", file=path, line=reader.line_num) from None


def _columns(path: Path, line: int, row: list[str]) -> tuple[list[str], bool]:
    """Names of the columns, and whether ``row`` is the header."""
    try:
        float(row[0])
    except ValueError:
        pass
    else:
        if not 2 <= len(row) <= len(COLUMNS):
            raise InputError(
                f"has {len(row)} columns; expected {', '.join(COLUMNS[:2])} [, "
                f"{', '.join(COLUMNS[2:])}]",
                file=path,
                line=line,
            )
        return list(COLUMNS[: len(row)]), False
    names = []
    for cell in row:
        name = cell.lower().split("[")[0].split("(")[0].strip().replace(" ", "_")
        name = _ALIASES.get(name, name)
        if name not in COLUMNS:
            raise InputError(
                f"unknown column {cell!r}: {did_you_mean(name, COLUMNS)}", file=path, line=line
            )
        names.append(name)
    for needed in COLUMNS[:2]:
        if needed not in names:
            raise InputError(f"has no column {needed!r}", file=path, line=line)
    return names, True


def _numbers(
    path: Path, line: int, row: list[str], names: list[str]
) -> tuple[float, float, float, float]:
    """Time, roll, pitch and yaw rate of a row; an empty cell is NaN."""
    if len(row) != len(names):
        raise InputError(f"has {len(row)} values, not {len(names)}", file=path, line=line)
    values = dict.fromkeys(COLUMNS, 0.0)
    for name, cell in zip(names, row, strict=True):
        try:
            values[name] = float(cell) if cell else math.nan
        except ValueError:
            raise InputError(f"{cell!r} is not a number", file=path, line=line, key=name) from None
    return values["time"], values["roll_rate"], values["pitch_rate"], values["yaw_rate"]
