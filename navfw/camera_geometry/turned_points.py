"""Image points of a camera that turns, compiled.

Points are in pixels relative to the principal point. A rotation (3, 3) turns the rays: with
``CameraMotion.rotation`` points of the past image come to where they are in current axes.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array

BEHIND = 1e-9
"""Depth of a turned ray, in focal lengths, up to which it has no image."""


@numba.njit(cache=True, error_model="numpy")
def turn_point(x: float, y: float, r: Array, focal: float) -> tuple[float, float]:
    """The image point (x, y) [px] after its ray is rotated by ``r`` (3, 3).

    NaN where the rotated ray points behind the camera.
    """
    depth = (r[2, 0] * x + r[2, 1] * y) / focal + r[2, 2]
    if not depth > BEHIND:
        return math.nan, math.nan
    u = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * focal) / depth
    return u, (r[1, 0] * x + r[1, 1] * y + r[1, 2] * focal) / depth


@numba.njit(cache=True, error_model="numpy")
def turn_points(points: Array, r: Array, focal: float) -> Array:
    """``turn_point`` of each of ``points`` (n, 2) [px]."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = turn_point(points[i, 0], points[i, 1], r, focal)
    return out


@numba.njit(cache=True, error_model="numpy")
def undo_turn(points: Array, vectors: Array, r: Array, focal: float) -> Array:
    """Flow ``vectors`` (n, 2) [px] at ``points`` without the part due to the rotation ``r``."""
    out = turn_points(points - vectors, r, focal)
    for i in range(points.shape[0]):
        out[i, 0] = points[i, 0] - out[i, 0]
        out[i, 1] = points[i, 1] - out[i, 1]
    return out


@numba.njit(cache=True, error_model="numpy")
def turning_slope(x: float, y: float, axis: Array, focal: float) -> tuple[float, float]:
    """Motion [px/rad] of the image point (x, y) while its ray turns about ``axis`` (3,)."""
    wx, wy, wz = axis[0], axis[1], axis[2]
    u = -wx * x * y / focal + wy * (focal + x * x / focal) - wz * y
    return u, -wx * (focal + y * y / focal) + wy * x * y / focal + wz * x


def rotate_points(points: Array, rotation: Array, focal: float) -> Array:
    """``turn_point`` of each of ``points`` (..., 2) [px] for arrays of any layout."""
    flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
    turned: Array = turn_points(flat, np.ascontiguousarray(rotation, dtype=np.float64), focal)
    return turned.reshape(points.shape)
