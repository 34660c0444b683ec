"""A lens with one number of distortion: from pincushion over pinhole to wide fisheyes.

A ray at the angle ``a`` to the optical axis is shown at ``atan(c tan a) / c`` focal lengths from
the principal point, ``c`` being the root of the curvature. 0 is a pinhole, 1 an equidistant
fisheye; below 0 the hyperbolic functions take the place of the circular ones. This is the field of
view model of Devernay and Faugeras (2001), with the focal length of the middle of the image.
"""

from __future__ import annotations

import math

import numpy as np

from navfw.signals import Array

CURVATURES = (-0.6, 1.6)
"""Least and largest curvature."""

_MAX_ANGLE = 1.4
"""Largest ``c`` times radius [rad] that is straightened: beyond it the image is stretched by more
than 5."""

_STRAIGHT = 1e-6
"""Curvature below which the lens is a pinhole up to rounding."""


def straighten(points: Array, curvature: float) -> Array:
    """Where a pinhole camera shows what the lens shows at ``points`` (..., 2).

    Both are in focal lengths from the principal point. Points beyond ``_MAX_ANGLE`` are those at
    it.
    """
    bent = _bent(points, curvature)
    if abs(curvature) < _STRAIGHT:
        return np.array(points, dtype=np.float64)
    if curvature > 0.0:
        return np.asarray(points * np.tan(np.minimum(bent, _MAX_ANGLE)) / bent)
    return np.asarray(points * np.tanh(bent) / bent)


def distort(points: Array, curvature: float) -> Array:
    """Where the lens shows what a pinhole camera shows at ``points`` (..., 2).

    Both are in focal lengths from the principal point.
    """
    bent = _bent(points, curvature)
    if abs(curvature) < _STRAIGHT:
        return np.array(points, dtype=np.float64)
    if curvature > 0.0:
        return np.asarray(points * np.arctan(bent) / bent)
    return np.asarray(points * np.arctanh(np.minimum(bent, 1.0 - 1e-9)) / bent)


def _bent(points: Array, curvature: float) -> Array:
    """``c`` times the radius (..., 1) [rad] of ``points``, above 0."""
    radius = np.linalg.norm(points, axis=-1, keepdims=True)
    return np.asarray(np.maximum(math.sqrt(abs(curvature)) * radius, 1e-9))


def focal_for(half: float, angle: float, curvature: float) -> float:
    """The focal length [px] of a lens that shows ``angle`` [rad] at ``half`` [px] off the axis."""
    return half / float(distort(np.array([math.tan(angle), 0.0]), curvature)[0])
