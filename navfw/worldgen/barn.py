"""The BARN benchmark: its worlds, its mission, the lengths of its reference paths.

Perille et al. 2020; github.com/Daffan/the-barn-challenge. The mission leads from (-2.25, 3) facing
y to (-2.25, 13), reached within 1 m, in 100 s. Each ``world_N.world`` has a reference path
``path_N.npy``, cells of a grid that do not depend on the robot; the score is relative to it.
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from numpy.lib.format import read_array

from navfw.config.input_file import is_file, read_input
from navfw.errors import ConfigError
from navfw.signals import Array
from navfw.worldgen.sdf_reader import SdfWorld

POLE_HEIGHT = 1.0
"""Height of BARN's poles [m]: in the files, half of their 1 m is below the ground."""

BARN_START = (-2.25, 3.0, 1.57)
BARN_GOAL = (-2.25, 13.0)
"""Start (x, y [m], yaw [rad]) and goal (x, y [m]) of BARN's mission."""

_RADIUS = 0.075
"""Radius of BARN's poles [m], half the side of a cell."""
_ORIGIN = -_RADIUS - 30 * 2 * _RADIUS, _RADIUS + 5.0
"""x and y [m] of the cell (0, 0) of reference paths."""
_MAX_BYTES = 1_000_000
"""Largest file of a reference path."""


def is_barn(found: SdfWorld) -> bool:
    """Whether this is a world of the BARN benchmark: many cylinders of BARN's name and radius."""
    return len(found.shapes) >= 20 and all(
        shape.name.startswith("unit_cylinder") and abs(shape.radius - _RADIUS) < 1e-6
        for shape in found.shapes
    )


def reference_length(world_file: Path) -> float | None:
    """Length [m] of the reference path beside ``world_N.world``, start and goal included.

    None if there is no file ``path_N.npy``.

    Raises:
        ConfigError: the file has no path.

    """
    number = re.fullmatch(r"world_(\d+)", world_file.stem)
    path = world_file.with_name(f"path_{number[1]}.npy") if number else None
    if path is None or not is_file(path):
        return None
    points = np.array([BARN_START[:2], *(_cells(path) * 2 * _RADIUS + _ORIGIN), BARN_GOAL])
    return round(float(np.hypot(*np.diff(points, axis=0).T).sum()), 3)


def _cells(path: Path) -> Array:
    """(n, 2) cells of a reference path."""
    try:
        cells = read_array(io.BytesIO(read_input(path, _MAX_BYTES)), allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise ConfigError(f"is no NumPy array: {error}", file=path) from None
    if cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype.kind not in "iuf":
        raise ConfigError(
            f"expected cells (n, 2) of a reference path, got {cells.dtype} {cells.shape}", file=path
        )
    if not np.isfinite(cells).all():
        raise ConfigError("has cells that are not finite", file=path)
    return np.asarray(cells, dtype=np.float64)
