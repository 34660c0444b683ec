"""Compiled inner loops of the flow of cells, once the floor has been brought to rest."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["match_cells", "unwarp_cells"]

Doubles = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]


@numba.njit(cache=True)
def match_cells(
    now: Bytes, moved: Bytes, cell: int, difference: float, gradient: float, good: Mask
) -> None:
    """Which cells of ``cell`` x ``cell`` pixels of ``now`` (h, w) agree with ``moved`` (h, w).

    ``good`` (h / cell, w / cell) is true where the mean difference is less than ``difference``
    [grey levels] and the mean square of the gradient [grey levels/px], by Sobel's operator with the
    border mirrored, more than the square of ``gradient``. All sums are of whole numbers.
    """
    h, w = now.shape
    pixels = cell * cell
    # the operator's weights sum up to 8 for one grey level per pixel
    most, least = difference * pixels, 64.0 * gradient * gradient * pixels
    rows, cols = good.shape
    for r in range(rows):
        for c in range(cols):
            off, steep = np.int64(0), np.int64(0)
            for y in range(r * cell, (r + 1) * cell):
                up, down = now[abs(y - 1)], now[y + 1 if y + 1 < h else h - 2]
                here = now[y]
                for x in range(c * cell, (c + 1) * cell):
                    left, right = abs(x - 1), x + 1 if x + 1 < w else w - 2
                    off += abs(np.int64(here[x]) - np.int64(moved[y, x]))
                    a, b = np.int64(up[left]), np.int64(down[right])
                    d, e = np.int64(up[right]), np.int64(down[left])
                    across = b + d - a - e + 2 * (np.int64(here[right]) - np.int64(here[left]))
                    along = b + e - a - d + 2 * (np.int64(down[x]) - np.int64(up[x]))
                    steep += across * across + along * along
            good[r, c] = off < most and steep > least


@numba.njit(cache=True)
def unwarp_cells(
    centres: Doubles, back: Floats, warp: Doubles, border: Doubles, good: Mask, vectors: Doubles
) -> None:
    """Vectors (rows, cols, 2) [px] of cells from where ``warp`` and ``back`` say they were.

    ``warp`` (3, 3) takes current pixels to past ones where the floor is, ``back`` (rows, cols, 2)
    [px] is what is added there. Vectors with an end outside of ``border`` (left, top, right,
    bottom) are no longer ``good``.
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
