"""Windows that hold two surfaces, found by what their neighbours say of the motion."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["find_mixtures"]

Doubles = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@numba.njit(cache=True)
def find_mixtures(
    vectors: Doubles, gradients: Doubles, trusted: Flags, x_centres: Doubles, y_centres: Doubles
) -> Doubles:
    """How badly both neighbours of a window contradict its own affine motion (rows, cols) [px].

    A window across an edge in depth can fit both surfaces by a steep change of flow that neither
    has. On one surface the neighbours continue a window's motion; beside an edge, the one on its
    own side does. Only a mixture disagrees with both: the lesser of the two contradictions counts,
    along the worse of rows and columns. A neighbour that is not there or not trusted confirms no
    change at all.
    """
    rows, cols = trusted.shape
    worst = np.zeros((rows, cols), np.float64)
    for r in range(rows):
        for c in range(cols):
            for axis in range(2):
                least = np.inf
                for side in (-1, 1):
                    i, j = (r, c + side) if axis == 0 else (r + side, c)
                    there = 0 <= i < rows and 0 <= j < cols
                    if axis == 0:
                        k = min(max(j, 0), cols - 1)
                        away = x_centres[k] - x_centres[c] if there else x_centres[1] - x_centres[0]
                    else:
                        k = min(max(i, 0), rows - 1)
                        away = y_centres[k] - y_centres[r] if there else y_centres[1] - y_centres[0]
                    off_x = gradients[r, c, axis] * away
                    off_y = gradients[r, c, 2 + axis] * away
                    if there and trusted[i, j]:
                        off_x -= vectors[i, j, 0] - vectors[r, c, 0]
                        off_y -= vectors[i, j, 1] - vectors[r, c, 1]
                    least = min(least, math.sqrt(off_x * off_x + off_y * off_y))
                worst[r, c] = max(worst[r, c], least)
    return worst
