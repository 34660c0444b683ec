"""Lenses with distortion: where they show a ray, and the pinhole image of what they show.

A calibration has one of OpenCV's models, or the model "arctan" with one number, from pincushion
over pinhole to wide fisheyes. There a ray at the angle ``a`` to the optical axis is shown at
``atan(c tan a) / c`` focal lengths from the principal point, ``c`` being the root of the curvature.
0 is a pinhole, 1 an equidistant fisheye; below 0 the hyperbolic functions take the place of the
circular ones. This is the field of view model of Devernay and Faugeras (2001), with the focal
length of the middle of the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from navfw.numerics import Array

FISHEYE = "equidistant"
"""Model of lenses of any field of view (Kannala and Brandt): OpenCV's module ``fisheye``."""
ARCTAN = "arctan"
"""Model with one coefficient, the curvature, which images alone determine."""
CURVATURES = (-0.6, 1.6)
"""Least and largest curvature."""

_MAX_ANGLE = 1.4
"""Largest ``c`` times radius [rad] that is straightened: beyond it the image is stretched by more
than 5."""

_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-7)
"""When the search for a ray ends: number of steps, and error [px]."""

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


@dataclass(frozen=True, slots=True)
class LensShape:
    """Focal length [px] and ``curvature`` of a lens of the model "arctan"."""

    focal: float
    curvature: float

    def straight(self, points: Array) -> Array:
        """``points`` (n, 2) [px from the centre] as a pinhole camera of ``focal`` shows them."""
        return straighten(points / self.focal, self.curvature) * self.focal

    def slopes(self, points: Array) -> Array:
        """Derivatives (n, 2, 2) of the straight points by the image's pixels."""
        step = 0.01
        sides = [self.straight(points + step * side) for side in np.eye(2)]
        back = [self.straight(points - step * side) for side in np.eye(2)]
        return np.stack([(a - b) / (2.0 * step) for a, b in zip(sides, back, strict=True)], axis=-1)

    def border(self, half: float) -> float:
        """Shift of a point ``half`` [px] off the axis by the distortion, relative to ``half``."""
        return self._straight_half(half) / half - 1.0

    def view(self, half: float) -> float:
        """Horizontal field of view [deg] of an image twice ``half`` [px] wide."""
        return 2.0 * math.degrees(math.atan(self._straight_half(half) / self.focal))

    def _straight_half(self, half: float) -> float:
        return float(self.straight(np.array([[half, 0.0]]))[0, 0])


@dataclass(frozen=True, slots=True)
class CameraCalibration:
    """Matrix and lens distortion of a camera, from ``file``.

    ``matrix`` (3, 3) [px], with the centre of the first pixel at (0, 0); ``coefficients`` (n,) of
    ``model`` ("plumb_bob", "rational_polynomial", "equidistant" in OpenCV's order, or "arctan");
    ``size`` (width, height) [px] of the images that it is for, None if the file does not say it.
    """

    file: str
    matrix: Array
    coefficients: Array
    model: str
    size: tuple[int, int] | None

    def project(self, rays: Array) -> Array:
        """Points (n, 2) [px] where the lens shows ``rays`` (n, 2), at unit depth."""
        if self.model == ARCTAN:
            bent = distort(rays, float(self._numbers[0]))
            return np.asarray(bent @ self.matrix[:2, :2].T + self.matrix[:2, 2])
        solid = np.column_stack([rays, np.ones(len(rays))])[:, None]
        zero = np.zeros(3)
        points, _ = self._opencv.projectPoints(solid, zero, zero, self.matrix, self._numbers)
        return np.asarray(points, dtype=np.float64).reshape(-1, 2)

    def rays(self, points: Array) -> Array:
        """Rays (n, 2), at unit depth, that the lens shows at ``points`` (n, 2) [px].

        The inverse of ``project``, by iteration where it has no closed form: of use where the
        lens's model is invertible.
        """
        if self.model == ARCTAN:
            bent = (points - self.matrix[:2, 2]) / np.diag(self.matrix)[:2]
            return straighten(bent, float(self._numbers[0]))
        at = np.asarray(points, dtype=np.float64)[:, None]
        options = {} if self.model == FISHEYE else {"criteria": _UNTIL}
        rays = self._opencv.undistortPoints(at, self.matrix, self._numbers, **options)
        return np.asarray(rays, dtype=np.float64).reshape(-1, 2)

    def pinhole_maps(self, focal: float, width: int, height: int) -> tuple[Array, Array]:
        """Maps for ``cv2.remap`` to the image (height, width) of a pinhole camera.

        ``focal`` [px] is its focal length; its principal point is in the middle.
        """
        x, y = 0.5 * (width - 1), 0.5 * (height - 1)
        if self.model == ARCTAN:
            columns = (np.arange(width) - x) / focal
            # row by row to save memory
            rows = [
                self.project(np.column_stack([columns, np.full(width, row / focal)])).astype("f4")
                for row in np.arange(height) - y
            ]
            first, second = cv2.convertMaps(np.stack(rows), np.empty(0), cv2.CV_16SC2)
        else:
            straight = np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])
            first, second = self._opencv.initUndistortRectifyMap(
                self.matrix, self._numbers, np.eye(3), straight, (width, height), cv2.CV_16SC2
            )
        return np.asarray(first), np.asarray(second)

    @property
    def _opencv(self) -> Any:
        """OpenCV's module for the model."""
        return cv2.fisheye if self.model == FISHEYE else cv2

    @property
    def _numbers(self) -> Array:
        """The coefficients; four zeros are no distortion in all models."""
        return self.coefficients if self.coefficients.size else np.zeros(4)
