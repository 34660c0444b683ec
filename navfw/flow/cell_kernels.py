"""Compiled inner loops of floor-aligned flow: test of the matches, undoing of the alignment."""

from __future__ import annotations

import numba
import numpy as np

from navfw.numerics.arrays import Array, Bytes, Floats, Mask

CELL = 4  # chosen
"""Side of the cells [px] over which flow is averaged."""
_DIFFERENCE = 8.0  # chosen
"""Largest mean absolute difference [grey levels] between a cell and its match."""
_GRADIENT = 1.5  # chosen
"""Least root mean square gradient [grey levels/px] of a cell that can be matched."""


@numba.njit(cache=True)
def match_cells(now: Bytes, moved: Bytes, good: Mask) -> None:
    """Set ``good`` (h / CELL, w / CELL): whether the cells of ``now`` and ``moved`` (h, w) match.

    A cell matches if its grey values differ little and its gradient, by Sobel's operator with
    mirrored border, is steep enough. The sums are exact integers.
    """
    h, w = now.shape
    pixels = CELL * CELL
    # Sobel's operator gives 8 for a gradient of one grey level per pixel
    most, least = _DIFFERENCE * pixels, 64.0 * _GRADIENT * _GRADIENT * pixels
    rows, cols = good.shape
    for r in range(rows):
        for c in range(cols):
            off, steep = np.int64(0), np.int64(0)
            for y in range(r * CELL, (r + 1) * CELL):
                up, down = now[abs(y - 1)], now[y + 1 if y + 1 < h else h - 2]
                row = now[y]
                for x in range(c * CELL, (c + 1) * CELL):
                    left, right = abs(x - 1), x + 1 if x + 1 < w else w - 2
                    off += abs(np.int64(row[x]) - np.int64(moved[y, x]))
                    a, b = np.int64(up[left]), np.int64(down[right])
                    d, e = np.int64(up[right]), np.int64(down[left])
                    across = b + d - a - e + 2 * (np.int64(row[right]) - np.int64(row[left]))
                    along = b + e - a - d + 2 * (np.int64(down[x]) - np.int64(up[x]))
                    steep += across * across + along * along
            good[r, c] = off < most and steep > least


@numba.njit(cache=True)
def unwarp_cells(
    centres: Array, back: Floats, warp: Array, border: Array, good: Mask, vectors: Array
) -> None:
    """Set ``vectors`` (rows, cols, 2) [px] to the flow of cells before floor alignment.

    ``warp`` (3, 3) maps current pixels to past pixels of the floor; ``back`` (rows, cols, 2) [px],
    past - now, is the flow between the aligned images, added to the mapped position. ``good`` is
    cleared for vectors with an end outside ``border`` (left, top, right, bottom) [px].
    """
    left, top, right, bottom = border
    for r in range(centres.shape[0]):
        for c in range(centres.shape[1]):
            x, y = centres[r, c, 0], centres[r, c, 1]
            depth = warp[2, 0] * x + warp[2, 1] * y + warp[2, 2]
            u = (warp[0, 0] * x + warp[0, 1] * y + warp[0, 2]) / depth + back[r, c, 0]
            v = (warp[1, 0] * x + warp[1, 1] * y + warp[1, 2]) / depth + back[r, c, 1]
            vectors[r, c, 0], vectors[r, c, 1] = x - u, y - v
            within = left < x < right and top < y < bottom
            if not (within and left < u < right and top < v < bottom):
                good[r, c] = False
