"""Refining the gyro by the flow: what lies off the epipolar lines is rotation (METHOD 2.6)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.flow.derotation import derotate
from navfw.flow.kernels import fit_rotation
from navfw.kinds import Params
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, FlowField

__all__ = ["Refinement", "RefinementParams", "refine"]

ITERATIONS = 6

CERTAIN, DOUBT = 3.0, 0.1
"""A vector contradicts the motion beyond so many standard deviations, with so much [px] added."""


class RefinementParams(Params):
    """How much the flow may correct the measured rotation."""

    pitch_sigma: Annotated[
        float, Field(gt=0.0, le=0.1, description="pitching of the robot between frames [rad]")
    ] = 0.002
    overlap: Annotated[
        float, Field(ge=1.0, description="number of neighbouring vectors sharing one error")
    ] = 4.0
    direction_sigma: Annotated[
        float, Field(ge=0.0, le=1.0, description="error of the direction of translation [rad]")
    ] = 0.03
    hole: Annotated[
        float, Field(ge=0.0, description="radius around the focus of expansion left out [px]")
    ] = 4.0
    gate: Annotated[
        float, Field(gt=0.0, description="a vector further off its line contradicts [sigma]")
    ] = 3.0


@dataclass(frozen=True, slots=True)
class Refinement:
    """A corrected rotation, and which vectors obey it.

    ``motion`` is the measured motion with its rotation and ``yaw_sigma`` corrected; ``yaw`` and
    ``pitch`` [rad] are the corrections (counter-clockwise; nose down), ``yaw_sigma`` and
    ``pitch_sigma`` [rad] their remaining standard deviations. ``residual`` (rows, cols) [px] is how
    far each vector still lies off its epipolar line, NaN where the line is unknown (focus of
    expansion). ``consistent`` (rows, cols) is false where that is more than its error allows: a
    moving object or a mismatch; ``allowed`` (rows, cols) [px] is one standard deviation of that.
    """

    motion: CameraMotion
    yaw: float
    pitch: float
    yaw_sigma: float
    pitch_sigma: float
    residual: Array
    consistent: npt.NDArray[np.bool_]
    allowed: Array

    @property
    def _contradicts(self) -> npt.NDArray[np.bool_]:
        """Where a vector is off its line by more than any doubt about the flow's own error."""
        doubt = np.hypot(self.allowed, DOUBT)
        return ~self.consistent & (np.abs(self.residual) > CERTAIN * doubt)

    def apply(self, flow: FlowField, camera: CameraModel) -> FlowField:
        """``flow`` derotated by the corrected rotation, trusted less where it contradicts.

        The confidence factor is exp(-(residual / 2 sigma)^2), METHOD 2.9, and 0 beyond the gate:
        there the confidence is that of the contradiction.
        """
        off = np.nan_to_num(self.residual / self.allowed)
        factor = np.where(self.consistent, np.exp(-((0.5 * off) ** 2)), 0.0)
        refined = dataclasses.replace(
            flow,
            motion=self.motion,
            confidence=flow.confidence * factor,
            contradiction=np.where(self._contradicts, flow.confidence, 0.0),
        )
        return derotate(refined, camera)


def refine(
    flow: FlowField, camera: CameraModel, params: RefinementParams | None = None
) -> Refinement:
    """Correct the yaw and pitch of ``flow.motion`` by ``flow`` (not derotated) itself.

    A static point moves along its epipolar line whatever its depth, so what lies across the line is
    rotation left over. Robust least squares over all trusted vectors find the two small angles,
    held to ``motion.yaw_sigma`` and ``params.pitch_sigma`` as priors. Without translation or
    trusted vectors the correction is zero.
    """
    p = RefinementParams() if params is None else params
    motion = flow.motion
    vectors = derotate(flow, camera).vectors
    lines = _epipolar_lines(flow.points, motion.translation, camera.focal, p.hole)
    length = np.hypot(vectors[..., 0], vectors[..., 1])
    allowed = np.hypot(flow.sigma, p.direction_sigma * length)
    up, right = camera.base_from_camera[2], np.array([1.0, 0.0, 0.0])
    priors = np.array([max(motion.yaw_sigma, 1e-9), p.pitch_sigma])
    weight = np.where(np.isfinite(vectors).all(axis=-1), flow.confidence, 0.0) / p.overlap
    angles, covariance, residual = fit_rotation(
        flow.points.reshape(-1, 2),
        np.ascontiguousarray(vectors.reshape(-1, 2)),
        lines.reshape(-1, 2),
        np.ascontiguousarray(allowed.ravel()),
        np.ascontiguousarray(weight.ravel()),
        camera.focal,
        # rays turn against the camera: counter-clockwise yaw turns them clockwise
        np.stack([-up, right]),
        priors,
        ITERATIONS,
    )
    residual = residual.reshape(flow.shape)
    yaw_sigma, pitch_sigma = math.sqrt(covariance[0, 0]), math.sqrt(covariance[1, 1])
    rotation = _rotation(-float(angles[0]) * up + float(angles[1]) * right) @ motion.rotation
    return Refinement(
        motion=dataclasses.replace(motion, rotation=rotation, yaw_sigma=yaw_sigma),
        yaw=float(angles[0]),
        pitch=float(angles[1]),
        yaw_sigma=yaw_sigma,
        pitch_sigma=pitch_sigma,
        residual=residual,
        consistent=~(np.abs(residual) > p.gate * allowed),
        allowed=allowed,
    )


def _epipolar_lines(points: Array, translation: Array, focal: float, hole: float) -> Array:
    """Direction (rows, cols, 2) in which translation moves each point; zero where it is unknown."""
    lines: Array = np.asarray(points * translation[2] - focal * translation[:2])
    length = np.hypot(lines[..., 0], lines[..., 1])
    near_foe = length <= hole * float(np.linalg.norm(translation))
    return np.asarray(np.where(near_foe[..., None], 0.0, lines))


def _rotation(vector: Array) -> Array:
    """(3, 3) rotation about ``vector`` by its length [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross: Array = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-12:
        return np.eye(3) + cross
    a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.eye(3) + a * cross + b * (cross @ cross)
