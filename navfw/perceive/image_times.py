"""Order and times of image files: by a list, or by their names."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from navfw.config.input_file import shown_path
from navfw.errors import InputError
from navfw.perceive.timed_table import TIME, TIME_NAMES, TableFormat, TimedTable

_FILE = "file"
_LIST = TableFormat(
    columns=(TIME, _FILE),
    needed=1,
    names=TIME_NAMES | dict.fromkeys(("file", "filename", "file_name", "image", "name"), _FILE),
    text=_FILE,
)
_OPTION = "--times"
_EPOCH_UNITS = {13: 1e-3, 16: 1e-6, 19: 1e-9}
"""Unit [s] of a time since 1970 written as a whole number, by its number of digits."""


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
        if (k := _first_step_back(times)) is not None:
            raise self._error(
                f"{paths[k].name} was not taken after {paths[k - 1].name}; give the images in "
                "the order of time"
            )
        return times

    def _error(self, message: str) -> InputError:
        return InputError(message, file=self.file, key=_OPTION)


def load_image_times(path: Path) -> ImageTimes:
    """Read a table of a time [s] and, if known, the image's file in each row.

    A header may name the columns, ``time`` (with a unit such as ``time_ms``) and ``file``, among
    others. Of a file's path only the name counts.

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
    names = [file.replace("\\", "/").rsplit("/", 1)[-1] for file in table.texts]
    return ImageTimes(table.file, tuple(times), dict(zip(names, times, strict=False)))


def natural_key(path: Path) -> list[tuple[int, int, str]]:
    """Sort key of file names that compares the numbers in them by value."""
    return [
        (0, int(run), run) if run.isdigit() else (1, 0, run.lower())
        for run in re.split(r"([0-9]+)", path.name)
        if run
    ]


def times_in_names(paths: Sequence[Path]) -> list[float] | None:
    """Times [s] by the names of files if all are time stamps, otherwise None.

    Stamps are seconds with decimals, or milli-, micro- or nanoseconds since 1970.

    Raises:
        InputError: a stamp does not come after the one before it.

    """
    if len(paths) < 2:
        return None
    stems = [path.stem for path in paths]
    if all(re.fullmatch(r"[0-9]{1,12}\.[0-9]+", stem) for stem in stems):
        times = [float(stem) for stem in stems]
    elif len({len(stem) for stem in stems}) == 1 and all(
        re.fullmatch(r"[0-9]+", stem) for stem in stems
    ):
        unit = _EPOCH_UNITS.get(len(stems[0]))
        if unit is None:
            return None
        times = [int(stem) * unit for stem in stems]
    else:
        return None
    if (k := _first_step_back(times)) is not None:
        raise InputError(
            f"its time stamp does not come after that of {paths[k - 1].name}; give the images "
            "in the order of time, or --fps to take them backward",
            file=shown_path(paths[k]),
        )
    return times


def require_order(paths: Sequence[Path]) -> None:
    """Refuse numbered files that are neither in the order of their numbers nor in the reverse.

    Files whose names differ in more than numbers may come in any order.

    Raises:
        InputError: the files are shuffled.

    """
    if len({re.sub(r"[0-9]+", "0", path.name) for path in paths}) != 1:
        return
    keys = [natural_key(path) for path in paths]
    if keys in (sorted(keys), sorted(keys, reverse=True)):
        return
    k = next(k for k in range(1, len(keys)) if keys[k] < keys[k - 1])
    raise InputError(
        f"comes after {paths[k - 1].name}: the images are neither in the order of their numbers "
        "nor in the reverse; sort them, or give their folder",
        file=shown_path(paths[k]),
    )


def _first_step_back(times: Sequence[float]) -> int | None:
    pairs = enumerate(itertools.pairwise(times), start=1)
    return next((k for k, (before, after) in pairs if after <= before), None)
