"""Lists of the times at which images were taken."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import InputError
from navfw.perceive.gyro_columns import GyroColumn, column_of

_MAX_BYTES = 50_000_000
"""Largest size of a list [byte]."""
_FILE_COLUMNS = ("file", "filename", "file_name", "image", "name")
_OPTION = "--times"


@dataclass(frozen=True, slots=True)
class ImageTimes:
    """``times`` [s] of images, ascending; ``by_name`` those of named images, empty without names.

    ``file`` is the list that they were read from.
    """

    file: str
    times: tuple[float, ...]
    by_name: Mapping[str, float]

    def of(self, paths: Sequence[Path]) -> list[float]:
        """The times [s] of images, in their order.

        Raises:
            InputError: an image is not in the list, there are more or fewer times than images, or
                the images are not in the order of time.

        """
        if not self.by_name:
            if len(self.times) != len(paths):
                raise self._error(
                    f"has {len(self.times)} times for {len(paths)} images; add a column 'file' if "
                    "some images are missing"
                )
            return list(self.times)
        missing = [path.name for path in paths if path.name not in self.by_name]
        if missing:
            raise self._error(
                f"has no time of {len(missing)} of {len(paths)} images, such as {missing[0]}"
            )
        times = [self.by_name[path.name] for path in paths]
        for k in range(1, len(times)):
            if times[k] <= times[k - 1]:
                raise self._error(
                    f"{paths[k].name} was not taken after {paths[k - 1].name}; give the images in "
                    "the order of time"
                )
        return times

    def _error(self, message: str) -> InputError:
        return InputError(message, file=self.file, key=_OPTION)


def load_image_times(path: Path) -> ImageTimes:
    """Read lines of a time [s] and, if known, the image's file, separated by a comma or blanks.

    A header may name the columns, ``time`` (with a unit such as ``time_ms``) and ``file``, among
    others. Of a file's path only the name counts.

    Raises:
        InputError: the file is not readable, has no column of times, or a time is no number or
            does not come after the one before; with file and line.

    """
    columns: tuple[int, float, int | None] | None = None
    times: list[float] = []
    by_name: dict[str, float] = {}
    for line, cells in _rows(path):
        if columns is None:
            columns, is_header = _columns(path, line, cells)
            if is_header:
                continue
        at, unit, name = columns
        if max(at, name or 0) >= len(cells):
            raise InputError(
                f"has {len(cells)} values; expected more", file=shown_path(path), line=line
            )
        times.append(_time(path, line, cells[at], unit, times[-1] if times else -math.inf))
        if name is not None:
            by_name[cells[name].replace("\\", "/").rsplit("/", 1)[-1]] = times[-1]
    if not times:
        raise InputError("has no times of images", file=shown_path(path))
    return ImageTimes(shown_path(path), tuple(times), by_name)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is neither empty nor a comment."""
    for number, line in enumerate(read_input_text(path, _MAX_BYTES).splitlines(), start=1):
        cells = [cell.strip() for cell in line.split(",")] if "," in line else line.split()
        if any(cells) and not cells[0].startswith("#"):
            yield number, cells


def _columns(path: Path, line: int, cells: list[str]) -> tuple[tuple[int, float, int | None], bool]:
    """Index and unit [s] of the times, index of the files, and whether ``cells`` are the header."""
    try:
        float(cells[0])
    except ValueError:
        pass
    else:
        return (0, 1.0, 1 if len(cells) > 1 else None), False
    files = [k for k, cell in enumerate(cells) if cell.lower() in _FILE_COLUMNS]
    times = [(k, column) for k, cell in enumerate(cells) if (column := _time_column(cell))]
    if len(times) != 1:
        raise InputError(
            f"expected a header with one column 'time', got {len(times)}",
            file=shown_path(path),
            line=line,
        )
    at, column = times[0]
    return (at, column.unit, files[0] if files else None), True


def _time_column(header: str) -> GyroColumn | None:
    try:
        column = column_of(header)
    except ValueError:  # of another quantity
        return None
    return column if column is not None and column.name == "time" else None


def _time(path: Path, line: int, cell: str, unit: float, previous: float) -> float:
    """The time [s] in a ``cell``, which comes after the ``previous`` one."""
    try:
        time = float(cell) * unit
    except ValueError:
        time = math.nan
    if not math.isfinite(time):
        raise InputError(f"{cell!r:.40} is not a time in seconds", file=shown_path(path), line=line)
    if time <= previous:
        raise InputError(
            f"time {time:.6f} s does not come after {previous:.6f} s; sort the lines by time",
            file=shown_path(path),
            line=line,
        )
    return time
