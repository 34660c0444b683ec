"""Robust fit of epipolar residuals, compiled: what every estimate of the camera's motion shares.

Gauss-Newton with Cauchy weights (iteratively reweighted least squares). A residual is the distance
of a flow vector from its epipolar line: a static point moves along that line whatever its depth
(METHOD 2.6). Points are in pixels relative to the principal point.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.camera_geometry.rotations import turning_slope
from navfw.numerics.algebra_kernels import solve_system
from navfw.numerics.arrays import Array

CAUCHY = 2.385**2
"""Squared width of the Cauchy weights [sigma^2]; 2.385 sigma is 95 % efficient on normal errors."""


@numba.njit(cache=True)
def epipolar_residual(
    point: tuple[float, float],
    vector: tuple[float, float],
    focal: float,
    translation: Array,
    hole: float,
    axes: Array,
    row: Array,
) -> float:
    """Distance [px] of a derotated flow ``vector`` at ``point`` from its epipolar line.

    Args:
        point: x, y [px] in the current image.
        vector: u, v [px], without the part due to rotation.
        focal: focal length [px].
        translation: (3,) translation of the camera, of any length, in current camera axes.
        hole: radius around the focus of expansion [px times the length of ``translation``] within
            which the line has no direction.
        axes: (k, 3) axes, in current camera axes, of small rotations of the past image's rays.
        row: (at least k,) is set to the derivatives [px/rad] by these rotations.

    Returns:
        the signed distance; NaN, with zero derivatives, where the line has no direction.

    """
    x, y = point
    u, v = vector
    ex = x * translation[2] - focal * translation[0]
    ey = y * translation[2] - focal * translation[1]
    length = math.sqrt(ex * ex + ey * ey)
    if not length > hole:
        row[: axes.shape[0]] = 0.0
        return math.nan
    nx, ny = -ey / length, ex / length
    for k in range(axes.shape[0]):
        # the past end moves by a rotation: the vector gets shorter by as much
        du, dv = turning_slope(x - u, y - v, axes[k], focal)
        row[k] = -(nx * du + ny * dv)
    distance: float = nx * u + ny * v
    return distance


@numba.njit(cache=True)
def cauchy_weight(residual: float, sigma: float, weight: float) -> float:
    """Weight [1/px^2] of an equation: an outlier of many ``sigma`` [px] has next to none."""
    off = residual / sigma
    return weight / (sigma * sigma * (1.0 + off * off / CAUCHY))


@numba.njit(cache=True)
def add_equations(
    matrix: Array, right: Array, slopes: Array, offsets: Array, weights: Array
) -> None:
    """Add the equations ``slopes @ parameters = -offsets`` to normal equations.

    Args:
        matrix: (k, k) symmetric; is changed.
        right: (k,) right side; is changed.
        slopes: (n, k) derivatives of residuals by the parameters.
        offsets: (n,) residuals [px].
        weights: (n,) weights [1/px^2]; 0 leaves an equation out, whatever is in it.

    """
    # one sum after the other: a sum in a register takes half the time of one in memory
    for j in range(right.size):
        total = right[j]
        for i in range(offsets.size):
            if weights[i] > 0.0:
                total -= weights[i] * slopes[i, j] * offsets[i]
        right[j] = total
        for h in range(j, right.size):
            total = matrix[j, h]
            for i in range(offsets.size):
                if weights[i] > 0.0:
                    total += weights[i] * slopes[i, j] * slopes[i, h]
            matrix[j, h] = matrix[h, j] = total


@numba.njit(cache=True)
def fit_reweighted(
    offsets: Array,
    slopes: Array,
    sigma: Array,
    weight: Array,
    prior: Array,
    iterations: int,
) -> tuple[Array, Array]:
    """Parameters that bring ``offsets + slopes @ parameters`` to zero, by Cauchy weights.

    Args:
        offsets: (n,) residuals without correction [px]; NaN leaves a residual out.
        slopes: (n, k) their derivatives by the parameters.
        sigma: (n,) their standard deviations [px].
        weight: (n,) weights; 0 leaves a residual out.
        prior: (k, k) information of the prior on the parameters, of mean 0.
        iterations: number of reweightings, from 1.

    Returns:
        parameters (k,) and their information (k, k).

    """
    n, k = slopes.shape
    parameters, weights = np.zeros(k), np.zeros(n)
    matrix, right = np.empty((k, k)), np.empty(k)
    for _ in range(iterations):
        for i in range(n):
            if weight[i] <= 0.0 or math.isnan(offsets[i]):
                continue
            off = offsets[i]
            for j in range(k):
                off += slopes[i, j] * parameters[j]
            weights[i] = cauchy_weight(off, sigma[i], weight[i])
        matrix[:] = prior
        right[:] = 0.0
        add_equations(matrix, right, slopes, offsets, weights)
        parameters = _solved(matrix, right)
    return parameters, matrix


@numba.njit(cache=True)
def _solved(matrix: Array, right: Array) -> Array:
    """Solution (k,) of ``matrix`` (k, k) times it = ``right`` (k,)."""
    solution = np.empty_like(right)
    if right.size == 2:
        det = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[0, 1]
        solution[0] = (matrix[1, 1] * right[0] - matrix[0, 1] * right[1]) / det
        solution[1] = (matrix[0, 0] * right[1] - matrix[0, 1] * right[0]) / det
    else:
        solution[:] = solve_system(matrix, right)
    return solution
