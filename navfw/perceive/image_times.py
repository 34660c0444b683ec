"""Find order and times of image files: by a list, or by their names."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.assumption import Assumption
from navfw.config.input_file import shown_path
from navfw.errors import InputError, locating
from navfw.numerics import Array
from navfw.perceive.timed_table import TIME, TIME_NAMES, TableFormat, TimedTable, epoch_unit

_FILE = "file"
_LIST = TableFormat(
    columns=(TIME, _FILE),
    needed=1,
    names=TIME_NAMES
    | dict.fromkeys(("file", "filename", "file_name"), _FILE)
    | dict.fromkeys(("image", "image_name", "name"), _FILE),
    text=_FILE,
)
_STAMP = re.compile(
    r"(?<![0-9.])(?:(?P<sec>[1-9][0-9]{9})[_-](?P<nsec>[0-9]{9})|(?P<decimal>[0-9]{1,12}\.[0-9]+)"
    r"|(?P<whole>[1-9][0-9]{9,18}))(?![0-9])"
)
"""Matches a time in a name: seconds and nanoseconds, decimal seconds, or 10 to 19 digits."""
_UPTIME = 1e8
"""Longest time since power-on [s]: three years."""
_INTERVALS = (0.002, 2.0)
"""Usual intervals of images [s], from which the unit of times since power-on follows."""


@dataclass(frozen=True, slots=True)
class ImageTimes:
    """Ascending ``times`` [s] of images; ``by_name`` those by file name, {} without names.

    ``file`` is the list that they were read from; ``assumed`` what was chosen as it does not say
    it.
    """

    file: str
    times: tuple[float, ...]
    by_name: Mapping[str, float]
    assumed: tuple[Assumption, ...] = ()

    def of(self, paths: Sequence[Path]) -> list[float]:
        """Return the times [s] of the images in ``paths``, in their order.

        Raises:
            InputError: an image is not in the list, there are more or fewer times than images, or
                the images are not in the order of time.

        """
        with locating(file=self.file, key="--times"):
            if not self.by_name:
                if len(self.times) == len(paths):
                    return list(self.times)
                what = f"has {len(self.times)} times for {len(paths)} images"
                raise InputError(f"{what}; add a column 'file' if some images are missing")
            missing = [path.name for path in paths if path.name not in self.by_name]
            if missing:
                what = f"has no time of {len(missing)} of {len(paths)} images"
                raise InputError(f"{what}, such as {missing[0]}")
            times = [self.by_name[path.name] for path in paths]
            if (k := _first_step_back(times)) is not None:
                what = f"{paths[k].name} was not taken after {paths[k - 1].name}"
                raise InputError(f"{what}; give the images in the order of time")
            return times


def load_image_times(path: Path) -> ImageTimes:
    """Read a table with a time [s] and, if known, the image's file in each row.

    A header may name the columns, ``time`` (with a unit such as ``time_ms``) and ``file``, among
    others. Of a file's path only the name is used.

    Raises:
        InputError: the file is no such table, or a time is no number or does not come after the one
            before; with file and line.

    """
    table = TimedTable(path, _LIST)
    times: list[float] = table.array(TIME)[:, 0].tolist()
    for line, time in zip(table.lines, times, strict=True):
        if not math.isfinite(time):
            raise table.error(f"'{time}' is not a time in seconds", line, TIME)
    if not times:
        raise table.error("has no times of images")
    if len(times) > 1 and not table.unit_named:
        table.interval(np.array(times), "image")
    names = [file.replace("\\", "/").rsplit("/", 1)[-1] for file in table.texts]
    by_name = dict(zip(names, times, strict=False))
    return ImageTimes(table.file, tuple(times), by_name, tuple(table.assumed))


def natural_key(path: Path) -> list[tuple[int, int, str]]:
    """Return a sort key of file names by which the numbers in them are ordered by value."""
    return [
        (0, int(run), run) if run.isdigit() else (1, 0, run.lower())
        for run in re.split(r"([0-9]+)", path.name)
        if run
    ]


def times_in_names(paths: Sequence[Path]) -> list[float] | None:
    """Read times [s] from the names of files if each has one time stamp, otherwise return None.

    Stamps are seconds with decimals, or milli-, micro- or nanoseconds since 1970 or power-on. There
    may be words around them, and numbers that are the same in all names.

    Raises:
        InputError: a stamp does not come after the one before it.

    """
    stamped = [list(_STAMP.finditer(path.stem)) for path in paths]
    if len(paths) < 2 or len({len(stamps) for stamps in stamped}) != 1:
        return None
    columns = [column for column in zip(*stamped, strict=True) if len({m[0] for m in column}) > 1]
    kinds = {stamp.lastgroup for column in columns for stamp in column}
    if len(columns) != 1 or len(kinds) != 1:
        return None
    stamps = columns[0]
    if kinds == {"whole"}:
        numbers = np.array([int(stamp[0]) for stamp in stamps])
        unit = epoch_unit(float(np.median(numbers))) or _usual_unit(numbers)
        if unit is None:
            return None
        times = [int(number) * unit for number in numbers.tolist()]
    else:
        times = [float(re.sub(r"[_-]", ".", stamp[0])) for stamp in stamps]
    if (k := _first_step_back(times)) is not None:
        what = f"its time stamp does not come after that of {paths[k - 1].name}"
        how = "give the images in the order of time, or --fps to take them backward"
        raise InputError(f"{what}; {how}", file=shown_path(paths[k]))
    return times


def _usual_unit(numbers: Array) -> float | None:
    """Return the unit [s] in which ``numbers`` (n,) are times since power-on; None if none."""
    interval = float(np.median(np.diff(numbers)))
    units = (1e-3, 1e-6, 1e-9)
    usual = (u for u in units if _INTERVALS[0] <= interval * u < _INTERVALS[1])
    return next((unit for unit in usual if numbers.max() * unit < _UPTIME), None)


def require_order(paths: Sequence[Path]) -> None:
    """Raise if numbered files are neither in the order of their numbers nor in the reverse.

    Files whose names differ in more than numbers may come in any order, if each number comes once.

    Raises:
        InputError: the files are shuffled, or of several cameras.

    """
    kinds: dict[str, dict[tuple[str, ...], Path]] = {}
    for path in paths:
        numbers = tuple(re.findall(r"[0-9]+", path.name))
        kinds.setdefault(re.sub(r"[0-9]+", "0", path.name), {})[numbers] = path
    series = [kind for kind in kinds.values() if len(kind) > 1]
    for one, other in itertools.combinations(series, 2):
        if len(common := sorted(one.keys() & other.keys())) > 1:
            what = f"has the number of {one[common[0]].name}, so they are of two cameras"
            how = f"{what}, or of depth: give those of one, as *.png"
            raise InputError(how, file=shown_path(other[common[0]]))
    if len(kinds) != 1:
        return
    keys = [natural_key(path) for path in paths]
    if keys in (sorted(keys), sorted(keys, reverse=True)):
        return
    k = next(k for k in range(1, len(keys)) if keys[k] < keys[k - 1])
    what = "the images are neither in the order of their numbers nor in the reverse"
    how = f"comes after {paths[k - 1].name}: {what}; sort them, or give their folder"
    raise InputError(how, file=shown_path(paths[k]))


def _first_step_back(times: Sequence[float]) -> int | None:
    pairs = enumerate(itertools.pairwise(times), start=1)
    return next((k for k, (before, after) in pairs if after <= before), None)
