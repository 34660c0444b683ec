"""Refinement of the gyro's rotation by the flow's epipolar residuals (METHOD 2.6)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from navfw.camera_geometry.rotations import derotated_vectors, rotation_matrix
from navfw.egomotion.epipolar_kernels import epipolar_residual, fit_reweighted
from navfw.numerics.arrays import Array, Mask
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

_ITERATIONS = 6  # chosen
"""Number of reweightings."""
_CERTAIN, _DOUBT = 3.0, 0.1  # chosen
"""Standard deviations that the residual of an inconsistent vector exceeds, and what is added to
each [px]."""
_MIN_SIGMA = 1e-6  # chosen
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
) -> tuple[Array, Array, Array, Array]:
    """Fit the small rotation that minimises the flow's distances from epipolar lines (METHOD 2.6).

    The fit of the camera's motion with the direction of translation known and the rotation about
    only two axes, linear about the measured rotation.

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
    angles, matrix = fit_reweighted(offsets, slopes, allowed, weight, information, _ITERATIONS)
    det = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[0, 1]
    deviations = np.sqrt(np.array([matrix[1, 1] / det, matrix[0, 0] / det]))
    residuals = offsets + slopes[:, 0] * angles[0] + slopes[:, 1] * angles[1]
    return angles, deviations, residuals, allowed


@numba.njit(cache=True)
def weigh_residuals(
    residual: Array, allowed: Array, consistent: Mask, confidence: Array
) -> tuple[Array, Array]:
    """Compute confidence and inconsistency (n,) of vectors from their epipolar residuals.

    A vector is inconsistent with the motion if it is not ``consistent`` and its ``residual`` [px]
    exceeds 3 times its standard deviation ``allowed`` [px], to which 0.1 px is added in quadrature;
    its inconsistency is then its confidence, otherwise 0.
    """
    n = residual.size
    weighted, inconsistency = np.empty(n, np.float64), np.zeros(n, np.float64)
    for i in range(n):
        off = residual[i] / allowed[i]
        if math.isnan(off):
            off = 0.0
        weighted[i] = confidence[i] * math.exp(-((0.5 * off) ** 2)) if consistent[i] else 0.0
        if not consistent[i] and abs(residual[i]) > _CERTAIN * math.hypot(allowed[i], _DOUBT):
            inconsistency[i] = confidence[i]
    return weighted, inconsistency


@dataclass(frozen=True, slots=True)
class RefinementParams:
    """Priors and gates of the correction of the measured rotation.

    ``pitch_sigma`` [rad] is the standard deviation of pitch between frames, ``overlap`` the number
    of neighbouring vectors with a common error, ``direction_sigma`` [rad] the error of the
    translation's direction, ``hole`` [px] the ignored radius around the focus of expansion, and
    ``gate`` the largest epipolar residual of a consistent vector in standard deviations.
    """

    pitch_sigma: float = 0.002
    overlap: float = 4.0
    direction_sigma: float = 0.03
    hole: float = 4.0
    gate: float = 3.0


_USUAL = RefinementParams()


@dataclass(frozen=True, slots=True)
class Refinement:
    """A corrected rotation, and the residuals of the vectors.

    ``motion`` is the measured motion with corrected rotation and ``yaw_sigma``. ``yaw``
    (counter-clockwise) and ``pitch`` (nose down) [rad] are the corrections, ``yaw_sigma`` and
    ``pitch_sigma`` [rad] their posterior standard deviations. ``residual`` (rows, cols) [px] is the
    distance of each corrected vector from its epipolar line, NaN where the line is unknown (near
    the focus of expansion); ``allowed`` (rows, cols) [px] is its standard deviation. ``consistent``
    (rows, cols) is false where the residual exceeds the gate: a moving object or a mismatch.
    """

    motion: CameraMotion
    yaw: float
    pitch: float
    yaw_sigma: float
    pitch_sigma: float
    residual: Array
    consistent: npt.NDArray[np.bool_]
    allowed: Array

    def apply(self, flow: FlowField, camera: CameraModel) -> FlowField:
        """Derotate ``flow`` by the corrected rotation, and reweight it by its epipolar residuals.

        The confidence factor is exp(-(residual / 2 sigma)^2), METHOD 2.9, and 0 beyond the gate.
        The confidence lost beyond the gate becomes the field's ``inconsistency``.
        """
        confidence, inconsistency = weigh_residuals(
            _flat(self.residual),
            _flat(self.allowed),
            np.ascontiguousarray(self.consistent).ravel(),
            _flat(flow.confidence),
        )
        return dataclasses.replace(
            flow,
            vectors=derotated_vectors(flow, self.motion.rotation, camera),
            motion=self.motion,
            confidence=confidence.reshape(flow.shape),
            inconsistency=inconsistency.reshape(flow.shape),
            derotated=True,
        )


def refine(flow: FlowField, camera: CameraModel, params: RefinementParams = _USUAL) -> Refinement:
    """Correct the yaw and pitch of ``flow.motion`` by ``flow`` (not derotated) itself.

    A static point moves along its epipolar line whatever its depth, so the component across the
    line is residual rotation. Robust least squares over all vectors with confidence estimate the
    two small angles, with priors of the standard deviations ``motion.yaw_sigma`` and
    ``params.pitch_sigma``. Without translation or confident vectors the correction is zero.
    """
    p, motion = params, flow.motion
    up, right = camera.base_from_camera[2], np.array([1.0, 0.0, 0.0])
    angles, deviations, *per_vector = refine_rotation(
        _flat(flow.points).reshape(-1, 2),
        _flat(derotated_vectors(flow, motion.rotation, camera)).reshape(-1, 2),
        _flat(flow.sigma),
        _flat(flow.confidence),
        _flat(motion.translation),
        camera.focal,
        # rays rotate opposite to the camera: counter-clockwise yaw turns them clockwise
        np.array([-up, right]),
        np.array([max(motion.yaw_sigma, 1e-9), p.pitch_sigma]),
        (p.hole, p.direction_sigma, p.overlap),
    )
    residual, allowed = (values.reshape(flow.shape) for values in per_vector)
    yaw, pitch = angles.tolist()
    yaw_sigma, pitch_sigma = deviations.tolist()
    rotation = product(rotation_matrix(-yaw * up + pitch * right), motion.rotation)
    return Refinement(
        motion=dataclasses.replace(motion, rotation=rotation, yaw_sigma=yaw_sigma),
        yaw=yaw,
        pitch=pitch,
        yaw_sigma=yaw_sigma,
        pitch_sigma=pitch_sigma,
        residual=residual,
        consistent=~(np.abs(residual) > p.gate * allowed),
        allowed=allowed,
    )


def _flat(values: Array) -> Array:
    """Return ``values`` as a contiguous float64 array (n,), as the kernels need them."""
    return np.ascontiguousarray(values, dtype=np.float64).ravel()
