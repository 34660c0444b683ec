"""Compiled merging of submaps into the global grid of evidence."""

from __future__ import annotations

import math

import numba

from navfw.signals.grown_grid import Evidence

OLD_SHARE = 0.5  # chosen
"""Share of the earlier evidence that is kept when a cell is observed again: two observations
supersede any number of earlier ones, one is not enough against a certain obstacle."""


@numba.njit(cache=True)
def merge_submap(grid: Evidence, submap: Evidence, column: float, row: float, turn: float) -> None:
    """Merge the evidence of ``submap`` into ``grid``, in place.

    Args:
        grid: (rows, columns) evidence; cells of the submap outside of it are left out.
        submap: (rows, columns) evidence, 0 where nothing was observed.
        column: column of ``grid`` at which the centre of the submap's cell [0, 0] lies [cells].
        row: the same for its row.
        turn: angle [rad] from the grid's axes to those of the submap.

    """
    c, s = math.cos(turn), math.sin(turn)
    height, width = submap.shape
    left, right, low, high = column, column, row, row
    for i in (0, height - 1):
        for j in (0, width - 1):
            x, y = column + c * j - s * i, row + s * j + c * i
            left, right = min(left, x), max(right, x)
            low, high = min(low, y), max(high, y)
    for i in range(max(math.floor(low), 0), min(math.ceil(high) + 1, grid.shape[0])):
        for j in range(max(math.floor(left), 0), min(math.ceil(right) + 1, grid.shape[1])):
            dx, dy = j - column, i - row
            x = math.floor(c * dx + s * dy + 0.5)
            y = math.floor(c * dy - s * dx + 0.5)
            if 0 <= x < width and 0 <= y < height and submap[y, x] != 0:
                merged = math.floor(OLD_SHARE * grid[i, j] + submap[y, x] + 0.5)
                grid[i, j] = min(max(merged, -127), 127)
