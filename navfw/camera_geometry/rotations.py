"""Rotation matrices from rotation vectors and back, compiled.

A rotation vector has the direction of the axis and the length of the angle [rad]; seen against its
direction the rotation is counter-clockwise.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.numerics.arrays import Array

SMALL = 1e-12
"""Angle [rad] or sine below which the first-order formula is exact."""


@numba.njit(cache=True, error_model="numpy")
def rotation_matrix(vector: Array) -> Array:
    """Rotation (3, 3) about ``vector`` (3,) by its length [rad] (Rodrigues' formula)."""
    x, y, z = vector[0], vector[1], vector[2]
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.0
    if angle >= SMALL:
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
    """Rotation vector (3,) [rad] of ``r`` (3, 3), of an angle below pi."""
    x, y, z = 0.5 * (r[2, 1] - r[1, 2]), 0.5 * (r[0, 2] - r[2, 0]), 0.5 * (r[1, 0] - r[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    scale = math.atan2(sine, cosine) / sine if sine > SMALL else 1.0
    vector = np.empty(3)
    vector[0], vector[1], vector[2] = scale * x, scale * y, scale * z
    return vector
