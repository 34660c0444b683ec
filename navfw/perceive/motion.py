"""The camera's motion: assumed straight, turned by the gyro, refined by the flow itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navfw.flow.derotation import derotate, rotate_points
from navfw.flow.refinement import Refinement, RefinementParams, refine
from navfw.perceive.gyro import RATES, turn
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, FlowField

__all__ = ["ExpansionFocus", "assumed_motion", "expansion_focus", "forward_share", "refined"]

UNKNOWN_TURN = 0.03
"""Standard deviation of the turn between two images that no gyro has measured [rad]."""
GYRO_SIGMA = 0.005
"""Constant error left in a gyro's rates [rad/s]."""
PITCHING = 0.001
"""Standard deviation of a measured pitching between two images [rad]."""
PASSES = 3
"""The refinement is linear in the turn: large turns need more than one pass."""
_STEP = 1e-4  # rad, of a numerical derivative
_OVERLAP = 4.0  # neighbouring windows overlap and share their errors


def assumed_motion(
    camera: CameraModel, way: float, dt: float, turned: Array, measured: bool
) -> CameraMotion:
    """The camera's motion over ``way`` [m] straight ahead in ``dt`` [s]; backward below 0.

    ``turned`` (3,) [rad] is the turn about base_link's x, y, z: ``measured``, or a guess. Halfway
    through the turn the camera looks where it goes.
    """
    base = camera.base_from_camera
    rotation = base.T @ turn(-turned) @ base
    translation = base.T @ turn(-0.5 * turned) @ np.array([way, 0.0, 0.0])
    sigma = GYRO_SIGMA * dt if measured else UNKNOWN_TURN
    return CameraMotion(rotation, translation, dt, sigma, 0.1 * abs(way))


def refined(flow: FlowField, camera: CameraModel, measured: frozenset[str]) -> Refinement:
    """The rotation that ``flow`` (not derotated) itself shows (METHOD 2.6), roll included.

    ``measured`` names the rates ("yaw_rate", ...) that a gyro told.
    """
    params = RefinementParams(pitch_sigma=PITCHING if "pitch_rate" in measured else UNKNOWN_TURN)
    result: Refinement | None = None
    for _ in range(1 if measured == frozenset(RATES) else PASSES):
        motion = flow.motion if result is None else result.motion
        if "roll_rate" not in measured:
            motion = _without_roll(replace(flow, motion=motion), camera)
        # the same prior again: what the passes add up to is small against it
        motion = replace(motion, yaw_sigma=flow.motion.yaw_sigma)
        result = refine(replace(flow, motion=motion), camera, params)
    assert result is not None  # noqa: S101 - at least one pass
    return result


def _without_roll(flow: FlowField, camera: CameraModel) -> CameraMotion:
    """``flow.motion`` with its turn about the optical axis corrected by the flow itself.

    As ``refine``: what lies across the epipolar lines is rotation. Rolling moves points around the
    focus of expansion, which neither yaw nor pitch can.
    """
    motion = flow.motion
    vectors = derotate(flow, camera).vectors
    past = flow.points - vectors
    lines = flow.points * motion.translation[2] - camera.focal * motion.translation[:2]
    length = np.hypot(lines[..., 0], lines[..., 1])
    normal = np.stack([-lines[..., 1], lines[..., 0]], axis=-1)
    normal /= np.maximum(length, 1e-9)[..., None]
    rolled = rotate_points(past, turn(np.array([0.0, 0.0, _STEP])), camera.focal)
    slope = (normal * (past - rolled)).sum(axis=-1) / _STEP
    offset = (normal * vectors).sum(axis=-1)
    use = (flow.confidence > 0.0) & (length > 4.0 * motion.baseline)
    use &= np.isfinite(slope) & np.isfinite(offset)
    slope, offset = slope[use], offset[use]
    weight = flow.confidence[use] / flow.sigma[use] ** 2 / _OVERLAP
    roll = 0.0
    for _ in range(6):
        # Cauchy weights: an outlier of many sigma counts next to nothing
        off = (offset + slope * roll) / flow.sigma[use]
        robust = weight / (1.0 + off**2 / 4.0)
        total = float((robust * slope * slope).sum()) + 1.0 / UNKNOWN_TURN**2
        roll = -float((robust * slope * offset).sum()) / total
    return replace(motion, rotation=turn(np.array([0.0, 0.0, roll])) @ motion.rotation)


def forward_share(flow: FlowField, focal: float) -> float:
    """Which share of the moving, trusted vectors of derotated ``flow`` fits ``flow.motion``.

    By the sign of their part along the epipolar line; 1 when all do, 0 when all run the other way
    (the camera backs), about 0.5 when the flow has nothing to do with the motion.
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
    """Where derotated flow comes from: ``x``, ``y`` and ``sigma`` [px from the image centre]."""

    x: float
    y: float
    sigma: float


def expansion_focus(flow: FlowField) -> ExpansionFocus | None:
    """The point from which the vectors of derotated ``flow`` point away, or None.

    Robust least squares of the distances of the vectors' lines from the point.
    """
    length = np.hypot(flow.vectors[..., 0], flow.vectors[..., 1])
    use = (flow.confidence > 0.0) & (length > 2.0 * flow.sigma)
    if use.sum() < 8:
        return None
    p, d, size = flow.points[use], flow.vectors[use], length[use]
    normal = np.stack([-d[:, 1], d[:, 0]], axis=1) / size[:, None]
    offset = (normal * p).sum(axis=1)
    # a line's distance from a point at r is off by about r sigma / length
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
