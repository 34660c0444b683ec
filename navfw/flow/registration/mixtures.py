"""Detection of windows that span two surfaces, by comparison with their neighbours' motion."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array, Mask


@numba.njit(cache=True)
def find_mixtures(
    vectors: Array, gradients: Array, trusted: Mask, x_centres: Array, y_centres: Array
) -> Array:
    """Disagreement (rows, cols) [px] of each window's affine motion with both its neighbours.

    A window across a depth edge can fit both surfaces by a steep gradient of the flow that neither
    surface has. Within a surface both neighbours continue a window's motion; next to an edge the
    neighbour on the same side does. Only a mixed window disagrees with both neighbours. The result
    is therefore the smaller disagreement of the two neighbours, of rows or columns whichever is
    larger. For a neighbour that is missing or not ``trusted`` zero change of the flow is assumed.
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
