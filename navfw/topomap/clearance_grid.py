"""The clearance grid of a world: the distance to the nearest obstacle, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array

__all__ = ["ClearanceGrid"]


@dataclass(frozen=True, slots=True)
class ClearanceGrid:
    """Distances to the nearest obstacle: ``clearance`` (rows, cols) [m], negative inside one.

    The centre of cell (i, j) is at ``origin + (j, i) * cell`` [m].
    """

    origin: tuple[float, float]
    cell: float
    clearance: Array

    @classmethod
    def of(
        cls,
        bounds: tuple[float, float, float, float],
        clearances: Callable[[Array], Array],
        cell: float = 0.05,
    ) -> ClearanceGrid:
        """The grid within ``bounds`` (x0, y0, x1, y1) [m]; the boundary counts as a wall.

        ``clearances`` gives the distances [m] of points (N, 2) to the nearest obstacle.
        """
        x0, y0, x1, y1 = bounds
        x = np.arange(x0 + 0.5 * cell, x1, cell)
        y = np.arange(y0 + 0.5 * cell, y1, cell)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        edge = np.minimum(
            np.minimum(points[:, 0] - x0, x1 - points[:, 0]),
            np.minimum(points[:, 1] - y0, y1 - points[:, 1]),
        )
        free = np.minimum(clearances(points), edge)
        return cls((float(x[0]), float(y[0])), cell, free.reshape(len(y), len(x)))

    def point(self, row: float, column: float) -> tuple[float, float]:
        """(x, y) [m] of the centre of a cell."""
        return self.origin[0] + column * self.cell, self.origin[1] + row * self.cell

    def at(self, x: float, y: float) -> float:
        """Clearance [m] at a point, from the nearest cell; 0 outside the grid."""
        row = round((y - self.origin[1]) / self.cell)
        column = round((x - self.origin[0]) / self.cell)
        rows, columns = self.clearance.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return float(self.clearance[row, column]) if inside else 0.0

    def along(self, a: tuple[float, float], b: tuple[float, float]) -> float:
        """Least clearance [m] on the straight line between two points."""
        count = max(math.ceil(math.dist(a, b) / (0.5 * self.cell)), 1)
        share = np.linspace(0.0, 1.0, count + 1)
        x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
        rows, columns = self.clearance.shape
        i = np.clip(np.rint((y - self.origin[1]) / self.cell).astype(int), 0, rows - 1)
        j = np.clip(np.rint((x - self.origin[0]) / self.cell).astype(int), 0, columns - 1)
        return float(self.clearance[i, j].min())
