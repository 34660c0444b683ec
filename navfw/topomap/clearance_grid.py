"""The free ground of a world as a grid of clearances, and its skeleton."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array, Mask

__all__ = ["ClearanceGrid", "thinned"]


@dataclass(frozen=True, slots=True)
class ClearanceGrid:
    """Distances to the nearest solid: ``clearance`` (rows, cols) [m], negative inside solids.

    Cell (i, j) has its middle at ``origin + (j, i) * cell`` [m].
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
        """The ground within ``bounds`` (x0, y0, x1, y1) [m]; its edge counts as a wall."""
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
        """(x, y) [m] of the middle of a cell."""
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


def thinned(mask: Mask) -> Mask:
    """The skeleton of ``mask``, one cell wide and connected as it was (Zhang and Suen 1984)."""
    shape = np.pad(mask, 1).astype(np.uint8)
    while True:
        before = int(shape.sum())
        for first in (True, False):
            # the neighbours, clockwise from the one above
            n = [
                shape[:-2, 1:-1],
                shape[:-2, 2:],
                shape[1:-1, 2:],
                shape[2:, 2:],
                shape[2:, 1:-1],
                shape[2:, :-2],
                shape[1:-1, :-2],
                shape[:-2, :-2],
            ]
            count = np.sum(n, axis=0)
            rises = np.sum([(n[k] == 0) & (n[(k + 1) % 8] == 1) for k in range(8)], axis=0)
            up, right, down, left = n[0], n[2], n[4], n[6]
            if first:
                edge = (up & right & down) | (right & down & left)
            else:
                edge = (up & right & left) | (up & down & left)
            gone = (count >= 2) & (count <= 6) & (rises == 1) & (edge == 0)
            shape[1:-1, 1:-1][gone] = 0
        if int(shape.sum()) == before:
            return shape[1:-1, 1:-1] > 0
