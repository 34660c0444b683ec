"""A floor plan: a grid of cells that are free, occupied or unknown, fixed in the map's frame.

The values and the order of the cells are those of ROS' ``nav_msgs/OccupancyGrid``. The robot may
know a floor plan, like the rest of its map: it shows walls, and no furniture that was moved since.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from navfw.errors import MapError
from navfw.numerics import Array, Mask
from navfw.signals import Pose
from navfw.signals.immutability import freeze

Cells = npt.NDArray[np.int8]

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
"""The values of cells, as in ``nav_msgs/OccupancyGrid``."""

MAX_CELLS = 16_000_000
"""Largest number of cells: 200 x 200 m at 5 cm."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyMap:
    """Cells (rows, columns) of ``FREE``, ``OCCUPIED`` or ``UNKNOWN``, ``resolution`` [m] wide.

    ``origin`` is the pose, in the frame ``map``, of the grid's corner: columns run along its x axis
    and rows along its y axis, so the centre of cell (i, j) is at
    ``origin.to_parent((j + 0.5) * resolution, (i + 0.5) * resolution)``. ``file`` is the yaml file
    that it was read from. The cells are read only.

    >>> plan = OccupancyMap(np.array([[FREE, OCCUPIED]]), 0.1, Pose(2.0, 3.0, 0.0))
    >>> plan.centres(*np.nonzero(plan.occupied))
    array([[2.15, 3.05]])
    >>> plan.state(np.array([[2.05, 3.01], [9.0, 9.0]]))
    array([ 0, -1], dtype=int8)

    Raises:
        MapError: it has no cells, or more than ``MAX_CELLS``.

    """

    cells: Cells
    resolution: float
    origin: Pose
    file: Path | None = None

    def __post_init__(self) -> None:
        """Check the size, and make the cells read only."""
        if self.cells.ndim != 2 or not 0 < self.cells.size <= MAX_CELLS:
            size = " x ".join(map(str, self.cells.shape[::-1]))
            raise MapError(
                f"a floor plan has 1 to {MAX_CELLS} cells, got {size}; reduce the image and "
                "enlarge its resolution by the same factor",
                file=self.file,
            )
        object.__setattr__(self, "cells", np.asarray(self.cells, dtype=np.int8))
        freeze(self, "cells")

    @property
    def free(self) -> Mask:
        """The cells (rows, columns) that are known to be free."""
        free: Mask = self.cells == FREE
        return free

    @property
    def occupied(self) -> Mask:
        """The cells (rows, columns) that are known to be occupied."""
        occupied: Mask = self.cells == OCCUPIED
        return occupied

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m] of the grid, along its own axes."""
        rows, columns = self.cells.shape
        return columns * self.resolution, rows * self.resolution

    def centres(self, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> Array:
        """(N, 2) centres [m] of cells in the frame ``map``."""
        along_axes = np.stack([columns + 0.5, rows + 0.5], axis=1) * self.resolution
        return self.origin.points_to_parent(along_axes)

    def state(self, points: Array) -> Cells:
        """(N,) state of points (N, 2) [m] of the frame ``map``; unknown outside of the grid."""
        local = self.origin.points_to_local(points)
        index = np.floor(local[:, ::-1] / self.resolution).astype(np.intp)  # row, column
        inside = np.all((index >= 0) & (index < self.cells.shape), axis=1)
        states = np.full(len(points), UNKNOWN, dtype=np.int8)
        states[inside] = self.cells[index[inside, 0], index[inside, 1]]
        return states
