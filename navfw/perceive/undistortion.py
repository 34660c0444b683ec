"""Images of a calibrated camera as those of a pinhole camera without lens distortion."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np

from navfw.errors import InputError
from navfw.perceive.arctan_lens import distort
from navfw.perceive.calibration_file import ARCTAN, FISHEYE, CameraCalibration
from navfw.signals import Array, Image

_MAX_VIEW = math.radians(120.0)
"""Largest horizontal and vertical field of view of the result [rad]: beyond, a pinhole image shows
little but stretched pixels of the rim."""
_MIN_VIEW = math.radians(15.0)
_STEPS = 33  # number of points on each side of the image's border
_SEARCHES = 30  # halvings in the search for the focal length


class Undistortion:
    """Removes lens distortion from images of ``width`` x ``height`` px.

    The result has the same size, square pixels, the principal point in its centre, and shows only
    what the lens shows: its focal length is the least without black margins. ``hfov`` [rad] is its
    horizontal field of view; ``notes`` say what was done to the calibration or the images.

    Raises:
        InputError: the calibration is for images of another shape, or its coefficients cannot be
            inverted within the image.

    """

    def __init__(self, calibration: CameraCalibration, width: int, height: int) -> None:
        self._calibration = calibration
        self._size = width, height
        self._lens: Any = cv2.fisheye if calibration.model == FISHEYE else cv2
        # four zeros are no distortion in both models
        given = calibration.coefficients
        self._coefficients = given if given.size else np.zeros(4)
        self.notes: list[str] = []
        self._matrix = self._scaled_matrix()
        focal = self._focal()
        self.hfov = 2.0 * math.atan(0.5 * width / focal)
        if self.hfov < _MIN_VIEW:
            raise self._error(
                f"gives a field of view of {math.degrees(self.hfov):.1f} degrees; expected focal "
                "lengths in pixels of this size of images"
            )
        self._maps = self._undistortion_maps(focal)
        view = math.degrees(self.hfov)
        self.notes.append(f"calibration applied: images then show {view:.1f} degrees across")

    def apply(self, image: Image) -> Image:
        """``image`` (height, width, 3) without distortion."""
        straight = cv2.remap(image, self._maps[0], self._maps[1], cv2.INTER_LINEAR)
        return np.asarray(straight, dtype=np.uint8)

    def _scaled_matrix(self) -> Array:
        """The camera matrix for the images' size.

        Images of the same shape are taken for the scaled whole of the calibrated ones.
        """
        matrix = self._calibration.matrix.copy()
        width, height = self._size
        if self._calibration.size is None:
            self.notes.append(
                f"{self._calibration.file} does not say its size of images: taken as {width} x "
                f"{height}"
            )
            self._require_inside(matrix)
            return matrix
        full_width, full_height = self._calibration.size
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
            f"{self._calibration.file} {message}: scaled by {scale:.4g}, as for images that were "
            "scaled and not cut"
        )
        return matrix

    def _require_inside(self, matrix: Array) -> None:
        x, y = matrix[:2, 2]
        width, height = self._size
        if not (0.25 * width < x < 0.75 * width and 0.25 * height < y < 0.75 * height):
            raise self._error(
                f"has its principal point at ({x:g}, {y:g}), far from the centre of images of "
                f"{width} x {height} px; calibrate at the size of the recording"
            )

    def _focal(self) -> float:
        """The least focal length [px] of the result at which all of it lies in the image."""
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

    def _shown(self, focal: float) -> bool:
        """Whether the lens shows all of a result with ``focal`` [px]; its model is invertible."""
        width, height = self._size
        x = np.linspace(-0.5 * (width - 1), 0.5 * (width - 1), _STEPS)
        y = np.linspace(-0.5 * (height - 1), 0.5 * (height - 1), _STEPS)
        rays = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) / focal
        points = self._distorted(rays)
        inside = (points >= 0.0) & (points <= np.array([width - 1.0, height - 1.0]))
        if not inside.all():
            return False
        # a polynomial may turn back: points farther out then lie in the image once more
        grown = self._distorted(1.01 * rays) - points
        outward = (grown * (points - self._matrix[:2, 2])).sum(axis=-1)
        return bool((outward >= 0.0).all())

    def _distorted(self, rays: Array) -> Array:
        """Points (n, 2) [px] where the lens shows ``rays`` (n, 2), at unit depth."""
        if self._calibration.model == ARCTAN:
            bent = distort(rays, float(self._coefficients[0]))
            return np.asarray(bent @ self._matrix[:2, :2].T + self._matrix[:2, 2])
        solid = np.column_stack([rays, np.ones(len(rays))])[:, None]
        zero = np.zeros(3)
        points, _ = self._lens.projectPoints(solid, zero, zero, self._matrix, self._coefficients)
        return np.asarray(points, dtype=np.float64).reshape(-1, 2)

    def _undistortion_maps(self, focal: float) -> tuple[Array, Array]:
        width, height = self._size
        if self._calibration.model == ARCTAN:
            return self._maps_by_rows(focal)
        straight = np.array(
            [
                [focal, 0.0, 0.5 * (width - 1)],
                [0.0, focal, 0.5 * (height - 1)],
                [0.0, 0.0, 1.0],
            ]
        )
        first, second = self._lens.initUndistortRectifyMap(
            self._matrix, self._coefficients, np.eye(3), straight, self._size, cv2.CV_16SC2
        )
        return np.asarray(first), np.asarray(second)

    def _maps_by_rows(self, focal: float) -> tuple[Array, Array]:
        """The maps from ``_distorted``, row by row to save memory."""
        width, height = self._size
        x = (np.arange(width) - 0.5 * (width - 1)) / focal
        rows = [
            self._distorted(np.column_stack([x, np.full(width, y / focal)])).astype(np.float32)
            for y in np.arange(height) - 0.5 * (height - 1)
        ]
        first, second = cv2.convertMaps(np.stack(rows), np.empty(0), cv2.CV_16SC2)
        return np.asarray(first), np.asarray(second)

    def _error(self, message: str) -> InputError:
        return InputError(message, file=self._calibration.file, key="--calibration")
