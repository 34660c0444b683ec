"""Motion segmentation: flow vectors that no static point can have, in dense lower-image flow.

Once the camera's rotation is removed, the image of a static point moves away from the focus of
expansion, and a point above the floor hides it. So the flow of a static point

- never crosses its epipolar line;
- is at least as long as that of the floor behind it;
- gives no larger nearness than the floor right below it, where it stands. An object that approaches
  seems nearer. (So does one that hangs below the camera's height: a single pair cannot tell.)

Single vectors need a large residual. Patches of vectors need less: mismatches at the outlines of
near obstacles are thin.
Those high above the horizon show what approaches on a constant bearing, too (``crossing_cells``).
"""

from __future__ import annotations

import math

import cv2
import numba
import numpy as np

from navfw.camera_geometry.rotations import turning_slope
from navfw.numerics import Array, Mask
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

_GATE, _GATE_SIGMA = 3.0, 0.05  # chosen
"""Residual of a single vector from which it is moving [sigma], and the sigma [px] added to its
own."""
_SLIP, _SEEN_SLIP = 0.05, 0.015  # chosen
"""Relative error of the distance driven by the wheels, and so of the floor's flow; and that left
where the floor's own flow confirms the distance."""
_FLOOR_CELLS, _FLOOR_FLOW = 40, 3.0  # chosen
"""Least number of floor cells that confirm the distance, each with at least this flow [px]."""
_MIN_BASELINE = 0.002  # chosen
"""Baseline [m] below which the camera counts as standing: static points then have no flow."""
_PATCH_GATE, _PATCH_SIGMA = 2.5, 0.1  # chosen
"""Residual of a patch from which it is moving [sigma], and the sigma [px] added to its own."""
_PATCH, _PATCH_CELLS = np.ones((3, 3), np.uint8), 7  # chosen
"""Structuring element of a patch (sides are odd, or the result would be shifted), and the number of
its cells that are moving at least: some have no match."""
_FOE_RADIUS = 4.0  # chosen
"""Distance from the focus of expansion [px] within which epipolar directions are undefined."""
_NEARER, _NEARER_GATE = 1.25, 3.0  # chosen
"""Factor on the nearness of the floor below, and sigmas, from which a cell cannot stand there; the
factor is beyond _FLOOR_TOLERANCE, within which the lowest cells of an object pass for floor."""
_FLOOR_TOLERANCE = 0.2  # chosen
"""Relative difference from the floor's nearness up to which a cell is the floor."""
_COLUMN_CELLS, _COLUMN_GATE, _COLUMNS_GATE = 3, 2.0, 5.0  # chosen
"""Least number of cells of a column above the horizon (two cannot disagree enough), and deviations
of a column, and of adjacent ones together, from which their cells cross epipolar lines [sigma]."""
_VERTICAL = np.array([0.0, 1.0, 0.0])  # defined
"""The axis of yaw, in the axes of a level camera."""


def direction_sigma(motion: CameraMotion) -> float:
    """Return the sigma [rad] of the camera's direction of motion; large for a short baseline."""
    baseline = max(motion.baseline, 1e-4)
    return min(math.hypot(0.03 + 0.003 / baseline, motion.skid_sigma / baseline), 1.0)


def segment_motion(flow: FlowField, fall: Array, camera: CameraModel) -> tuple[Mask, Array]:
    """Mark the cells (rows, cols) of ``flow`` (derotated) that no static point can explain.

    ``fall`` (rows, cols) is ``camera.fall_per_depth`` of its points. Vectors that the refinement
    marked in ``flow.inconsistency``, being off their epipolar lines, are marked too. The
    second array is the nearness (cols,) [1/m] of the farthest floor seen in a column, or 0.
    """
    motion = flow.motion
    standing = motion.baseline < _MIN_BASELINE
    skid = float(motion.skid_sigma / max(motion.baseline, _MIN_BASELINE))
    moving, crossing, nearer, foot = _suspects(
        np.ascontiguousarray(flow.points, dtype=np.float64),
        np.ascontiguousarray(flow.vectors, dtype=np.float64),
        np.ascontiguousarray(flow.sigma, dtype=np.float64),
        np.ascontiguousarray(flow.confidence, dtype=np.float64),
        np.ascontiguousarray(motion.translation, dtype=np.float64),
        camera.focal,
        np.ascontiguousarray(np.maximum(fall, 0.0) / camera.mount_height),
        standing,
        (float(motion.yaw_sigma), direction_sigma(motion), skid),
    )
    if flow.inconsistency is not None:
        moving |= flow.inconsistency > 0.0
    if not standing:
        moving |= _patches(crossing) | _patches(nearer)
    return moving, foot


def _patches(moving: Mask) -> Mask:
    """Return those of the ``moving`` cells (rows, cols) that fill patches, but for a few."""
    cells = moving.view(np.uint8)
    # on arm64, filter2D of OpenCV 5.0 counts wrong
    count = cv2.boxFilter(cells, -1, _PATCH.shape, normalize=False, borderType=cv2.BORDER_CONSTANT)
    patches = cv2.dilate((np.asarray(count) >= _PATCH_CELLS).view(np.uint8), _PATCH)
    return np.asarray(patches).view(np.bool_) & moving


def crossing_cells(flow: FlowField, camera: CameraModel) -> list[tuple[Mask, Mask]]:
    """Find the bodies that cross in the ``flow`` (derotated) of the whole image.

    What moves sideways shifts columns: above the horizon their vectors cross their epipolar lines
    in proportion to their height. So what approaches on a constant bearing, and hardly moves in the
    image, shows by its expansion. Returns the cells (rows, cols) and columns (cols,) of each body.
    """
    odd = 0.0 if flow.inconsistency is None else flow.inconsistency
    t, (u, v) = flow.motion.translation, np.moveaxis(flow.vectors, -1, 0)
    x, y = np.moveaxis(flow.points * t[2] - camera.focal * t[:2], -1, 0)
    lever = np.hypot(x, y)
    shown = (flow.confidence + odd > 0.0) & (camera.fall_per_depth(flow.points) < 0.0)
    shown &= lever > _FOE_RADIUS * flow.motion.baseline
    error = np.hypot(flow.sigma, direction_sigma(flow.motion) * np.hypot(u, v))
    weight = shown / ((error**2 + _PATCH_SIGMA**2) * np.maximum(lever, 1e-9) ** 2)
    count, across = np.count_nonzero(shown, axis=0), y * u - x * v
    information = np.sum(weight * y**2, axis=0)
    shift = np.sum(weight * y * across, axis=0) / np.sqrt(np.maximum(information, 1e-9))
    unexplained = np.sum(weight * across**2, axis=0) - shift**2  # mismatches share no shift
    shift /= np.sqrt(np.maximum(unexplained / np.maximum(count - 1, 1), 1.0))
    shift[count < _COLUMN_CELLS] = 0.0
    side = np.where(np.abs(shift) > _COLUMN_GATE, np.sign(shift), 0.0)
    bodies = np.cumsum(np.diff(side, prepend=0.0) != 0.0)
    together = np.bincount(bodies, np.abs(side) * shift**2) > _COLUMNS_GATE**2
    return [(shown & (bodies == body), bodies == body) for body in np.flatnonzero(together)]


@numba.njit(cache=True)
def epipolar(x: float, y: float, translation: Array, focal: float) -> tuple[float, float, float]:
    """Return at (x, y) [px] the unit vector away from the FOE, and flow times depth [px m]."""
    ex = x * translation[2] - focal * translation[0]
    ey = y * translation[2] - focal * translation[1]
    lever = max(math.hypot(ex, ey), 1e-9)
    return ex / lever, ey / lever, lever


@numba.njit(cache=True)
def yaw_flow(x: float, y: float, ex: float, ey: float, focal: float) -> float:
    """Return the motion [px/rad] along (ex, ey) of the image point (x, y) as the camera yaws."""
    u, v = turning_slope(x, y, _VERTICAL, focal)
    return float(u * ex + v * ey)


@numba.njit(cache=True)
def _nearness(along: float, lever: float, translation: Array) -> float:
    """Nearness [1/m] of a static point whose flow along its epipolar line is ``along`` [px]."""
    return float(along / max(lever - translation[2] * along, 1e-9))


@numba.njit(cache=True)
def _suspects(
    points: Array,
    vectors: Array,
    sigma: Array,
    confidence: Array,
    translation: Array,
    focal: float,
    floor: Array,
    standing: bool,
    sigmas: tuple[float, float, float],
) -> tuple[Mask, Mask, Mask, Array]:
    """Masks (rows, cols) of valid vectors: short ones, and for patches crossing and nearer ones.

    Short: below those of a floor of the nearness ``floor`` [1/m]; while ``standing``, all that the
    error of the yaw does not explain, and the other masks are empty. Crossing: across the epipolar
    line. Nearer: of larger nearness than the next floor down the column; as the farthest floor cell
    of a column may be half hidden, that of one row below it; last: of the farthest one (cols,).
    ``sigmas``: of yaw and direction [rad], and of the displacement's sideways share.
    """
    yaw_sigma, direction, skid = sigmas
    rows, cols = sigma.shape
    ratio = math.inf  # a camera that stands tells none
    if not standing:
        ratio = _floor_ratio(points, vectors, confidence, translation, focal, floor)
    slip = math.hypot(min(max(abs(ratio - 1.0), _SEEN_SLIP), _SLIP), skid)
    short = np.zeros((rows, cols), np.bool_)
    crossing, nearer, foot = np.zeros_like(short), np.zeros_like(short), np.zeros(cols)
    foe_radius = _FOE_RADIUS * math.sqrt(np.sum(translation * translation))
    for c in range(cols):
        stands = np.inf
        for r in range(rows - 1, -1, -1):
            if not confidence[r, c] > 0.0:
                continue
            (x, y), (u, v) = points[r, c], vectors[r, c]
            length = math.hypot(u, v)
            if standing:
                off = math.hypot(sigma[r, c], yaw_sigma * (focal + x * x / focal))
                short[r, c] = length > _GATE * (off + 2.0 * _GATE_SIGMA)
                continue
            ex, ey, lever = epipolar(x, y, translation, focal)
            along, near = ex * u + ey * v, floor[r, c]
            if near > 0.0:
                least = lever * near / (1.0 + translation[2] * near)
                allowed = math.hypot(sigma[r, c], direction * (length - least)) + _GATE_SIGMA
                short[r, c] = along < least * (1.0 - slip) - _GATE * allowed
            if lever > foe_radius:
                allowed = math.hypot(sigma[r, c], direction * length)
                gate = _PATCH_GATE * math.hypot(allowed, _PATCH_SIGMA)
                crossing[r, c] = abs(ex * v - ey * u) > gate
            nearness = _nearness(along, lever, translation)
            turning = yaw_sigma * yaw_flow(x, y, ex, ey, focal)
            error = math.hypot(math.hypot(sigma[r, c], slip * along), turning)
            nearness_sigma = error / lever
            like = max(_FLOOR_TOLERANCE * near, 2.0 * nearness_sigma)
            if near > 0.0 and abs(nearness - near) < like:
                stands = floor[min(r + 1, rows - 1), c]
                foot[c] = near
            else:
                nearer[r, c] = nearness - _NEARER_GATE * nearness_sigma > _NEARER * stands
    return short, crossing, nearer, foot


@numba.njit(cache=True)
def _floor_ratio(
    points: Array, vectors: Array, confidence: Array, translation: Array, focal: float, floor: Array
) -> float:
    """Mean ratio of the floor's nearness by flow to ``floor``; infinite if too little is seen."""
    count, total = 0, 0.0
    for r in range(floor.shape[0]):
        for c in range(floor.shape[1]):
            if not (confidence[r, c] > 0.0 and floor[r, c] > 0.0):
                continue
            ex, ey, lever = epipolar(points[r, c, 0], points[r, c, 1], translation, focal)
            if lever * floor[r, c] < _FLOOR_FLOW:
                continue
            along = ex * vectors[r, c, 0] + ey * vectors[r, c, 1]
            ratio = _nearness(along, lever, translation) / floor[r, c]
            if abs(ratio - 1.0) < _FLOOR_TOLERANCE:
                count += 1
                total += ratio
    return total / count if count >= _FLOOR_CELLS else math.inf
