"""Arrays of square cells: discs, distances, bounds, spots; grids shifted by whole cells."""

from __future__ import annotations

import cv2
import numpy as np

from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices

_GAPS = np.ones((3, 3), np.uint8)  # defined
"""Structuring element that closes gaps of up to two cells between the rays of sparse flow."""


def cell_disc(radius: int) -> Mask:
    """Return a disc: (2 radius + 1, 2 radius + 1), True within ``radius`` [cells] of the centre."""
    offsets = np.arange(-radius, radius + 1)
    within: Mask = offsets[:, None] ** 2 + offsets[None, :] ** 2 <= radius**2
    return within


def without_gaps(mask: Mask) -> Mask:
    """Return ``mask`` (rows, columns) with gaps of up to two cells closed."""
    closed: Mask = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, _GAPS) > 0
    return closed


def distances(occupied: Mask, cell: float, farthest: float = 10.0) -> Array:
    """Compute distances (n, n) [m] from each cell to the nearest of ``occupied`` (n, n).

    ``cell`` [m] is the side of a cell; all distances are ``farthest`` [m] if no cell is occupied.
    """
    if not occupied.any():
        return np.full(occupied.shape, farthest)
    in_cells = cv2.distanceTransform((~occupied).view(np.uint8), cv2.DIST_L2, 5)
    return np.multiply(in_cells, cell, dtype=np.float64)


def shifted(grid: Array, columns: int, rows: int) -> Array:
    """Shift the origin of ``grid`` (n, n) by (columns, rows); new cells are zero (unknown)."""
    n = grid.shape[0]
    moved = np.zeros_like(grid)
    if abs(columns) >= n or abs(rows) >= n:
        return moved
    target = np.s_[max(0, -rows) : n - max(0, rows), max(0, -columns) : n - max(0, columns)]
    source = np.s_[max(0, rows) : n + min(0, rows), max(0, columns) : n + min(0, columns)]
    moved[target] = grid[source]
    return moved


def clipped_cells(
    points: Array, origin: tuple[float, float], cell: float, size: int
) -> tuple[tuple[Indices, Indices], Mask]:
    """Return rows and columns (...) of ``points`` (..., 2) [m], clipped; and which are inside."""
    cells = np.rint((points - np.array(origin)) / cell).astype(np.intp)
    inside = np.all((cells >= 0) & (cells < size), axis=-1)
    columns, rows = np.moveaxis(np.clip(cells, 0, size - 1), -1, 0)
    return (rows, columns), inside


def marked_cells(points: Array, origin: tuple[float, float], cell: float, size: int) -> Mask:
    """Return which cells (``size``, ``size``) have one of ``points`` (n, 2) [m]."""
    (rows, columns), inside = clipped_cells(points, origin, cell, size)
    marked = np.zeros((size, size), np.bool_)
    marked[rows[inside], columns[inside]] = True
    return marked


def bounds(mask: Mask) -> tuple[slice, slice]:
    """Return the rows and columns that hold all cells of ``mask``; one cell if there is none."""
    if not mask.any():
        return slice(0, 1), slice(0, 1)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def small_spots(mask: Mask, largest: float, connectivity: int) -> tuple[Indices, Mask]:
    """Find the connected spots of ``mask`` (rows, columns) of up to ``largest`` cells.

    Returns each cell's number of its spot, 0 outside the mask, and which numbers (n,) are small.
    """
    cells = mask.view(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(cells, connectivity=connectivity)
    small: Mask = stats[:, cv2.CC_STAT_AREA] <= largest
    small[0] = False
    return np.asarray(labels, dtype=np.intp), small
