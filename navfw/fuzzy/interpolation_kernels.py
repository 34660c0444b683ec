"""Compiled evaluation of sampled membership functions, by ``np.interp``'s operations."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics import Array


@numba.njit(cache=True)
def interval_of(xs: Array, x: float) -> int:
    """The index i with xs[i] <= x < xs[i + 1] (xs increasing, x within them)."""
    low, high = 0, xs.size - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if xs[middle] <= x:
            low = middle
        else:
            high = middle
    return high if x >= xs[high] else low


@numba.njit(cache=True)
def interpolate(xs: Array, ys: Array, i: int, x: float) -> float:
    """``np.interp`` of x with xs[i] <= x < xs[i + 1], to the last bit."""
    if xs[i] == x or i == xs.size - 1:
        return float(ys[i])
    return float((ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i]) * (x - xs[i]) + ys[i])


@numba.njit(cache=True)
def fuzzify(x: Array, xs: Array, sampled: Array, out: Array) -> None:
    """Degrees of one input: x (N,), universe xs (M,), terms (T, M) sampled -> out (N, T)."""
    for n in range(x.size):
        value = min(max(x[n], xs[0]), xs[-1])
        if math.isnan(x[n]):
            out[n, :] = np.nan
            continue
        i = interval_of(xs, value)
        for t in range(sampled.shape[0]):
            out[n, t] = interpolate(xs, sampled[t], i, value)
