"""Order and times of image files by their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from navfw.config.input_file import shown_path
from navfw.errors import InputError

_EPOCH_UNITS = {13: 1e-3, 16: 1e-6, 19: 1e-9}
"""Unit [s] of a time since 1970 written as a whole number, by its number of digits."""


def natural_key(path: Path) -> list[tuple[int, int, str]]:
    """Sort key of file names that compares the numbers in them by value."""
    return [
        (0, int(part), part) if part.isdigit() else (1, 0, part.lower())
        for part in re.split(r"([0-9]+)", path.name)
        if part
    ]


def times_in_names(paths: Sequence[Path]) -> list[float] | None:
    """Times [s] by the names of files if all are time stamps, otherwise None.

    Stamps are seconds with decimals, or milli-, micro- or nanoseconds since 1970.

    Raises:
        InputError: a stamp does not come after the one before it.

    """
    if len(paths) < 2:
        return None
    times = _seconds(paths) or _epochs(paths)
    if times is None:
        return None
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
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


def _seconds(paths: Sequence[Path]) -> list[float] | None:
    if not all(re.fullmatch(r"[0-9]{1,12}\.[0-9]+", path.stem) for path in paths):
        return None
    return [float(path.stem) for path in paths]


def _epochs(paths: Sequence[Path]) -> list[float] | None:
    unit = _EPOCH_UNITS.get(len(paths[0].stem))
    if unit is None or not all(re.fullmatch(r"[0-9]+", path.stem) for path in paths):
        return None
    if len({len(path.stem) for path in paths}) != 1:
        return None
    return [int(path.stem) * unit for path in paths]
