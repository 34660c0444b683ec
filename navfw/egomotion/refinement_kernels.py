"""Compiled inner loops of gyro refinement."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

__all__ = ["refine_rotation", "weigh_residuals"]

Doubles = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

#: Squared width of the Cauchy weights [sigma^2]; 2.385 sigma is 95 % efficient on normal errors.
CAUCHY = 2.385**2


@numba.njit(cache=True)
def refine_rotation(
    points: Doubles,
    derotated: Doubles,
    sigma: Doubles,
    confidence: Doubles,
    translation: Doubles,
    focal: float,
    axes: Doubles,
    prior: Doubles,
    settings: tuple[float, float, float],
    iterations: int,
) -> tuple[Doubles, Doubles, Doubles, Doubles]:
    """Epipolar lines and errors of a flow field, then ``_fit_rotation``.

    Args:
        points: (n, 2) image points [px].
        derotated: (n, 2) their flow without the measured rotation [px].
        sigma: (n,) standard deviation of the flow [px].
        confidence: (n,) confidence of the vectors.
        translation: (3,) translation of the camera [m].
        focal: focal length [px].
        axes: (2, 3) as in ``_fit_rotation``.
        prior: (2,) as in ``_fit_rotation``.
        settings: ignored radius around the focus of expansion [px], standard deviation of the
            translation's direction [rad], and number of vectors with a common error.
        iterations: number of reweightings.

    Returns:
        angles (2,), covariance (2, 2), residuals (n,) as in ``_fit_rotation``, and the standard
        deviations (n,) [px] of the residuals.

    """
    hole, direction_sigma, overlap = settings
    n = points.shape[0]
    tx, ty, tz = translation
    # near the focus of expansion the direction of the lines is undefined
    nearest = hole * math.sqrt(tx * tx + ty * ty + tz * tz)
    lines = np.zeros((n, 2), np.float64)
    allowed = np.empty(n, np.float64)
    weight = np.zeros(n, np.float64)
    for i in range(n):
        x, y = points[i, 0] * tz - focal * tx, points[i, 1] * tz - focal * ty
        if math.hypot(x, y) > nearest:
            lines[i, 0], lines[i, 1] = x, y
        u, v = derotated[i, 0], derotated[i, 1]
        allowed[i] = math.hypot(sigma[i], direction_sigma * math.hypot(u, v))
        if math.isfinite(u) and math.isfinite(v):
            weight[i] = confidence[i] / overlap
    angles, covariance, residuals = _fit_rotation(
        points, derotated, lines, allowed, weight, focal, axes, prior, iterations
    )
    return angles, covariance, residuals, allowed


@numba.njit(cache=True)
def weigh_residuals(
    residual: Doubles,
    allowed: Doubles,
    consistent: Mask,
    confidence: Doubles,
    certain: float,
    doubt: float,
) -> tuple[Doubles, Doubles]:
    """Confidence (n,) of vectors given their epipolar residuals, and inconsistency (n,).

    A vector is inconsistent with the motion if it is not ``consistent`` and its ``residual`` [px]
    exceeds ``certain`` times its standard deviation ``allowed`` [px], to which ``doubt`` [px] is
    added in quadrature; its inconsistency is then its confidence, otherwise 0.
    """
    n = residual.size
    weighted, inconsistency = np.empty(n, np.float64), np.zeros(n, np.float64)
    for i in range(n):
        off = residual[i] / allowed[i]
        if math.isnan(off):
            off = 0.0
        weighted[i] = confidence[i] * math.exp(-((0.5 * off) ** 2)) if consistent[i] else 0.0
        if not consistent[i] and abs(residual[i]) > certain * math.hypot(allowed[i], doubt):
            inconsistency[i] = confidence[i]
    return weighted, inconsistency


@numba.njit(cache=True)
def _fit_rotation(
    points: Doubles,
    derotated: Doubles,
    epipolar: Doubles,
    sigma: Doubles,
    weight: Doubles,
    focal: float,
    axes: Doubles,
    prior: Doubles,
    iterations: int,
) -> tuple[Doubles, Doubles, Doubles]:
    """Small rotation that minimises the distances of the flow from its epipolar lines (METHOD 2.6).

    Args:
        points: (n, 2) image points [px].
        derotated: (n, 2) their flow without the measured rotation [px].
        epipolar: (n, 2) directions of the epipolar lines, of any length; zero if unknown.
        sigma: (n,) standard deviation of the flow [px].
        weight: (n,) weights of the vectors; 0 leaves a vector out.
        focal: focal length [px].
        axes: (2, 3) unit rotation vectors of the two unknown angles, in current camera axes.
        prior: (2,) prior standard deviation of the two angles [rad], above 0.
        iterations: number of reweightings.

    Returns:
        angles (2,) [rad]; their covariance (2, 2); and the distances (n,) [px] from the epipolar
        lines after correction, NaN where the line is unknown.

    """
    n = points.shape[0]
    slopes = np.zeros((n, 2), np.float64)
    offsets = np.full(n, np.nan)
    for i in range(n):
        ex, ey = epipolar[i, 0], epipolar[i, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length == 0.0:
            continue
        nx, ny = -ey / length, ex / length
        x, y = points[i, 0] - derotated[i, 0], points[i, 1] - derotated[i, 1]
        offsets[i] = nx * derotated[i, 0] + ny * derotated[i, 1]
        for k in range(2):
            wx, wy, wz = axes[k, 0], axes[k, 1], axes[k, 2]
            # motion of the vector's past end per angle about this axis
            u = -wx * x * y / focal + wy * (focal + x * x / focal) - wz * y
            v = -wx * (focal + y * y / focal) + wy * x * y / focal + wz * x
            slopes[i, k] = nx * u + ny * v
    a, b = 0.0, 0.0
    covariance = np.zeros((2, 2), np.float64)
    for _ in range(iterations):
        m00, m11, m01 = 1.0 / prior[0] ** 2, 1.0 / prior[1] ** 2, 0.0
        r0, r1 = 0.0, 0.0
        for i in range(n):
            if weight[i] <= 0.0 or math.isnan(offsets[i]):
                continue
            s0, s1 = slopes[i, 0], slopes[i, 1]
            off = (offsets[i] - s0 * a - s1 * b) / sigma[i]
            # Cauchy weights: an outlier of many sigma has next to no weight
            w = weight[i] / (sigma[i] * sigma[i] * (1.0 + off * off / CAUCHY))
            m00 += w * s0 * s0
            m01 += w * s0 * s1
            m11 += w * s1 * s1
            r0 += w * s0 * offsets[i]
            r1 += w * s1 * offsets[i]
        det = m00 * m11 - m01 * m01
        a = (m11 * r0 - m01 * r1) / det
        b = (m00 * r1 - m01 * r0) / det
        covariance[0, 0], covariance[1, 1] = m11 / det, m00 / det
        covariance[0, 1] = covariance[1, 0] = -m01 / det
    residuals = offsets - slopes[:, 0] * a - slopes[:, 1] * b
    return np.array([a, b]), covariance, residuals
