"""Which vectors nothing at rest can have, in a dense flow field of the lower image.

With the camera's rotation gone, things at rest move away from the focus of expansion, and what
stands on the floor hides it: so they

- never move across that line;
- move at least as fast as the floor they hide;
- are no nearer than the floor right below them, where they stand. What comes towards the camera,
  or goes against its way at its side, grows as if it were. (So does what hangs in the air, below
  the camera's height; nothing tells the one from the other in one look.)

Single vectors must contradict clearly. Where whole patches do, less of it is convincing: mismatches
at the outlines of near things are thin.
"""

from __future__ import annotations

import math

import cv2
import numba
import numpy as np

from navfw.robot import CameraModel
from navfw.signals import Array, FlowField, Mask

__all__ = ["direction_sigma", "segment_motion"]

CERTAIN, DOUBT = 3.0, 0.05
"""A vector contradicts beyond so many standard deviations, with so much [px] added."""
SLIP = 0.05
"""The way driven may be wrong by so much, and the floor's flow with it."""
STANDING = 0.002
"""Baseline [m] below which the camera stands, and nothing at rest shows any flow."""
PATCH_CERTAIN, PATCH_DOUBT, PATCH_AIM = 2.5, 0.1, 0.04
"""Likewise for a patch; the direction of its line is wrong by no more than the third [rad]."""
PATCH = np.ones((3, 3), np.uint8)
"""So many cells have to agree to be a patch: an odd number, or it would be shifted."""
HOLE = 4.0
"""Nearer to the focus of expansion than this [px] lines point anywhere."""
GROWN, GROWN_CERTAIN = 1.1, 3.0
"""Nearer than the floor below by more than this factor, and so many standard deviations."""
FLOORLIKE = 0.2
"""A cell is the floor if its nearness is the floor's but for this share."""


def direction_sigma(baseline: float) -> float:
    """Error [rad] of the direction the camera moved in; large where ``baseline`` [m] is short."""
    return min(0.03 + 0.003 / max(baseline, 1e-4), 1.0)


def segment_motion(flow: FlowField, fall: Array, camera: CameraModel) -> Mask:
    """(rows, cols) cells of ``flow`` (derotated) that contradict a world at rest.

    ``fall`` (rows, cols) is ``navfw.offis.floor.fall_per_depth`` there. ``flow.inconsistency``
    marks vectors off their epipolar lines already (``navfw.flow.refinement``).
    """
    motion = flow.motion
    standing = motion.baseline < STANDING
    field = (
        np.ascontiguousarray(flow.points, dtype=np.float64),
        np.ascontiguousarray(flow.vectors, dtype=np.float64),
        np.ascontiguousarray(flow.sigma, dtype=np.float64),
        np.ascontiguousarray(flow.confidence, dtype=np.float64),
        np.ascontiguousarray(motion.translation, dtype=np.float64),
        camera.focal,
    )
    nearness = np.ascontiguousarray(np.maximum(fall, 0.0) / camera.mount_height)
    aim = direction_sigma(motion.baseline)
    odd = _short(*field, nearness, standing, (float(motion.yaw_sigma), aim))
    if flow.inconsistency is not None:
        odd |= flow.inconsistency > 0.0
    if not standing:
        odd |= _patches(_across(*field))
        odd |= _patches(_grown(*field, nearness))
    return odd


def _patches(odd: Mask) -> Mask:
    """Those of the ``odd`` cells (rows, cols) that lie in whole patches."""
    opened = cv2.morphologyEx(odd.view(np.uint8), cv2.MORPH_OPEN, PATCH)
    return np.asarray(opened).view(np.bool_)


@numba.njit(cache=True)
def _lever(point: Array, translation: Array, focal: float) -> tuple[float, float, float]:
    """Unit vector away from the focus of expansion, and how far a near thing moves [px m]."""
    x = point[0] * translation[2] - focal * translation[0]
    y = point[1] * translation[2] - focal * translation[1]
    length = max(math.hypot(x, y), 1e-9)
    return x / length, y / length, length


@numba.njit(cache=True)
def _short(
    points: Array,
    vectors: Array,
    sigma: Array,
    confidence: Array,
    translation: Array,
    focal: float,
    floor: Array,
    standing: bool,
    astray: tuple[float, float],
) -> Mask:
    """(rows, cols) which trusted vectors fall short of those of a floor of that nearness [1/m].

    ``astray`` are the errors of the yaw and of the direction driven [rad]. While ``standing`` any
    vector does that is not explained by the yaw's error.
    """
    yaw_sigma, direction = astray
    odd = np.zeros(sigma.shape, np.bool_)
    for r, c in np.ndindex(sigma.shape):
        if not confidence[r, c] > 0.0:
            continue
        u, v = vectors[r, c, 0], vectors[r, c, 1]
        length = math.hypot(u, v)
        if standing:
            turning = yaw_sigma * (focal + points[r, c, 0] * points[r, c, 0] / focal)
            odd[r, c] = length > CERTAIN * (math.hypot(sigma[r, c], turning) + 2.0 * DOUBT)
            continue
        near = floor[r, c]
        if not near > 0.0:
            continue
        ex, ey, lever = _lever(points[r, c], translation, focal)
        least = lever * near / (1.0 + translation[2] * near)
        unsure = math.hypot(sigma[r, c], direction * (length - least)) + DOUBT
        odd[r, c] = ex * u + ey * v < least * (1.0 - SLIP) - CERTAIN * unsure
    return odd


@numba.njit(cache=True)
def _across(
    points: Array,
    vectors: Array,
    sigma: Array,
    confidence: Array,
    translation: Array,
    focal: float,
) -> Mask:
    """(rows, cols) which trusted vectors lead across their lines, if a patch of them do."""
    nearest = HOLE * math.sqrt(np.sum(translation * translation))
    odd = np.zeros(sigma.shape, np.bool_)
    for r, c in np.ndindex(sigma.shape):
        if not confidence[r, c] > 0.0:
            continue
        ex, ey, lever = _lever(points[r, c], translation, focal)
        if lever <= nearest:
            continue
        u, v = vectors[r, c, 0], vectors[r, c, 1]
        allowed = math.hypot(sigma[r, c], PATCH_AIM * math.hypot(u, v))
        odd[r, c] = abs(ex * v - ey * u) > PATCH_CERTAIN * math.hypot(allowed, PATCH_DOUBT)
    return odd


@numba.njit(cache=True)
def _grown(
    points: Array,
    vectors: Array,
    sigma: Array,
    confidence: Array,
    translation: Array,
    focal: float,
    floor: Array,
) -> Mask:
    """(rows, cols) what seems nearer [1/m] than the ``floor`` below it, up every column.

    A cell of the floor may be half hidden: what stands may stand one row nearer than the farthest.
    """
    rows, cols = sigma.shape
    odd = np.zeros((rows, cols), np.bool_)
    for c in range(cols):
        stands = np.inf
        for r in range(rows - 1, -1, -1):
            if not confidence[r, c] > 0.0:
                continue
            ex, ey, lever = _lever(points[r, c], translation, focal)
            along = ex * vectors[r, c, 0] + ey * vectors[r, c, 1]
            nearness = along / max(lever - translation[2] * along, 1e-9)
            unsure = math.hypot(sigma[r, c], SLIP * along) / lever
            like = max(FLOORLIKE * floor[r, c], 2.0 * unsure)
            if floor[r, c] > 0.0 and abs(nearness - floor[r, c]) < like:
                stands = floor[min(r + 1, rows - 1), c]
            else:
                odd[r, c] = nearness - GROWN_CERTAIN * unsure > GROWN * stands
    return odd
