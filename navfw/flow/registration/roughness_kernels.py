"""Roughness of a flow field: how much neighbouring vectors disagree, against their variance."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array, Mask


@numba.njit(cache=True)
def roughness(vectors: Array, variance: Array, trusted: Mask, least: int) -> float:
    """Median over the field of the second differences in units of their standard deviation.

    Along a row or a column of cells three vectors of one surface lie almost on a line, so what is
    left of ``vectors`` (rows, cols, 2) [px] in their second difference is mostly error, and has the
    variance a + 4 b + c for three independent vectors. ``variance`` (rows, cols) [px^2] belongs to
    a component. Only triples of ``trusted`` cells count; NaN if there are fewer than ``least``.
    """
    rows, cols = trusted.shape
    ratios = np.empty(2 * rows * cols, np.float64)
    count = 0
    for r in range(rows):
        for c in range(cols):
            if not trusted[r, c]:
                continue
            for down, right in ((0, 1), (1, 0)):
                i, j, k, m = r - down, c - right, r + down, c + right
                if i < 0 or j < 0 or k >= rows or m >= cols:
                    continue
                if not (trusted[i, j] and trusted[k, m]):
                    continue
                x = vectors[i, j, 0] - 2.0 * vectors[r, c, 0] + vectors[k, m, 0]
                y = vectors[i, j, 1] - 2.0 * vectors[r, c, 1] + vectors[k, m, 1]
                expected = variance[i, j] + 4.0 * variance[r, c] + variance[k, m]
                ratios[count] = math.sqrt((x * x + y * y) / expected)
                count += 1
    if count < least:
        return math.nan
    return float(np.median(ratios[:count]))
