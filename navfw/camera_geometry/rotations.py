"""Rotations, image points turned by them, and derotation: the flow without its rotational part.

The removal is exact (paper sec 3, METHOD 2.4).
"""

from __future__ import annotations

import dataclasses
import math

import numba
import numpy as np

from navfw.numerics.arrays import Array
from navfw.robot import CameraModel
from navfw.signals import FlowField

_SMALL = 1e-12  # derived
"""Angle [rad] or sine below which the first-order formula is exact."""


@numba.njit(cache=True, error_model="numpy")
def rotation_matrix(vector: Array) -> Array:
    """Convert a rotation vector (3,), axis times angle [rad], into a matrix (3, 3) (Rodrigues)."""
    x, y, z = vector[0], vector[1], vector[2]
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.0
    if angle >= _SMALL:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    rotation = np.empty((3, 3))
    rotation[0, 0] = 1.0 + b * (-z * z - y * y)
    rotation[0, 1] = -a * z + b * (x * y)
    rotation[0, 2] = a * y + b * (x * z)
    rotation[1, 0] = a * z + b * (x * y)
    rotation[1, 1] = 1.0 + b * (-z * z - x * x)
    rotation[1, 2] = -a * x + b * (y * z)
    rotation[2, 0] = -a * y + b * (x * z)
    rotation[2, 1] = a * x + b * (y * z)
    rotation[2, 2] = 1.0 + b * (-y * y - x * x)
    return rotation


@numba.njit(cache=True, error_model="numpy")
def rotation_vector(r: Array) -> Array:
    """Convert a rotation matrix ``r`` (3, 3) into its vector (3,) [rad]; the angle is below pi."""
    x, y, z = 0.5 * (r[2, 1] - r[1, 2]), 0.5 * (r[0, 2] - r[2, 0]), 0.5 * (r[1, 0] - r[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    scale = math.atan2(sine, cosine) / sine if sine > _SMALL else 1.0
    vector = np.empty(3)
    vector[0], vector[1], vector[2] = scale * x, scale * y, scale * z
    return vector


_BEHIND = 1e-9  # derived
"""Depth of a turned ray, in focal lengths, up to which it has no image."""


@numba.njit(cache=True, error_model="numpy")
def turn_point(x: float, y: float, r: Array, focal: float) -> tuple[float, float]:
    """Rotate the ray of the image point (x, y) [px] by ``r`` (3, 3) and return its new point [px].

    NaN where the rotated ray points behind the camera. ``focal`` [px] is the focal length.
    """
    depth = (r[2, 0] * x + r[2, 1] * y) / focal + r[2, 2]
    if not depth > _BEHIND:
        return math.nan, math.nan
    u = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * focal) / depth
    return u, (r[1, 0] * x + r[1, 1] * y + r[1, 2] * focal) / depth


@numba.njit(cache=True, error_model="numpy")
def turn_points(points: Array, r: Array, focal: float) -> Array:
    """Rotate the rays of ``points`` (n, 2) [px], floats, by ``r``; NaN where one is behind then."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = turn_point(points[i, 0], points[i, 1], r, focal)
    return out


@numba.njit(cache=True, error_model="numpy")
def undo_turn(points: Array, vectors: Array, r: Array, focal: float) -> Array:
    """Remove from flow ``vectors`` (n, 2) [px] at ``points`` the part due to the rotation ``r``."""
    out = turn_points(points - vectors, r, focal)
    for i in range(points.shape[0]):
        out[i, 0] = points[i, 0] - out[i, 0]
        out[i, 1] = points[i, 1] - out[i, 1]
    return out


@numba.njit(cache=True, error_model="numpy")
def turning_slope(x: float, y: float, axis: Array, focal: float) -> tuple[float, float]:
    """Compute the velocity [px/rad] of image point (x, y) [px] turning about ``axis`` (3,)."""
    wx, wy, wz = axis[0], axis[1], axis[2]
    u = -wx * x * y / focal + wy * (focal + x * x / focal) - wz * y
    return u, -wx * (focal + y * y / focal) + wy * x * y / focal + wz * x


def rotate_points(points: Array, rotation: Array, focal: float) -> Array:
    """Apply ``turn_point`` to each of ``points`` (..., 2) [px], arrays of any memory layout."""
    flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
    turned: Array = turn_points(flat, np.ascontiguousarray(rotation, dtype=np.float64), focal)
    return turned.reshape(points.shape)


def derotate(flow: FlowField, camera: CameraModel) -> FlowField:
    """Remove the rotational part of ``flow``, as if the camera had only been translated.

    The past end of each vector is rotated into the current camera's axes; the result obeys the
    equations of pure translation exactly, for rotations of any size. A field that is already
    derotated is returned unchanged.
    """
    if flow.derotated:
        return flow
    vectors = derotated_vectors(flow, flow.motion.rotation, camera)
    return dataclasses.replace(flow, vectors=vectors, derotated=True)


def derotated_vectors(flow: FlowField, rotation: Array, camera: CameraModel) -> Array:
    """Return the vectors (rows, cols, 2) [px] of ``flow`` without the part due to ``rotation``."""
    if flow.derotated:
        return flow.vectors
    vectors: Array = undo_turn(
        np.ascontiguousarray(flow.points, dtype=np.float64).reshape(-1, 2),
        np.ascontiguousarray(flow.vectors, dtype=np.float64).reshape(-1, 2),
        np.ascontiguousarray(rotation, dtype=np.float64),
        camera.focal,
    )
    return vectors.reshape(flow.vectors.shape)
