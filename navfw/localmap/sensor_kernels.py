"""Compiled sensor model of flow: the evidence of one frame for each cell (METHOD 2.11).

Flow measures nearness 1/Z with a Gaussian error, so the error in depth has a long tail. The
evidence of a hit is the probability that the reading lies within the cell: a reading spread over
many cells is evidence for none of them.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics import Array

_PEAK = 1.0 / math.sqrt(2.0 * math.pi)  # defined


@numba.njit(cache=True)
def rays_of(
    points: Array, aside: float, focal: float, base_from_camera: Array, yaw: float
) -> Array:
    """Compute three rays per point (3 N, 3): advance in odom x, y and height per metre of depth.

    The rays go through ``points`` (N, 2) [px] and through points ``aside`` [px] to the left and
    right of them; the robot heads to ``yaw`` [rad, odom].
    """
    n = points.shape[0]
    rays = np.empty((3 * n, 3))
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(3 * n):
        side = (0.0, -aside, aside)[i // n]
        right, down = (points[i % n, 0] + side) / focal, points[i % n, 1] / focal
        ahead = base_from_camera[0, 0] * right + base_from_camera[0, 1] * down
        left = base_from_camera[1, 0] * right + base_from_camera[1, 1] * down
        up = base_from_camera[2, 0] * right + base_from_camera[2, 1] * down
        ahead, left = ahead + base_from_camera[0, 2], left + base_from_camera[1, 2]
        rays[i, 0] = c * ahead - s * left
        rays[i, 1] = s * ahead + c * left
        rays[i, 2] = up + base_from_camera[2, 2]
    return rays


@numba.njit(cache=True)
def cast_evidence(
    hit: Array,
    free: Array,
    log_odds: Array,
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
    """Write the evidence of all rays into the frame's layers ``hit`` and ``free`` (maximum).

    ``direction`` (k N, 3) is the advance in odom x, y and height per metre of depth; ray i measured
    ``nearness`` and ``sigma`` (N,) [1/m] number i modulo N. A ray is free evidence up to one sigma
    before the reading. Around the reading it is hit evidence, by the probability within each cell:
    none below ``nothing``, full from ``everything`` on.

    A ray passes over obstacles lower than itself: its free evidence counts fully below height
    ``low`` and only with weight ``over`` at camera height. Nearer than ``blind``, where the floor
    comes into view, it is none against what ``log_odds`` has as occupied. ``limits`` are (range
    [m], sigmas either side that may be hit, nothing, everything, low [m], over, blind [m]).
    """
    size = hit.shape[0]
    reach, width, nothing, everything, low, over, blind = limits
    for ray in range(direction.shape[0]):
        i = ray % nearness.shape[0]
        dx, dy, dz = direction[ray, 0], direction[ray, 1], direction[ray, 2]
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
                if depth * horizontal < blind and log_odds[row, column] > 0.0:
                    depth += step
                    continue
                height = camera_height + depth * dz
                share = 1.0
                if height >= camera_height:
                    share = over
                elif height > low:
                    share = 1.0 - (1.0 - over) * (height - low) / (camera_height - low)
                free[row, column] = max(free[row, column], free_weight[i] * share)
                depth += step
        if hit_weight[i] > 0.0:
            # at least the cell of the reading itself, however small its sigma
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
                weight = min((share - nothing) / (everything - nothing), 1.0)
                if weight > 0.0:
                    hit[row, column] = max(hit[row, column], hit_weight[i] * weight)
                depth += step


@numba.njit(cache=True)
def merge_evidence(
    log_odds: Array,
    hit: Array,
    free: Array,
    hit_weight: float,
    free_weight: float,
    least: float,
    most: float,
) -> None:
    """Add a frame's layers to ``log_odds``, within [``least``, ``most``], and clear the layers.

    Free evidence is scaled by one minus the hit: an uncertain hit leaves room for rays that pass.
    """
    for i in range(log_odds.shape[0]):
        for j in range(log_odds.shape[1]):
            if hit[i, j] != 0.0 or free[i, j] != 0.0:
                change = hit_weight * hit[i, j] - free_weight * free[i, j] * (1.0 - hit[i, j])
                log_odds[i, j] = min(max(log_odds[i, j] + change, least), most)
                hit[i, j] = free[i, j] = 0.0


@numba.njit(cache=True)
def decay_view(
    log_odds: Array,
    row: float,
    column: float,
    yaw: float,
    slope: float,
    near: float,
    reach: float,
    keep: float,
) -> None:
    """Scale the free evidence within the view by ``keep``, in place.

    The view is a wedge from the camera at (row, column) [cells] along ``yaw`` [rad], ``slope``
    (tangent) to either side, from ``near`` to ``reach`` [cells] ahead. Free floor in view is
    confirmed by every frame; where it is not, a moving object may have entered it.
    """
    size = log_odds.shape[0]
    c, s = math.cos(yaw), math.sin(yaw)
    farthest = reach * math.hypot(1.0, slope)
    top, bottom = max(0, int(row - farthest)), min(size, int(row + farthest) + 2)
    first, end = max(0, int(column - farthest)), min(size, int(column + farthest) + 2)
    for i in range(top, bottom):
        for j in range(first, end):
            if log_odds[i, j] < 0.0:
                ahead = (j - column) * c + (i - row) * s
                aside = (i - row) * c - (j - column) * s
                if near < ahead < reach and abs(aside) <= slope * ahead:
                    log_odds[i, j] *= keep
