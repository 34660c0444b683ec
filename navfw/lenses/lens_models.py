"""Model lenses with distortion: project rays, and compute pinhole images from theirs.

A calibration has one of OpenCV's models, or the model "arctan" with one number, from pincushion
over pinhole to wide fisheyes. There a ray at the angle ``a`` to the optical axis is shown at
``atan(c tan a) / c`` focal lengths from the principal point, ``c`` being the root of the curvature.
0 is a pinhole, 1 an equidistant fisheye; below 0 the hyperbolic functions take the place of the
circular ones. This is the field of view model of Devernay and Faugeras (2001), with the focal
length of the middle of the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from navfw.errors import InputError
from navfw.numerics import Array, Image

FISHEYE = "equidistant"
"""Model of lenses of any field of view (Kannala and Brandt): OpenCV's module ``fisheye``."""
ARCTAN = "arctan"
"""Model with one coefficient, the curvature, which can be estimated from images."""
CURVATURES = (-0.6, 1.6)  # chosen
"""Least and largest curvature."""

_MAX_ANGLE = 1.4  # derived
"""Largest ``c`` times radius [rad] that is straightened: beyond, images are stretched by over 5."""

_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-7)  # chosen
"""Limits of the search for a ray: number of steps, and error [px]."""

_STRAIGHT = 1e-6  # derived
"""Curvature below which the lens is a pinhole up to rounding."""


def straighten(points: Array, curvature: float) -> Array:
    """Convert ``points`` (..., 2) of the lens's image to those of a pinhole camera.

    Both are in focal lengths from the principal point. If ``c`` times the radius exceeds 1.4, the
    point at 1.4 is returned.
    """
    bent = _bent(points, curvature)
    if abs(curvature) < _STRAIGHT:
        return np.array(points, dtype=np.float64)
    if curvature > 0.0:
        return np.asarray(points * np.tan(np.minimum(bent, _MAX_ANGLE)) / bent)
    return np.asarray(points * np.tanh(bent) / bent)


def distort(points: Array, curvature: float) -> Array:
    """Convert ``points`` (..., 2) of a pinhole camera's image to those of the lens's image.

    Both are in focal lengths from the principal point.
    """
    bent = _bent(points, curvature)
    if abs(curvature) < _STRAIGHT:
        return np.array(points, dtype=np.float64)
    if curvature > 0.0:
        return np.asarray(points * np.arctan(bent) / bent)
    return np.asarray(points * np.arctanh(np.minimum(bent, 1.0 - 1e-9)) / bent)


def _bent(points: Array, curvature: float) -> Array:
    """Return ``c`` times the radius (..., 1) [rad] of ``points``, above 0."""
    radius = np.linalg.norm(points, axis=-1, keepdims=True)
    return np.asarray(np.maximum(math.sqrt(abs(curvature)) * radius, 1e-9))


def focal_for(half: float, angle: float, curvature: float) -> float:
    """Return the focal length [px] of a lens that shows ``angle`` [rad] at ``half`` [px]."""
    return half / float(distort(np.array([math.tan(angle), 0.0]), curvature)[0])


@dataclass(frozen=True, slots=True)
class LensShape:
    """Focal length [px] and ``curvature`` of a lens of the model "arctan"."""

    focal: float
    curvature: float

    def straight(self, points: Array) -> Array:
        """Convert ``points`` (n, 2) [px from the centre] to a pinhole image with this ``focal``."""
        return straighten(points / self.focal, self.curvature) * self.focal

    def slopes(self, points: Array) -> Array:
        """Compute the derivatives (n, 2, 2) of the straight ``points`` (rows) by ``points``."""
        step = 0.01
        sides = [self.straight(points + step * side) for side in np.eye(2)]
        back = [self.straight(points - step * side) for side in np.eye(2)]
        return np.stack([(a - b) / (2.0 * step) for a, b in zip(sides, back, strict=True)], axis=-1)

    def border(self, half: float) -> float:
        """Return the shift by distortion at ``half`` [px] off the axis, relative to ``half``."""
        return self._straight_half(half) / half - 1.0

    def view(self, half: float) -> float:
        """Return the horizontal field of view [deg] of an image twice ``half`` [px] wide."""
        return 2.0 * math.degrees(math.atan(self._straight_half(half) / self.focal))

    def _straight_half(self, half: float) -> float:
        return float(self.straight(np.array([[half, 0.0]]))[0, 0])


@dataclass(frozen=True, slots=True)
class CameraCalibration:
    """Matrix and lens distortion of a camera, read from ``file``.

    ``matrix`` (3, 3) [px] has the centre of the first pixel at (0, 0); ``coefficients`` (n,) of
    ``model`` ("plumb_bob", "rational_polynomial", "equidistant" in OpenCV's order, or "arctan");
    ``size`` (width, height) [px] of the calibrated images, None if the file does not say it.
    """

    file: str
    matrix: Array
    coefficients: Array
    model: str
    size: tuple[int, int] | None

    def project(self, rays: Array) -> Array:
        """Project ``rays`` (n, 2), at unit depth, to points (n, 2) [px] in the lens's image."""
        if self.model == ARCTAN:
            bent = distort(rays, float(self._numbers[0]))
            return np.asarray(bent @ self.matrix[:2, :2].T + self.matrix[:2, 2])
        solid = np.column_stack([rays, np.ones(len(rays))])[:, None]
        zero = np.zeros(3)
        points, _ = self._opencv.projectPoints(solid, zero, zero, self.matrix, self._numbers)
        return np.asarray(points, dtype=np.float64).reshape(-1, 2)

    def rays(self, points: Array) -> Array:
        """Return the rays (n, 2), at unit depth, that the lens shows at ``points`` (n, 2) [px].

        The inverse of ``project``, by iteration if it has no closed form; valid only where the
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
        """Compute maps for ``cv2.remap`` to the image (height, width) of a pinhole camera.

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
        """The module of OpenCV that implements the model."""
        return cv2.fisheye if self.model == FISHEYE else cv2

    @property
    def _numbers(self) -> Array:
        """The coefficients; four zeros are no distortion in all models."""
        return self.coefficients if self.coefficients.size else np.zeros(4)


_MAX_VIEW = math.radians(120.0)  # chosen
"""Largest horizontal and vertical field of view [rad] of the result: beyond it a pinhole image
consists mostly of stretched pixels of the rim."""
_MIN_VIEW = math.radians(15.0)  # chosen
_MAX_FLAT = math.radians(155.0)  # chosen
"""Largest field of view [rad] of a lens that no fisheye's model describes."""
_MARGIN = 64.0  # chosen
"""Largest distance [px] outside of the image to which the map of ``distort`` points."""
_BORDER = 0.02  # chosen
"""Share of the width that images may lack of a given field of view: their border is repeated
there."""
_STEPS = 33  # chosen: number of points on each side of the image's border
_SEARCHES = 30  # chosen: halvings in the search for the focal length


class Undistortion:
    """Removes lens distortion from images of ``width`` x ``height`` px.

    The result has the same size, square pixels, the principal point in its centre, and no pixels
    that the lens does not show: its focal length is the least without black margins. ``hfov`` [rad]
    is its horizontal field of view, the widest unless it is given; ``notes`` say how
    ``calibration`` or images were adapted. ``key`` is the option or key that gave the calibration,
    named in errors.

    Raises:
        InputError: the calibration is for images of another shape, its coefficients cannot be
            inverted within the image, or the field of view is below 15 degrees.

    """

    def __init__(
        self,
        calibration: CameraCalibration,
        width: int,
        height: int,
        key: str | None = "--calibration",
        hfov: float | None = None,
    ) -> None:
        self._key = key
        self.calibration = calibration
        self._size = width, height
        self.notes: list[str] = []
        self._lens = replace(calibration, matrix=self._scaled_matrix())
        view = 2.0 * math.atan(0.5 * width / self._lens.matrix[0, 0])
        if view > _MAX_FLAT and calibration.model not in {FISHEYE, ARCTAN}:
            what = f"gives a field of view of {math.degrees(view):.0f} degrees, beyond its model"
            raise self._error(f"{what}: expected focal lengths in pixels of this size of images")
        self._focal = self._widest() if hfov is None else self._of_view(hfov)
        self.hfov = 2.0 * math.atan(0.5 * width / self._focal)
        if self.hfov < _MIN_VIEW:
            raise self._error(
                f"gives a field of view of {math.degrees(self.hfov):.1f} degrees; expected focal "
                "lengths in pixels of this size of images"
            )
        self._maps = self._lens.pinhole_maps(self._focal, width, height)
        shown = math.degrees(self.hfov)
        by = f"distortion removed by {calibration.file}"
        self.notes.append(f"{by}: images then show {shown:.1f} degrees across")

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width [px] of the images."""
        return self._size[1], self._size[0]

    def apply(self, image: Image) -> Image:
        """Return ``image`` (height, width), or one with channels, without the distortion."""
        edge = cv2.BORDER_REPLICATE
        straight = cv2.remap(image, *self._maps, cv2.INTER_LINEAR, borderMode=edge)
        return np.asarray(straight, dtype=np.uint8)

    def distort(self, image: Image) -> Image:
        """Draw ``image`` of the pinhole camera as the lens shows it: the inverse of ``apply``.

        The lens shows more than the image has: outside of it, its border is repeated. ``apply``
        never uses these pixels.
        """
        bent = cv2.remap(image, *self._back, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(bent, dtype=np.uint8)

    @cached_property
    def _back(self) -> tuple[Array, Array]:
        """Maps for ``cv2.remap`` from the pinhole camera's image to the lens's."""
        width, height = self._size
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
        rays = self._lens.rays(pixels.reshape(-1, 2).astype(np.float64))
        focal = 0.5 * width / math.tan(0.5 * self.hfov)
        middle = 0.5 * (width - 1), 0.5 * (height - 1)
        # a ray without limits would overflow the map's integers
        points = np.clip(rays * focal + middle, -_MARGIN, max(width, height) + _MARGIN)
        shaped = points.reshape(height, width, 2).astype(np.float32)
        first, second = cv2.convertMaps(shaped, np.empty(0), cv2.CV_16SC2)
        return np.asarray(first), np.asarray(second)

    def _scaled_matrix(self) -> Array:
        """Return the camera matrix for the images' size.

        Images of the same shape are assumed to be the scaled whole of the calibrated ones.
        """
        matrix = self.calibration.matrix.copy()
        width, height = self._size
        if self.calibration.size is None:
            self.notes.append(
                f"{self.calibration.file} does not say its size of images: taken as {width} x "
                f"{height}"
            )
            x, y = matrix[:2, 2]
            if not (0.25 * width < x < 0.75 * width and 0.25 * height < y < 0.75 * height):
                raise self._error(
                    f"has its principal point at ({x:g}, {y:g}), far from the centre of images of "
                    f"{width} x {height} px; calibrate at the size of the recording"
                )
            return matrix
        full_width, full_height = self.calibration.size
        if (full_width, full_height) == (width, height):
            return matrix
        message = f"is for images of {full_width} x {full_height} px, not {width} x {height}"
        if full_width * width == full_height * height and width != height:
            raise self._error(
                f"{message}: turn the images as they were for the calibration, or calibrate with "
                "the camera held upright"
            )
        if full_width * height != full_height * width:
            raise self._error(
                f"{message}, which are no scaled copy of these; calibrate at the size of the "
                "recording, or give --hfov"
            )
        scale = width / full_width
        # pixel centres have whole coordinates, so the corner of the image is at -0.5
        matrix[:2, 2] = (matrix[:2, 2] + 0.5) * scale - 0.5
        matrix[:2, :2] *= scale
        self.notes.append(
            f"{self.calibration.file} {message}: scaled by {scale:.4g}, as for images that were "
            "scaled and not cut"
        )
        return matrix

    @property
    def shift(self) -> float:
        """Largest distance [px] between a pixel of the result and where the lens shows it."""
        rays = self._rays(self._focal)
        points = rays * self._focal + 0.5 * (np.array(self._size) - 1.0)
        return float(np.abs(self._lens.project(rays) - points).max())

    def _of_view(self, hfov: float) -> float:
        """Return the focal length [px] of a result that shows ``hfov`` [rad]."""
        focal = 0.5 * self._size[0] / math.tan(0.5 * hfov)
        if self._shown(focal, _BORDER * self._size[0]):
            return focal
        widest = 2.0 * math.atan(0.5 * self._size[0] / self._widest())
        what = f"the lens shows {math.degrees(widest):.1f} degrees across, camera.hfov is"
        raise self._error(f"{what} {math.degrees(hfov):.1f}: set it to {widest:.3f}, in rad")

    def _widest(self) -> float:
        """Return the least focal length [px] at which all of the result is in the image."""
        width, height = self._size
        low = 0.5 * max(width, height) / math.tan(0.5 * _MAX_VIEW)
        high = 0.5 * width / math.tan(0.5 * math.radians(1.0))
        if not self._shown(high):
            raise self._error(
                "its distortion cannot be removed even near the principal point; check the order "
                "of the coefficients (k1, k2, p1, p2, k3) and the model"
            )
        if self._shown(low):
            self.notes.append(
                f"the lens shows more than {math.degrees(_MAX_VIEW):.0f} degrees:"
                " the middle is used"
            )
            return low
        for _ in range(_SEARCHES):
            middle = math.sqrt(low * high)
            if self._shown(middle):
                high = middle
            else:
                low = middle
        return high

    def _rays(self, focal: float) -> Array:
        """Return rays (n, 2), at unit depth, all over a result with ``focal`` [px]."""
        width, height = self._size
        x = np.linspace(-0.5 * (width - 1), 0.5 * (width - 1), _STEPS)
        y = np.linspace(-0.5 * (height - 1), 0.5 * (height - 1), _STEPS)
        rays: Array = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) / focal
        return rays

    def _shown(self, focal: float, margin: float = 0.0) -> bool:
        """Return whether the lens, invertible there, shows all of a result with ``focal`` [px].

        Its image may lack a ``margin`` [px].
        """
        rays = self._rays(focal)
        points = self._lens.project(rays)
        inside = (points >= -margin) & (points <= np.array(self._size) - 1.0 + margin)
        if not inside.all():
            return False
        # a polynomial may turn back: points farther out then lie in the image once more
        grown = self._lens.project(1.01 * rays) - points
        outward = (grown * (points - self._lens.matrix[:2, 2])).sum(axis=-1)
        return bool((outward >= 0.0).all())

    def _error(self, message: str) -> InputError:
        return InputError(message, file=self.calibration.file, key=self._key)
