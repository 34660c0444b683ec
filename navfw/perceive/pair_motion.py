"""The camera's motion between two images: straight ahead, rotation by gyro or by the flow."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navfw.flow.derotation import derotate, rotate_points
from navfw.flow.refinement import Refinement, RefinementParams, refine
from navfw.perceive.gyro_columns import RATES
from navfw.perceive.gyro_record import rotation_from_vector
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, FlowField

__all__ = [
    "ExpansionFocus",
    "assumed_motion",
    "estimate_rotation",
    "expansion_focus",
    "forward_share",
]

UNKNOWN_TURN = 0.03
"""Standard deviation of the rotation between two images without a gyro [rad], per axis."""
GYRO_SIGMA = 0.005
"""Standard deviation of the constant error of a gyro's rates [rad/s]."""
PITCHING = 0.002
"""Standard deviation of the unmodelled pitch between two images [rad]."""
PASSES = 3
"""Iterations of the fit of the rotation: it is linearised, so large rotations need several."""
_AFTER_FIT = 0.003  # rad, standard deviation of the yaw after the fit
_NONE = np.zeros(3)
_AXES = {
    "roll_rate": np.array([1.0, 0.0, 0.0]),
    "pitch_rate": np.array([0.0, 1.0, 0.0]),
    "yaw_rate": np.array([0.0, 0.0, 1.0]),
}
_STEP = 1e-4  # rad, of a numerical derivative
_OVERLAP = 4.0  # number of vectors with a common error: neighbouring windows overlap


def assumed_motion(
    camera: CameraModel, way: float, dt: float, rotation_vector: Array, measured: bool
) -> CameraMotion:
    """Motion of a camera that travels ``way`` [m] straight ahead (backward below 0) in ``dt`` [s].

    ``rotation_vector`` (3,) [rad] is the rotation about base_link's x, y, z, ``measured`` by a gyro
    or predicted. The translation points along the optical axis as it is halfway through the turn.
    """
    base = camera.base_from_camera
    rotation = base.T @ rotation_from_vector(-rotation_vector) @ base
    translation = base.T @ rotation_from_vector(-0.5 * rotation_vector) @ np.array([way, 0.0, 0.0])
    sigma = GYRO_SIGMA * dt if measured else UNKNOWN_TURN
    return CameraMotion(rotation, translation, dt, sigma, 0.1 * abs(way))


def estimate_rotation(flow: FlowField, camera: CameraModel, measured: frozenset[str]) -> Refinement:
    """Rotation estimated from ``flow`` (not derotated), roll included (METHOD 2.6).

    ``measured`` names the rates ("yaw_rate", ...) that a gyro measured. The other axes are
    estimated first, all together; yaw and pitch are then refined as on the robot.
    """
    missing = [axis for axis in RATES if axis not in measured]
    motion = flow.motion
    for _ in range(PASSES if missing else 0):
        motion = _fit_rotation(replace(flow, motion=motion), camera, missing)
    return refine(replace(flow, motion=motion), camera, RefinementParams(pitch_sigma=PITCHING))


def _fit_rotation(flow: FlowField, camera: CameraModel, missing: list[str]) -> CameraMotion:
    """``flow.motion`` with the rotation about the ``missing`` axes fitted to the flow.

    As in ``refine``, the component across the epipolar lines is residual rotation. The robust least
    squares take the spread of the residuals as their scale, since residuals are large until the
    rotation is known.
    """
    motion = flow.motion
    vectors = derotate(flow, camera).vectors
    past = flow.points - vectors
    lines = flow.points * motion.translation[2] - camera.focal * motion.translation[:2]
    length = np.hypot(lines[..., 0], lines[..., 1])
    normal = np.stack([-lines[..., 1], lines[..., 0]], axis=-1)
    normal /= np.maximum(length, 1e-9)[..., None]
    slopes = []
    for name in missing:
        step = rotation_from_vector(_STEP * camera.base_from_camera.T @ -_AXES[name])
        moved = rotate_points(past, step, camera.focal)
        slopes.append((normal * (moved - past)).sum(axis=-1) / _STEP)
    offset = (normal * vectors).sum(axis=-1)
    use = (flow.confidence > 0.0) & (length > 4.0 * motion.baseline) & np.isfinite(offset)
    slope, offset, sigma = np.stack(slopes, axis=-1)[use], offset[use], flow.sigma[use]
    weight = flow.confidence[use] / sigma**2 / _OVERLAP
    angles = np.zeros(len(missing))
    for _ in range(8):
        off = (offset - slope @ angles) / sigma
        scale = max(1.0, float(np.median(np.abs(off))) / 0.67) if off.size else 1.0
        # Cauchy weights: an outlier of many times the spread has next to no weight
        robust = weight / scale**2 / (1.0 + (off / (2.4 * scale)) ** 2)
        matrix = (slope * robust[:, None]).T @ slope + np.eye(len(missing)) / UNKNOWN_TURN**2
        angles = np.linalg.solve(matrix, (slope * robust[:, None]).T @ offset)
    body = sum((angle * _AXES[name] for angle, name in zip(angles, missing, strict=True)), _NONE)
    rotation = rotation_from_vector(camera.base_from_camera.T @ -body) @ motion.rotation
    # the remaining error is small and left to the refinement
    return replace(motion, rotation=rotation, yaw_sigma=_AFTER_FIT)


def forward_share(flow: FlowField, focal: float) -> float:
    """Share of the significant vectors of derotated ``flow`` that agree with ``flow.motion``.

    The sign of the component along the epipolar line decides. The share is 1 if all vectors agree,
    0 if all are opposite (the camera moves backward), and about 0.5 if flow and motion are
    unrelated.
    """
    shift = flow.motion.translation
    lines = flow.points * shift[2] - focal * shift[:2]
    along = (flow.vectors * lines).sum(axis=-1)
    along /= np.maximum(np.hypot(lines[..., 0], lines[..., 1]), 1e-12)
    moving = (flow.confidence > 0.0) & (np.abs(along) > 2.0 * flow.sigma)
    weight = flow.confidence * moving
    total = float(weight.sum())
    return float(weight[along > 0.0].sum()) / total if total > 0.0 else 1.0


@dataclass(frozen=True, slots=True)
class ExpansionFocus:
    """Focus of expansion: ``x``, ``y`` [px from the image centre] and their ``sigma`` [px]."""

    x: float
    y: float
    sigma: float


def expansion_focus(flow: FlowField) -> ExpansionFocus | None:
    """Focus of expansion of derotated ``flow``; None if it is not determined.

    The point minimises the distances to the vectors' lines in robust least squares.
    """
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    use = (flow.confidence > 0.0) & (length > 2.0 * flow.sigma)
    if use.sum() < 8:
        return None
    p, d, size = flow.points[use], flow.vectors[use], length[use]
    normal = np.stack([-d[:, 1], d[:, 0]], axis=1) / size[:, None]
    offset = (normal * p).sum(axis=1)
    # the standard deviation of a line's distance from a point at r is about r sigma / length
    reach = np.maximum(np.hypot(p[:, 0], p[:, 1]), 10.0)
    spread = reach * flow.sigma[use] / size
    weight = flow.confidence[use] / spread**2
    focus = np.zeros(2)
    matrix = np.eye(2)
    for _ in range(8):
        off = normal @ focus - offset
        robust = weight / np.maximum(1.0, np.abs(off) / (1.5 * spread))
        matrix = (normal * robust[:, None]).T @ normal
        if np.linalg.cond(matrix) > 1e3:
            return None
        focus = np.linalg.solve(matrix, (normal * robust[:, None]).T @ offset)
    off = normal @ focus - offset
    scale = max(1.0, float(np.median(np.abs(off) / spread)) / 0.67)
    sigma = scale * math.sqrt(float(np.linalg.eigvalsh(np.linalg.inv(matrix)).max()))
    return ExpansionFocus(float(focus[0]), float(focus[1]), sigma)
