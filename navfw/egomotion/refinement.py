"""Refinement of the gyro's rotation by the flow's epipolar residuals (METHOD 2.6)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.camera_geometry.rotations import derotated_vectors, rotation_matrix
from navfw.egomotion.refinement_kernels import refine_rotation, weigh_residuals
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

_ITERATIONS = 6

_CERTAIN, _DOUBT = 3.0, 0.1
"""A vector is inconsistent with the motion if its epipolar residual exceeds _CERTAIN standard
deviations, to which _DOUBT [px] is added in quadrature."""


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
        """``flow`` derotated by the corrected rotation and reweighted by its epipolar residuals.

        The confidence factor is exp(-(residual / 2 sigma)^2), METHOD 2.9, and 0 beyond the gate.
        The confidence that is lost there becomes the field's ``inconsistency``.
        """
        confidence, inconsistency = weigh_residuals(
            _flat(self.residual),
            _flat(self.allowed),
            np.ascontiguousarray(self.consistent).ravel(),
            _flat(flow.confidence),
            _CERTAIN,
            _DOUBT,
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
        _ITERATIONS,
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
    """``values`` as a contiguous float64 array (n,), as the kernels need them."""
    return np.ascontiguousarray(values, dtype=np.float64).ravel()
