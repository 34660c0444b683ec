"""The clearance grid of a world: the distance to the nearest obstacle, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from navfw.numerics import Array

_EXACT = 1.0
"""Distances up to this [m] are exact: they decide on doors and free widths."""


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
        near_clearances: Callable[[Array, Array, float], Array],
        cell: float = 0.05,
    ) -> ClearanceGrid:
        """The grid within ``bounds`` (x0, y0, x1, y1) [m]; the boundary counts as a wall.

        ``near_clearances`` gives the distances (len(y), len(x)) [m] to the nearest obstacle at the
        points of a grid with these x and y [m], no more than the third argument [m]. Beyond
        ``_EXACT`` distances are those between cells, to half a cell.
        """
        x0, y0, x1, y1 = bounds
        x = np.arange(x0 + 0.5 * cell, x1, cell)
        y = np.arange(y0 + 0.5 * cell, y1, cell)
        near = near_clearances(x, y, _EXACT)
        apart = cv2.distanceTransform((near > 0.0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        far = np.maximum((apart.astype(np.float64) - 0.5) * cell, _EXACT)
        clearance = np.where(near < _EXACT, near, far)
        edge = np.minimum.outer(np.minimum(y - y0, y1 - y), np.minimum(x - x0, x1 - x))
        return cls((float(x[0]), float(y[0])), cell, np.minimum(clearance, edge))

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
        return float(self.at_points(np.stack([x, y], axis=1)).min())

    def at_points(self, points: Array) -> Array:
        """Clearances (...) [m] at points (..., 2), from the nearest cells, outside at the edge."""
        rows, columns = self.clearance.shape
        j = np.rint((points[..., 0] - self.origin[0]) / self.cell).astype(int)
        i = np.rint((points[..., 1] - self.origin[1]) / self.cell).astype(int)
        clearances: Array = self.clearance[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]
        return clearances
