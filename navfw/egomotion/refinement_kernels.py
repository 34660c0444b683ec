"""Compiled inner loops of gyro refinement."""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.egomotion.epipolar_kernels import epipolar_residual, fit_reweighted
from navfw.numerics.arrays import Array, Mask

_MIN_SIGMA = 1e-6
"""Least standard deviation of a residual [px]: a processor may call its vectors exact."""


@numba.njit(cache=True)
def refine_rotation(
    points: Array,
    derotated: Array,
    sigma: Array,
    confidence: Array,
    translation: Array,
    focal: float,
    axes: Array,
    prior: Array,
    settings: tuple[float, float, float],
    iterations: int,
) -> tuple[Array, Array, Array, Array]:
    """Small rotation that minimises the distances of the flow from its epipolar lines (METHOD 2.6).

    The fit of the camera's motion with the direction of translation known and the rotation about
    two axes only, linear about the measured rotation.

    Args:
        points: (n, 2) image points [px].
        derotated: (n, 2) their flow without the measured rotation [px].
        sigma: (n,) standard deviation of the flow [px].
        confidence: (n,) confidence of the vectors; 0 leaves a vector out.
        translation: (3,) translation of the camera [m].
        focal: focal length [px].
        axes: (2, 3) unit rotation vectors of the two unknown angles, in current camera axes.
        prior: (2,) prior standard deviation of the two angles [rad], above 0.
        settings: ignored radius around the focus of expansion [px], standard deviation of the
            translation's direction [rad], and number of vectors with a common error.
        iterations: number of reweightings.

    Returns:
        angles (2,) [rad]; their standard deviations (2,) [rad]; the distances (n,) [px] from the
        epipolar lines after correction, NaN where the line is unknown; and the standard deviations
        (n,) [px] of the distances.

    """
    hole, direction_sigma, overlap = settings
    n = points.shape[0]
    tx, ty, tz = translation
    # near the focus of expansion the direction of the lines is undefined
    nearest = hole * math.sqrt(tx * tx + ty * ty + tz * tz)
    offsets, slopes = np.empty(n), np.empty((n, 2))
    allowed, weight = np.empty(n), np.zeros(n)
    for i in range(n):
        u, v = derotated[i, 0], derotated[i, 1]
        offsets[i] = epipolar_residual(
            (points[i, 0], points[i, 1]), (u, v), focal, translation, nearest, axes, slopes[i]
        )
        allowed[i] = max(math.hypot(sigma[i], direction_sigma * math.hypot(u, v)), _MIN_SIGMA)
        if math.isfinite(u) and math.isfinite(v):
            weight[i] = confidence[i] / overlap
    information = np.zeros((2, 2))
    information[0, 0], information[1, 1] = 1.0 / prior[0] ** 2, 1.0 / prior[1] ** 2
    angles, matrix = fit_reweighted(offsets, slopes, allowed, weight, information, iterations)
    det = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[0, 1]
    deviations = np.sqrt(np.array([matrix[1, 1] / det, matrix[0, 0] / det]))
    residuals = offsets + slopes[:, 0] * angles[0] + slopes[:, 1] * angles[1]
    return angles, deviations, residuals, allowed


@numba.njit(cache=True)
def weigh_residuals(
    residual: Array,
    allowed: Array,
    consistent: Mask,
    confidence: Array,
    certain: float,
    doubt: float,
) -> tuple[Array, Array]:
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
