"""Stixels from dense flow: the nearest upright obstacle in each image column (thin poles, too).

In flow aligned with the floor (``navfw.flow.floor_aligned``) a column that shows an upright
obstacle has one parameter: below the foot point the flow is the floor's, above it is that of one
distance (stixels: Badino, Franke and Pfeiffer 2009, there from stereo). So whole columns are
fitted, over a set of candidate distances. This finds poles a few cells wide, which a 24 px window
mixes with their background, also straight ahead, where single vectors are short: the pole still
moves faster than the floor that it hides.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.movers.motion_segmentation import epipolar, yaw_flow
from navfw.numerics import Array
from navfw.robot import CameraModel
from navfw.signals import FlowField, Stixels

_MAX_PITCH = 0.15  # chosen
"""Pitch [rad] of the camera beyond which upright edges cross image columns."""
_NEARNESS = np.array([0.3 * (5.0 / 0.3) ** (k / 56) for k in range(57)])  # chosen
"""Candidates of nearness [1/m, ahead of the camera] that every column is fitted with."""
_FARTHER = 0.7  # chosen
"""The fit is compared with the best candidate of at most this share of its nearness."""
_OUTLIER = 9.0  # chosen
"""Bound of one cell's squared residual: three standard deviations."""
_MODEL_SIGMA = 0.1  # chosen
"""Model error of a cell [px] beside its flow's sigma: uneven floor, cells with two depths."""
_MIN_CELLS = 5  # chosen
"""Least number of valid cells in a column that is fitted."""
_GAIN_RANGE = 6.0, 14.0  # chosen
"""Gain of the fit [sigma^2] at which confidence begins to rise from 0, and where it reaches 1."""
_MAX_DIFFERENCE = 0.2  # chosen
"""Largest relative difference in nearness of neighbouring columns that support each other."""
_RELATIVE_SIGMA = 0.08  # measured
"""Relative sigma of nearness, measured against the floor plan in rendered drives."""
_MIN_BASELINE = 0.03  # chosen
"""Baseline [m] below which flow gives no usable distances."""


def find_stixels(flow: FlowField, camera: CameraModel) -> Stixels | None:
    """Fit a stixel to each column of ``flow`` (derotated, dense, floor-aligned).

    Returns None for a baseline below 0.03 m or a camera pitched by over 0.15 rad. Raises ValueError
    if ``flow`` is not marked as derotated.
    """
    if not flow.derotated:
        raise ValueError("stixels need derotated flow (navfw.camera_geometry.rotations)")
    motion = flow.motion
    if motion.baseline < _MIN_BASELINE or abs(camera.pitch) > _MAX_PITCH:
        return None
    fall = camera.fall_per_depth(flow.points)
    ahead = math.cos(camera.pitch) - flow.points[..., 1] / camera.focal * math.sin(camera.pitch)
    nearness, gain = _columns(
        np.ascontiguousarray(flow.points, dtype=np.float64),
        np.ascontiguousarray(flow.vectors, dtype=np.float64),
        np.ascontiguousarray(flow.sigma, dtype=np.float64),
        np.ascontiguousarray(flow.confidence, dtype=np.float64),
        np.maximum(fall, 0.0) / camera.mount_height,
        ahead,
        np.ascontiguousarray(motion.translation, dtype=np.float64),
        camera.focal,
        float(motion.yaw_sigma),
        _NEARNESS,
    )
    low, high = _GAIN_RANGE
    confidence = np.clip((gain - low) / (high - low), 0.0, 1.0)
    confidence[~_supported(nearness, gain)] = 0.0
    return Stixels(
        time=flow.time,
        slope=-flow.points[0, :, 0] / camera.focal * math.cos(camera.pitch),
        nearness=nearness,
        sigma=np.hypot(
            _RELATIVE_SIGMA * nearness, motion.translation_sigma / motion.baseline * nearness
        ),
        confidence=confidence,
    )


def _supported(nearness: Array, gain: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which columns (n,) have a neighbour of similar nearness and some gain."""
    alike = np.abs(np.diff(nearness)) < _MAX_DIFFERENCE * np.minimum(nearness[1:], nearness[:-1])
    alike &= np.minimum(gain[1:], gain[:-1]) > 0.5 * _GAIN_RANGE[0]
    supported = np.zeros(nearness.size, np.bool_)
    supported[1:] |= alike
    supported[:-1] |= alike
    return supported


@numba.njit(cache=True)
def _columns(
    points: Array,
    vectors: Array,
    sigma: Array,
    confidence: Array,
    floor: Array,
    ahead: Array,
    translation: Array,
    focal: float,
    yaw_sigma: float,
    candidates: Array,
) -> tuple[Array, Array]:
    """Nearness (cols,) [1/m] of the candidate that fits each column best, and its gain [sigma^2].

    ``floor`` (rows, cols) [1/m] is the nearness of the empty floor, ``ahead`` (rows, cols) the
    advance of a ray ahead per metre of depth. The gain is over the best of the farther candidates.
    """
    rows, cols = sigma.shape
    tz = translation[2]
    best, gain = np.zeros(cols), np.zeros(cols)
    cost = np.empty(candidates.size)
    for j in range(cols):
        cost[:] = 0.0
        cells = 0
        for i in range(rows):
            if not confidence[i, j] > 0.0:
                continue
            x, y = points[i, j, 0], points[i, j, 1]
            away_x, away_y, lever = epipolar(x, y, translation, focal)
            if lever <= 1e-9:
                continue
            cells += 1
            along = vectors[i, j, 0] * away_x + vectors[i, j, 1] * away_y
            turning = yaw_sigma * yaw_flow(x, y, away_x, away_y, focal)
            variance = sigma[i, j] ** 2 + turning**2 + _MODEL_SIGMA**2
            for k in range(candidates.size):
                q = max(candidates[k] * ahead[i, j], floor[i, j])
                off = along - lever * q / (1.0 + tz * q)
                cost[k] += min(off * off / variance, _OUTLIER)
        if cells < _MIN_CELLS:
            continue
        chosen = int(np.argmin(cost))
        best[j] = candidates[chosen]
        farther = math.inf
        for k in range(chosen):
            if candidates[k] < _FARTHER * candidates[chosen]:
                farther = min(farther, cost[k])
        if farther < math.inf:
            gain[j] = farther - cost[chosen]
    return best, gain
