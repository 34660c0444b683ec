"""Compiled checks of arrays in answers: each takes about 1 us, where numpy takes several."""

from __future__ import annotations

import math

import numba

from navfw.numerics import Array

_ROUNDING = 1e-9  # chosen
"""Tolerance by which a degree may exceed 1, as sums and products of degrees round."""

_ASYMMETRY = 1e-6  # chosen
"""Largest asymmetry of a covariance, relative to its largest entry or to 1."""


@numba.njit(cache=True)
def are_finite(values: Array) -> bool:  # pragma: no cover - compiled
    """Whether all ``values`` are finite."""
    valid = True
    for value in values.flat:
        valid = valid and math.isfinite(value)
    return valid


@numba.njit(cache=True)
def are_degrees(values: Array) -> bool:  # pragma: no cover - compiled
    """Whether all ``values`` are in [0, 1], up to rounding; NaN is not."""
    valid = True
    for value in values.flat:
        valid = valid and bool(0.0 <= value <= 1.0 + _ROUNDING)
    return valid


@numba.njit(cache=True)
def are_finite_where(values: Array, confidence: Array, low: float) -> bool:  # pragma: no cover
    """Whether ``values`` (rows, cols) are all >= ``low``, and finite where confidence > 0."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if values[i, j] < low or (confidence[i, j] > 0.0 and not math.isfinite(values[i, j])):
                return False
    return True


@numba.njit(cache=True)
def is_symmetric(covariance: Array) -> bool:  # pragma: no cover - compiled
    """Whether ``covariance`` (n, n) is symmetric up to rounding."""
    asymmetry, scale = 0.0, 1.0
    for i in range(covariance.shape[0]):
        for j in range(covariance.shape[1]):
            scale = max(scale, abs(covariance[i, j]))
            asymmetry = max(asymmetry, abs(covariance[i, j] - covariance[j, i]))
    return bool(asymmetry <= _ASYMMETRY * scale)
