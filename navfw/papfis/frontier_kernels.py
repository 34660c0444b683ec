"""Compiled kernels of exploration: unseen floor in view of a point, steepest paths, free lines."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices


@numba.njit(cache=True)
def unseen_in_view(
    unseen: Mask, occupied: Mask, cells: Indices, reach: float, step: float, rays: int
) -> Array:
    """Compute the area (n,) [cells] of unseen floor in view of each of ``cells`` (n, 2), all round.

    ``unseen`` and ``occupied`` (rows, columns) are of a grid; what lies outside it is unseen. A ray
    ends at an occupied cell, or after ``reach`` [cells]; unseen floor hides nothing. There are
    ``rays`` all round, which are sampled every ``step`` [cells].
    """
    areas = np.zeros(len(cells))
    sector = 2.0 * math.pi / rays
    for k in range(len(cells)):
        for ray in range(rays):
            dr, dc = math.sin(ray * sector), math.cos(ray * sector)
            away = 0.5 * step
            while away < reach:
                i = int(math.floor(cells[k, 0] + dr * away + 0.5))
                j = int(math.floor(cells[k, 1] + dc * away + 0.5))
                inside = 0 <= i < unseen.shape[0] and 0 <= j < unseen.shape[1]
                if inside and occupied[i, j]:
                    break
                if not inside or unseen[i, j]:
                    areas[k] += sector * away * step
                away += step
    return areas


@numba.njit(cache=True)
def steepest_path(value: Array, row: int, column: int, path: Indices) -> int:
    """Walk from a cell to ever lower ``value`` (rows, columns), to the lowest of eight neighbours.

    Writes the cells, the first included, to ``path`` (n, 2) and returns their number; a solution of
    the eikonal equation leads to a source.
    """
    count = 0
    while count < len(path):
        path[count, 0], path[count, 1] = row, column
        count += 1
        best, to_row, to_column = value[row, column], row, column
        for i in range(max(row - 1, 0), min(row + 2, value.shape[0])):
            for j in range(max(column - 1, 0), min(column + 2, value.shape[1])):
                if value[i, j] < best:
                    best, to_row, to_column = value[i, j], i, j
        if to_row == row and to_column == column:
            break
        row, column = to_row, to_column
    return count


@numba.njit(cache=True)
def free_line(price: Array, start: Array, end: Array, dearest: float) -> bool:
    """Return whether every cell on the straight line costs at most ``dearest``.

    ``start`` and ``end`` (2,) are (row, column); cells within 1.5 of the start are not looked at:
    the body stands there.
    """
    dr, dc = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dr, dc)
    steps = int(math.ceil(2.0 * length))
    for k in range(1, steps + 1):
        share = k / steps
        if share * length <= 1.5:
            continue
        i = int(math.floor(start[0] + share * dr + 0.5))
        j = int(math.floor(start[1] + share * dc + 0.5))
        if not (0 <= i < price.shape[0] and 0 <= j < price.shape[1]):
            return False
        if not price[i, j] <= dearest:
            return False
    return True
