"""What one look says about each cell of the ego map: the sensor model of flow (METHOD 2.11).

Nearness 1/Z is what flow measures, with an error that is Gaussian in nearness and therefore long in
depth. A reading that is spread over many cells says of none of them that it is taken: only what a
cell's own share of the reading is worth counts.
"""

from __future__ import annotations

import math

import numba

from navfw.signals import Array

__all__ = ["cast_evidence", "forget_view"]

_PEAK = 1.0 / math.sqrt(2.0 * math.pi)


@numba.njit(cache=True)
def cast_evidence(
    hit: Array,
    free: Array,
    origin_x: float,
    origin_y: float,
    cell: float,
    camera_x: float,
    camera_y: float,
    camera_height: float,
    direction: Array,
    nearness: Array,
    sigma: Array,
    hit_weight: Array,
    free_weight: Array,
    limits: Array,
) -> None:
    """Enter each ray's evidence into the frame's layers ``hit`` and ``free`` (max, not sum).

    ``direction`` (N, 3): what the ray advances in odom x, y and height per metre of depth;
    ``nearness`` and ``sigma`` (N,) [1/m] of what it met. The ray says free up to where the reading
    begins, one sigma before its middle. Around its middle it says hit, by the share of the reading
    that falls into each cell: nothing below a share of ``nothing``, fully from ``all`` on.

    A ray passes OVER what is lower than itself: its word for free counts fully below height ``low``
    and only ``over`` from the camera's height upwards. ``limits`` are (range [m], sigmas either
    side that may be hit, nothing, all, low [m], over).
    """
    size = hit.shape[0]
    reach, width, nothing, everything, low, over = limits
    for i in range(direction.shape[0]):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        horizontal = math.hypot(dx, dy)
        step = 0.7 * cell / horizontal
        q, s = nearness[i], sigma[i]
        if free_weight[i] > 0.0:
            end = min(1.0 / (q + s), reach)
            depth = step
            while depth < end:
                column = int(math.floor((camera_x + depth * dx - origin_x) / cell + 0.5))
                row = int(math.floor((camera_y + depth * dy - origin_y) / cell + 0.5))
                if row < 0 or column < 0 or row >= size or column >= size:
                    break
                height = camera_height + depth * dz
                share = 1.0
                if height >= camera_height:
                    share = over
                elif height > low:
                    share = 1.0 - (1.0 - over) * (height - low) / (camera_height - low)
                free[row, column] = max(free[row, column], free_weight[i] * share)
                depth += step
        if hit_weight[i] > 0.0:
            # the middle cell is always asked, however sharp the reading
            near = min(1.0 / (q + width * s), 1.0 / q - 0.5 * cell / horizontal)
            far = max(1.0 / max(q - width * s, 0.4 * q), 1.0 / q + 0.5 * cell / horizontal)
            if near > reach:
                continue
            depth = near
            while depth <= far:
                column = int(math.floor((camera_x + depth * dx - origin_x) / cell + 0.5))
                row = int(math.floor((camera_y + depth * dy - origin_y) / cell + 0.5))
                if row < 0 or column < 0 or row >= size or column >= size:
                    break
                off = (1.0 / depth - q) / s
                spread = max(s * depth * depth * horizontal, 0.5 * cell)
                share = _PEAK * math.exp(-0.5 * off * off) * cell / spread
                word = min((share - nothing) / (everything - nothing), 1.0)
                if word > 0.0:
                    hit[row, column] = max(hit[row, column], hit_weight[i] * word)
                depth += step


@numba.njit(cache=True)
def forget_view(
    evidence: Array, row: float, column: float, yaw: float, slope: float, reach: float, keep: float
) -> None:
    """Leave only ``keep`` of what speaks for free floor within view, in place.

    The view is a wedge from the camera at (row, column) [cells] along ``yaw`` [rad], ``slope``
    (tangent) to either side and ``reach`` [cells] deep. What is looked at and free is confirmed by
    every look; what is not may have been walked into by someone.
    """
    size = evidence.shape[0]
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(size):
        for j in range(size):
            if evidence[i, j] < 0.0:
                ahead = (j - column) * c + (i - row) * s
                aside = (i - row) * c - (j - column) * s
                if 0.0 < ahead < reach and abs(aside) <= slope * ahead:
                    evidence[i, j] *= keep
