"""Columns of a gyro record: which quantity in which unit, by the header of the file."""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass

from navfw.errors import did_you_mean

COLUMNS = ("time", "yaw_rate", "pitch_rate", "roll_rate")
"""Columns of a record: time [s] and rates [rad/s], positive for a turn to the left (yaw), nose down
(pitch) and right side down (roll)."""
RATES = COLUMNS[1:]
_AXES = {"gyro_x": "roll_rate", "gyro_y": "pitch_rate", "gyro_z": "yaw_rate"}
_BY_AXIS = {
    name.replace("gyro_", word): rate
    for name, rate in _AXES.items()
    for word in ("gyro_", "gyroscope_", "w", "w_", "omega_", "angular_velocity_")
}
_OTHER_NAMES = {
    "t": "time",
    "timestamp": "time",
    "stamp": "time",
    **_BY_AXIS,
    **{rate.removesuffix("_rate"): rate for rate in RATES},
}
"""Other names of columns; x, y and z are the axes ahead, left and up (REP 103)."""
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time [s]."""
_RATE_UNITS = {
    "rad/s": 1.0,
    "mrad/s": 1e-3,
    "deg/s": math.pi / 180.0,
    "mdeg/s": math.pi / 180e3,
}
"""Units of rates [rad/s]."""
_SPELLINGS = {
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
    "µs": "us",
    "usec": "us",
    "nsec": "ns",
    "rads": "rad/s",
    "rps": "rad/s",
    "dps": "deg/s",
    "degs": "deg/s",
    "degrees/s": "deg/s",
    "°/s": "deg/s",
    "mdps": "mdeg/s",
    "mdegs": "mdeg/s",
    "mrads": "mrad/s",
}
_NEAR = 0.75
"""Likeness from which an unknown name is taken for a misspelt one."""


@dataclass(frozen=True, slots=True)
class GyroColumn:
    """``name`` is one of COLUMNS; a cell times ``unit`` is in s or rad/s.

    ``by_axis``: the header names an axis of the gyro, not the rotation about it.
    """

    name: str
    unit: float
    by_axis: bool = False


def column_of(header: str) -> GyroColumn | None:
    """The column with a ``header`` such as ``yaw_rate [deg/s]`` or ``gyro_z_deg_s``.

    None if it is another quantity, which is of no use here.

    Raises:
        ValueError: the name is nearly that of a column, or the unit is unknown.

    """
    written, unit = _parts(header)
    name = _OTHER_NAMES.get(written, written)
    if name not in COLUMNS:
        known = [*COLUMNS, *_OTHER_NAMES]
        if difflib.get_close_matches(name, known, n=1, cutoff=_NEAR):
            raise ValueError(f"unknown column {header!r}: {did_you_mean(name, known)}")
        return None
    units = _TIME_UNITS if name == "time" else _RATE_UNITS
    if unit is None:
        return GyroColumn(name, 1.0, written in _BY_AXIS)
    if unit not in units:
        raise ValueError(f"unknown unit in {header!r}; known: {', '.join(units)}")
    return GyroColumn(name, units[unit], written in _BY_AXIS)


def _parts(header: str) -> tuple[str, str | None]:
    """Name and unit of a header; the unit is None if it has none."""
    text = header.strip().lower()
    bracketed = re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", text)
    if bracketed is not None:
        unit = bracketed[2].replace("sec", "s") if "/" in bracketed[2] else bracketed[2]
        return re.sub(r"[ .\-]+", "_", bracketed[1]), _SPELLINGS.get(unit, unit)
    name = re.sub(r"[ .\-]+", "_", text)
    for unit in sorted([*_TIME_UNITS, *_RATE_UNITS, *_SPELLINGS], key=len, reverse=True):
        ending = "_" + unit.replace("/", "_")
        if name.endswith(ending):
            return name.removesuffix(ending), _SPELLINGS.get(unit, unit)
    return name, None
