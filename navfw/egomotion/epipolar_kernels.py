"""Compiled robust fits of epipolar residuals: what every estimate of the camera's motion shares.

Gauss-Newton with Cauchy weights (iteratively reweighted least squares). A residual is the distance
of a flow vector from its epipolar line: a static point moves along that line whatever its depth
(METHOD 2.6). Points are in pixels relative to the principal point; ``past`` is where the point that
is now at ``points`` was in the past image: ``points - vectors``.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.camera_geometry.rotations import (
    rotation_matrix,
    rotation_vector,
    turn_point,
    turn_points,
    turning_slope,
)
from navfw.numerics.algebra_kernels import bilinear, dot, multiply, solve_system
from navfw.numerics.arrays import Array

CAUCHY = 2.385**2  # derived
"""Squared width of the Cauchy weights [sigma^2]; 2.385 sigma is 95 % efficient on normal errors."""

_COARSE = 0.5  # chosen
"""Standard deviation [px] of residuals because the directions searched are not the right one."""

_HOLE = 4.0  # chosen
"""Radius around the focus of expansion [px] within which the epipolar line has no direction: there
the whole derotated vector is residual, since it has to be short."""

_MEDIAN_LENGTH = 1.18  # derived
"""Median length of vectors whose components are normal with standard deviation 1."""


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
    """Compute the distance [px] of a derotated flow ``vector`` at ``point`` from its epipolar line.

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
def _cauchy_weight(residual: float, sigma: float, weight: float) -> float:
    """Weight [1/px^2] of an equation: an outlier of many ``sigma`` [px] has next to none."""
    off = residual / sigma
    return weight / (sigma * sigma * (1.0 + off * off / CAUCHY))


@numba.njit(cache=True)
def _add_equations(
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
    """Fit parameters that bring ``offsets + slopes @ parameters`` to zero, by Cauchy weights.

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
            weights[i] = _cauchy_weight(off, sigma[i], weight[i])
        matrix[:] = prior
        right[:] = 0.0
        _add_equations(matrix, right, slopes, offsets, weights)
        if k == 2:
            det = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[0, 1]
            parameters[0] = (matrix[1, 1] * right[0] - matrix[0, 1] * right[1]) / det
            parameters[1] = (matrix[0, 0] * right[1] - matrix[0, 1] * right[0]) / det
        else:
            parameters = solve_system(matrix, right)
    return parameters, matrix


@numba.njit(cache=True, error_model="numpy")
def fit_rotation(
    points: Array,
    past: Array,
    sigma: Array,
    weight: Array,
    focal: float,
    start: Array,
    prior: Array,
    iterations: int,
) -> Array:
    """Fit the rotation (3, 3), past to current axes, of a camera that only turns, to the vectors.

    Args:
        points: (n, 2) image points [px].
        past: (n, 2) where they were [px].
        sigma: (n,) standard deviation of the vectors [px].
        weight: (n,) weights of the vectors; 0 leaves a vector out.
        focal: focal length [px].
        start: (3, 3) rotation, past to current camera axes, to start from.
        prior: (3, 3) information [1/rad^2] by which each step is damped.
        iterations: number of Gauss-Newton steps.

    """
    n = points.shape[0]
    rotation, axes = start.copy(), np.eye(3)
    along_x, along_y = np.zeros((n, 3)), np.zeros((n, 3))
    length, weights = np.full(n, math.nan), np.zeros(n)
    matrix, right = np.zeros((3, 3)), np.zeros(3)
    for _ in range(iterations):
        ends = turn_points(past, rotation, focal)
        off = ends - points
        for i in range(n):
            if weight[i] > 0.0:
                length[i] = math.sqrt(off[i, 0] * off[i, 0] + off[i, 1] * off[i, 1])
        scale = max(1.0, np.nanmedian(length / sigma) / _MEDIAN_LENGTH)
        for i in range(n):
            weights[i] = 0.0
            if math.isnan(length[i]):
                continue
            weights[i] = _cauchy_weight(length[i] / scale, sigma[i], weight[i])
            for k in range(3):
                u, v = turning_slope(ends[i, 0], ends[i, 1], axes[k], focal)
                along_x[i, k], along_y[i, k] = u, v
        matrix[:] = prior
        right[:] = 0.0
        _add_equations(matrix, right, along_x, off[:, 0], weights)
        _add_equations(matrix, right, along_y, off[:, 1], weights)
        step = solve_system(matrix, right)
        rotation = multiply(rotation_matrix(step), rotation)
    return rotation


@numba.njit(cache=True, error_model="numpy")
def _residual(
    point: tuple[float, float],
    vector: tuple[float, float],
    focal: float,
    direction: Array,
    axes: Array,
    row: Array,
) -> float:
    """Return ``epipolar_residual`` with _HOLE filled: there it is the length of ``vector``."""
    residual: float = epipolar_residual(point, vector, focal, direction, _HOLE, axes, row)
    if math.isnan(residual):
        return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1])
    return residual


@numba.njit(cache=True, error_model="numpy")
def _direction_slopes(
    point: tuple[float, float],
    vector: tuple[float, float],
    focal: float,
    direction: Array,
    basis: Array,
    slopes: Array,
) -> None:
    """Set ``slopes`` (2,) to the residual's derivatives [px/rad] along ``basis`` (2, 3)."""
    x, y = point
    u, v = vector
    ex, ey = x * direction[2] - focal * direction[0], y * direction[2] - focal * direction[1]
    length = math.sqrt(ex * ex + ey * ey)
    slopes[:] = 0.0
    if not length > _HOLE:
        return
    residual = (ex * v - ey * u) / length
    for k in range(2):
        dex = x * basis[k, 2] - focal * basis[k, 0]
        dey = y * basis[k, 2] - focal * basis[k, 1]
        cross = (dex * v - dey * u) / length
        slopes[k] = cross - residual * (ex * dex + ey * dey) / (length * length)


@numba.njit(cache=True, error_model="numpy")
def rate_directions(
    points: Array,
    past: Array,
    sigma: Array,
    weight: Array,
    focal: float,
    directions: Array,
    prior: Array,
) -> tuple[Array, Array]:
    """Rate each direction of translation by its cost with the best rotation for it.

    Args as those of ``fit_rotation``, and:
        past: (n, 2) where the points were, the known part of the rotation removed [px].
        directions: (m, 3) unit vectors, in current camera axes.
        prior: (3, 3) information of the prior on the rotation vector, of mean 0 [1/rad^2].

    Returns:
        cost (m,): half the sum of squares, bounded for each vector, with 0.5 px added to
        sigma in quadrature; rotation (m, 3) [rad], the small rotation vector of each.

    """
    n, m = points.shape[0], directions.shape[0]
    cost, rotation = np.zeros(m), np.zeros((m, 3))
    axes = np.eye(3)
    slopes, offsets = np.zeros((n, 3)), np.zeros(n)
    for k in range(m):
        for i in range(n):
            if weight[i] > 0.0:
                x, y = points[i, 0], points[i, 1]
                vector = x - past[i, 0], y - past[i, 1]
                offsets[i] = _residual((x, y), vector, focal, directions[k], axes, slopes[i])
        angles, _ = fit_reweighted(offsets, slopes, sigma, weight, prior, 4)
        rotation[k] = angles
        total = 0.5 * bilinear(angles, prior, angles)
        for i in range(n):
            if weight[i] > 0.0 and not math.isnan(offsets[i]):
                off = offsets[i]
                for j in range(3):
                    off += slopes[i, j] * angles[j]
                off /= math.sqrt(sigma[i] * sigma[i] + _COARSE * _COARSE)
                total += 0.5 * weight[i] * off * off / (1.0 + off * off / CAUCHY)
        cost[k] = total
    return cost, rotation


@numba.njit(cache=True, error_model="numpy")
def fit_motion(
    points: Array,
    past: Array,
    sigma: Array,
    weight: Array,
    focal: float,
    start: tuple[Array, Array],
    prior: tuple[Array, Array],
    heading: tuple[Array, Array],
    iterations: int,
) -> tuple[Array, Array, Array, Array]:
    """Fit rotation and direction of translation that minimise the epipolar residuals.

    Gauss-Newton with Cauchy weights over five parameters: a small rotation about the current
    camera's axes, and two angles of the direction.

    Args as those of ``fit_rotation``, and:
        start: rotation (3, 3), past to current camera axes, and unit direction (3,) to start from.
        prior: mean rotation (3, 3) and information (3, 3) [1/rad^2] of the prior on the rotation.
        heading: mean direction (3,) and information (3, 3) [1] of the prior on the direction, as a
            vector; zeros without one.
        iterations: number of Gauss-Newton steps.

    Returns:
        rotation (3, 3); direction (3,); information (5, 5) in the basis of ``tangents``; residuals
        (n,) [px].

    """
    n = points.shape[0]
    rotation, t = start[0].copy(), start[1].copy()
    mean, information = prior
    towards, pull = heading
    axes, slopes = np.eye(3), np.zeros((n, 5))
    residuals, weights = np.zeros(n), np.zeros(n)
    matrix, right = np.zeros((5, 5)), np.zeros(5)
    for step in range(iterations + 1):
        basis = tangents(t)
        matrix[:], right[:] = 0.0, 0.0
        off3 = rotation_vector(multiply(rotation, mean.T))
        matrix[:3, :3] = information
        for k in range(3):
            right[k] = -dot(information[k], off3)
        gap = t - towards
        for j in range(2):
            right[3 + j] = -bilinear(basis[j], pull, gap)
            for h in range(2):
                matrix[3 + j, 3 + h] = bilinear(basis[j], pull, basis[h])
        for i in range(n):
            point = points[i, 0], points[i, 1]
            px, py = turn_point(past[i, 0], past[i, 1], rotation, focal)
            vector = point[0] - px, point[1] - py
            residuals[i] = _residual(point, vector, focal, t, axes, slopes[i])
            _direction_slopes(point, vector, focal, t, basis, slopes[i, 3:])
            weights[i] = 0.0
            if weight[i] > 0.0 and not math.isnan(residuals[i]):
                weights[i] = _cauchy_weight(residuals[i], sigma[i], weight[i])
        _add_equations(matrix, right, slopes, residuals, weights)
        if step == iterations:
            break
        # a little damping: the direction is free where all points are far away
        damped = matrix.copy()
        for j in range(5):
            damped[j, j] = damped[j, j] * 1.001 + 1e-6
        move = solve_system(damped, right)
        turn = math.sqrt(move[3] * move[3] + move[4] * move[4])
        if turn > 0.3:
            move *= 0.3 / turn
        rotation = multiply(rotation_matrix(move[:3]), rotation)
        t = t + move[3] * basis[0] + move[4] * basis[1]
        t /= math.sqrt(dot(t, t))
    return rotation, t, matrix, residuals


@numba.njit(cache=True)
def tangents(direction: Array) -> Array:
    """Return two orthonormal vectors (2, 3) perpendicular to the unit vector ``direction`` (3,).

    The first lies in the camera's horizontal plane: it is a change of bearing.
    """
    basis = np.zeros((2, 3))
    flat = math.sqrt(direction[0] ** 2 + direction[2] ** 2)
    if flat > 1e-6:
        basis[0, 0], basis[0, 2] = direction[2] / flat, -direction[0] / flat
    else:
        basis[0, 0] = 1.0
    basis[1] = np.cross(direction, basis[0])
    return basis
