"""Elementary functions of arrays, computed by the C library, element by element.

The last bits of numpy's own differ with AVX-512, except of its square root, sine, cosine,
hyperbolic tangent and ``hypot``, which need no replacement.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics.arrays import Array


def arccos(values: npt.ArrayLike) -> Array:
    """Compute angles [rad] in [0, pi] from their cosines ``values`` in [-1, 1]; same shape."""
    return _unary(_arccos, values)


def arctan2(y: npt.ArrayLike, x: npt.ArrayLike) -> Array:
    """Compute the angles [rad] in [-pi, pi] of the points (x, y), broadcast against each other."""
    return _binary(_arctan2, y, x)


def exp(values: npt.ArrayLike) -> Array:
    """Compute e to the power of ``values``, which must be below 700; same shape."""
    return _unary(_exp, values)


def log(values: npt.ArrayLike) -> Array:
    """Compute the natural logarithms of ``values``, which must be above 0; same shape."""
    return _unary(_log, values)


def power(base: npt.ArrayLike, exponent: npt.ArrayLike) -> Array:
    """Raise ``base`` to the power of ``exponent``, broadcast against each other."""
    return _binary(_power, base, exponent)


def _unary(kernel: Callable[[Array, Array], None], values: npt.ArrayLike) -> Array:
    arguments = np.array(values, dtype=np.float64, order="C")
    flat = arguments.reshape(-1)
    kernel(flat, flat)
    return arguments


def _binary(
    kernel: Callable[[Array, Array, Array], None],
    first: npt.ArrayLike,
    second: npt.ArrayLike,
) -> Array:
    one, other = (
        np.array(values, dtype=np.float64, order="C")
        for values in np.broadcast_arrays(first, second)
    )
    flat = one.reshape(-1)
    kernel(flat, other.reshape(-1), flat)
    return one


@numba.njit(cache=True)
def _arccos(values: Array, results: Array) -> None:
    for i in range(values.size):
        results[i] = math.acos(values[i])


@numba.njit(cache=True)
def _arctan2(y: Array, x: Array, results: Array) -> None:
    for i in range(y.size):
        results[i] = math.atan2(y[i], x[i])


@numba.njit(cache=True)
def _exp(values: Array, results: Array) -> None:
    for i in range(values.size):
        results[i] = math.exp(values[i])


@numba.njit(cache=True)
def _log(values: Array, results: Array) -> None:
    for i in range(values.size):
        results[i] = math.log(values[i])


@numba.njit(cache=True)
def _power(base: Array, exponent: Array, results: Array) -> None:
    for i in range(base.size):
        results[i] = math.pow(base[i], exponent[i])
