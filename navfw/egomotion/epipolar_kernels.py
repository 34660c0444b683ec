"""Compiled inner loops of egomotion from the flow: epipolar residuals and their robust fit.

Points are relative to the principal point, with the focal length as third coordinate. ``past`` is
where the point that is now at ``points`` was in the past image: ``points - vectors``.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from navfw.camera_geometry.rotations import rotation_matrix, rotation_vector
from navfw.camera_geometry.turned_points import turn_point

__all__ = ["fit_motion", "rate_directions"]

Doubles = npt.NDArray[np.float64]

CAUCHY = 2.385**2
"""Squared width of the Cauchy weights [sigma^2]; 2.385 sigma is 95 % efficient on normal errors."""

COARSE = 0.5
"""Standard deviation [px] of residuals because the directions searched are not the right one."""

HOLE = 4.0
"""Radius around the focus of expansion [px] within which the epipolar line has no direction: there
the whole derotated vector is residual, since it has to be short."""


@numba.njit(cache=True, error_model="numpy")
def _row(
    x: float, y: float, px: float, py: float, focal: float, t: Doubles, basis: Doubles, row: Doubles
) -> float:
    """Residual [px] of one vector, and its derivatives ``row`` (5,) by rotation and direction.

    (px, py) is the derotated past end. The residual is the signed distance of the vector's past end
    from the epipolar line through (x, y).
    """
    vx, vy = x - px, y - py
    ex, ey = x * t[2] - focal * t[0], y * t[2] - focal * t[1]
    length = math.sqrt(ex * ex + ey * ey)
    if length < HOLE:
        for k in range(5):
            row[k] = 0.0
        return math.sqrt(vx * vx + vy * vy)
    nx, ny = -ey / length, ex / length
    residual: float = nx * vx + ny * vy
    # the motion of the past end by small rotations about the camera's axes
    row[0] = -(nx * (-px * py / focal) + ny * (-(focal + py * py / focal)))
    row[1] = -(nx * (focal + px * px / focal) + ny * (px * py / focal))
    row[2] = -(nx * (-py) + ny * px)
    for k in range(2):
        dex = x * basis[k, 2] - focal * basis[k, 0]
        dey = y * basis[k, 2] - focal * basis[k, 1]
        cross = (-dey * vx + dex * vy) / length
        row[3 + k] = cross - residual * (ex * dex + ey * dey) / (length * length)
    return residual


@numba.njit(cache=True, error_model="numpy")
def rate_directions(
    points: Doubles,
    past: Doubles,
    sigma: Doubles,
    weight: Doubles,
    focal: float,
    directions: Doubles,
    prior: Doubles,
    iterations: int,
) -> tuple[Doubles, Doubles]:
    """Cost of each direction of translation, with the best rotation for it.

    Args:
        points: (n, 2) image points [px].
        past: (n, 2) where they were, the known part of the rotation removed [px].
        sigma: (n,) standard deviation of the vectors [px].
        weight: (n,) weights of the vectors; 0 leaves a vector out.
        focal: focal length [px].
        directions: (m, 3) unit vectors, in current camera axes.
        prior: (3, 3) information of the prior on the rotation vector, of mean 0 [1/rad^2].
        iterations: number of reweightings.

    Returns:
        cost (m,): half the sum of squares, bounded for each vector, with COARSE [px] added to
        sigma in quadrature; rotation (m, 3) [rad], the small rotation vector of each.

    """
    n, m = points.shape[0], directions.shape[0]
    cost, rotation = np.zeros(m), np.zeros((m, 3))
    basis, row = np.zeros((2, 3)), np.zeros(5)
    slopes, offsets = np.zeros((n, 3)), np.zeros(n)
    for k in range(m):
        for i in range(n):
            if weight[i] > 0.0:
                offsets[i] = _row(
                    points[i, 0],
                    points[i, 1],
                    past[i, 0],
                    past[i, 1],
                    focal,
                    directions[k],
                    basis,
                    row,
                )
                slopes[i] = row[:3]
        angles: Any = np.zeros(3)
        for _ in range(iterations):
            matrix, right = prior.copy(), np.zeros(3)
            for i in range(n):
                if weight[i] <= 0.0:
                    continue
                off = offsets[i]
                for j in range(3):
                    off += slopes[i, j] * angles[j]
                off /= sigma[i]
                w = weight[i] / (sigma[i] * sigma[i] * (1.0 + off * off / CAUCHY))
                for j in range(3):
                    right[j] -= w * slopes[i, j] * offsets[i]
                    for h in range(j + 1):
                        matrix[j, h] += w * slopes[i, j] * slopes[i, h]
            for j in range(3):
                for h in range(j + 1, 3):
                    matrix[j, h] = matrix[h, j]
            angles = np.linalg.solve(matrix, right)
        rotation[k] = angles
        total = 0.5 * (angles @ (prior @ angles))
        for i in range(n):
            if weight[i] > 0.0:
                off = offsets[i]
                for j in range(3):
                    off += slopes[i, j] * angles[j]
                off /= math.sqrt(sigma[i] * sigma[i] + COARSE * COARSE)
                total += 0.5 * weight[i] * off * off / (1.0 + off * off / CAUCHY)
        cost[k] = total
    return cost, rotation


@numba.njit(cache=True, error_model="numpy")
def fit_motion(
    points: Doubles,
    past: Doubles,
    sigma: Doubles,
    weight: Doubles,
    focal: float,
    start: tuple[Doubles, Doubles],
    prior: tuple[Doubles, Doubles],
    heading: tuple[Doubles, Doubles],
    iterations: int,
) -> tuple[Doubles, Doubles, Doubles, Doubles]:
    """Rotation and direction of translation that minimise the epipolar residuals.

    Gauss-Newton with Cauchy weights over five parameters: a small rotation about the current
    camera's axes, and two angles of the direction.

    Args:
        points: (n, 2) image points [px].
        past: (n, 2) where they were [px].
        sigma: (n,) standard deviation of the vectors [px].
        weight: (n,) weights of the vectors; 0 leaves a vector out.
        focal: focal length [px].
        start: rotation (3, 3), past to current camera axes, and unit direction (3,) to start from.
        prior: mean rotation (3, 3) and information (3, 3) [1/rad^2] of the prior on the rotation.
        heading: mean direction (3,) and information (3, 3) [1] of the prior on the direction, as a
            vector; zeros without one.
        iterations: number of Gauss-Newton steps.

    Returns:
        rotation (3, 3); direction (3,); information (5, 5) in the basis of ``_tangents``; residuals
        (n,) [px].

    """
    n = points.shape[0]
    rotation, t = start[0].copy(), start[1].copy()
    mean, information = prior
    towards, pull = heading
    row, residuals = np.zeros(5), np.zeros(n)
    matrix, right = np.zeros((5, 5)), np.zeros(5)
    for step in range(iterations + 1):
        basis = _tangents(t)
        matrix[:], right[:] = 0.0, 0.0
        off3 = rotation_vector(rotation @ mean.T)
        matrix[:3, :3] = information
        right[:3] = -(information @ off3)
        gap = t - towards
        for j in range(2):
            right[3 + j] = -(basis[j] @ (pull @ gap))
            for h in range(2):
                matrix[3 + j, 3 + h] = basis[j] @ (pull @ basis[h])
        for i in range(n):
            residuals[i] = math.nan
            x, y = points[i, 0], points[i, 1]
            px, py = turn_point(past[i, 0], past[i, 1], rotation, focal)
            residual = _row(x, y, px, py, focal, t, basis, row)
            residuals[i] = residual
            if weight[i] <= 0.0 or math.isnan(residual):
                continue
            off = residual / sigma[i]
            w = weight[i] / (sigma[i] * sigma[i] * (1.0 + off * off / CAUCHY))
            for j in range(5):
                right[j] -= w * row[j] * residual
                for h in range(5):
                    matrix[j, h] += w * row[j] * row[h]
        if step == iterations:
            break
        # a little damping: the direction is free where all points are far away
        damped = matrix.copy()
        for j in range(5):
            damped[j, j] = damped[j, j] * 1.001 + 1e-6
        move: Any = np.linalg.solve(damped, right)
        turn = math.sqrt(move[3] * move[3] + move[4] * move[4])
        if turn > 0.3:
            move *= 0.3 / turn
        rotation = rotation_matrix(move[:3]) @ rotation
        t = t + move[3] * basis[0] + move[4] * basis[1]
        t /= math.sqrt(t @ t)
    return rotation, t, matrix, residuals


@numba.njit(cache=True)
def _tangents(direction: Doubles) -> Doubles:
    """Two orthonormal vectors (2, 3) perpendicular to the unit vector ``direction`` (3,).

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
