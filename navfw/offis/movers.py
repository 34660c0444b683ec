"""What moves by itself: vectors that contradict the camera's motion, and where they stand.

Triangulation is wrong for what moves; where its lowest part meets the floor is not. A point on the
floor at image row y (below the horizon) is ``h / g`` away along the optical axis, ``g`` being the
fall of its ray per metre of depth (``navfw.offis.floor``).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from navfw.offis.floor import fall_per_depth
from navfw.robot import CameraModel
from navfw.signals import Array, Mover

__all__ = ["find_movers"]

CONFIDENT = 0.3
"""Confidence of a contradiction that counts."""
LEAST_CELLS = 4
"""Fewer cells together than these are mismatches."""
NEAREST_FALL = 0.12
"""Fall per metre of a ray that tells where a thing stands; flatter ones end too far away."""

Indices = npt.NDArray[np.int64]

_TOUCHING = np.ones((3, 3), dtype=bool)


def find_movers(points: Array, contradiction: Array, camera: CameraModel) -> tuple[Mover, ...]:
    """Regions of contradicting cells, as movers; left to right.

    Cells one above the other belong together even across rows that do not contradict: along its
    epipolar line, beside the focus of expansion, a mover looks like something nearer or farther.
    """
    odd = contradiction >= CONFIDENT
    if np.count_nonzero(odd) < LEAST_CELLS:
        return ()
    regions, count = ndimage.label(odd, _TOUCHING)
    sizes = np.bincount(regions.ravel(), minlength=count + 1)
    kept = odd & (sizes[regions] >= LEAST_CELLS)
    lowest = np.where(kept.any(axis=0), len(odd) - 1 - kept[::-1].argmax(axis=0), -1)
    columns, groups = ndimage.label(lowest >= 0)
    movers = []
    for group in range(1, groups + 1):
        own = np.nonzero(columns == group)[0]
        mover = _mover(points, lowest[own], own, camera)
        if mover is not None:
            movers.append(mover)
    return tuple(movers)


def _mover(points: Array, lowest: Indices, columns: Indices, camera: CameraModel) -> Mover | None:
    """The mover in these ``columns``, whose ``lowest`` rows are given; None if it may be far."""
    feet = points[lowest, columns]
    fall = float(np.quantile(fall_per_depth(feet, camera), 0.75))
    if fall < NEAREST_FALL:
        return None
    depth = camera.mount_height / fall
    half_cell = 0.5 * abs(points[0, 1, 0] - points[0, 0, 0])
    left, right = feet[:, 0].min() - half_cell, feet[:, 0].max() + half_cell
    bearings = math.atan2(-left, camera.focal), math.atan2(-right, camera.focal)
    bearing, width = 0.5 * sum(bearings), 0.5 * (bearings[0] - bearings[1])
    return Mover(bearing, width, depth / math.cos(bearing))
