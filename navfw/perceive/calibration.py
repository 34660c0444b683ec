"""Camera calibrations in YAML (OpenCV's FileStorage, camera_info of ROS), applied to images."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.camera_geometry.lens_models import ARCTAN, FISHEYE, CameraCalibration
from navfw.config.document import MAX_BYTES, KeyPath, YamlDocument, key_text, parse_yaml
from navfw.config.input_file import read_input_text, shown_path
from navfw.errors import InputError, did_you_mean
from navfw.numerics import Array, Image

_COUNTS: dict[str, tuple[int, ...]] = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (0, 4, 5, 8, 12, 14),
    FISHEYE: (0, 4),
    ARCTAN: (0, 1),
}
"""Numbers of coefficients of each model, in OpenCV's order."""
_OTHER_NAMES = {
    "radtan": "plumb_bob",
    "rational": "rational_polynomial",
    "thin_prism": "rational_polynomial",
    "fisheye": FISHEYE,
    "kannala_brandt": FISHEYE,
}
# names of the same thing: OpenCV's programs, ROS's camera_info files, ROS messages
_MATRIX = ("camera_matrix", "cameraMatrix", "K", "k")
_COEFFICIENTS = (
    "distortion_coefficients",
    "dist_coeffs",
    "distCoeffs",
    "dist_coeff",
    "distortion_coeffs",
    "D",
    "d",
)
_WIDTH = ("image_width", "width", "imageWidth")
_HEIGHT = ("image_height", "height", "imageHeight")
_SIZE = ("image_size", "imageSize", "resolution")
_MODEL = ("distortion_model", "camera_model", "model")
_FISHEYE_FLAG = ("fisheye_model", "fisheye")
_MAX_SIDE = 20_000
"""Longest side of an image [px]."""
_MAX_VIEW = math.radians(120.0)
"""Largest horizontal and vertical field of view of the result [rad]: beyond, a pinhole image shows
little but stretched pixels of the rim."""
_MIN_VIEW = math.radians(15.0)
_STEPS = 33  # number of points on each side of the image's border
_SEARCHES = 30  # halvings in the search for the focal length


def load_calibration(path: Path) -> CameraCalibration:
    """The calibration in a YAML file; nothing in the file is ever executed.

    Raises:
        InputError: the file cannot be read, is no YAML, or lacks a camera matrix or coefficients; a
            number is missing, no number or out of range; the model is unknown; with file and line.

    """
    file = shown_path(path)
    text = read_input_text(path, MAX_BYTES)
    if text.lstrip().startswith("<"):
        raise InputError("is XML; save the calibration as .yaml or .yml", file=file)
    document = parse_yaml(_plain_yaml(text), file)
    if not isinstance(document.data, dict):
        raise InputError("expected a calibration ('camera_matrix: ...')", file=file)
    reader = _Reader(document)
    model = reader.model()
    return CameraCalibration(
        file=file,
        matrix=reader.matrix(),
        coefficients=reader.coefficients(model),
        model=model,
        size=reader.size(),
    )


def _plain_yaml(text: str) -> str:
    """``text`` in standard YAML, with the same lines.

    OpenCV begins its files with the directive ``%YAML:1.0``, which no standard knows, and marks
    matrices by a tag; a printed message of ROS ends with the beginning of the next.
    """
    text = text.rstrip().removesuffix("\n---")
    head, separator, rest = text.partition("\n")
    if head.startswith("%YAML"):
        text = separator + rest
    return re.sub(r"!!opencv-(nd-)?matrix\b", "", text)


class _Reader:
    """The parts of a calibration ``document``, checked."""

    def __init__(self, document: YamlDocument) -> None:
        self._document = document

    def model(self) -> str:
        key = self._key(_MODEL)
        if key is None:
            flag = self._key(_FISHEYE_FLAG)
            return FISHEYE if flag and self._document.at((flag,)) == 1 else self._by_count()
        name = str(self._document.at((key,))).strip().lower()
        if name in {"", "pinhole"}:
            return self._by_count()
        model = _OTHER_NAMES.get(name, name)
        if model not in _COUNTS:
            hint = did_you_mean(name, [*_COUNTS, *_OTHER_NAMES])
            raise self._error(f"unknown distortion model {name!r}: {hint}", (key,))
        return model

    def matrix(self) -> Array:
        key = self._needed(_MATRIX)
        path, numbers = self._numbers(key)
        if numbers.size != 9:
            raise self._error(f"expected 3 x 3 numbers, got {numbers.size}", path)
        matrix: Array = numbers.reshape(3, 3)
        focal = matrix[0, 0], matrix[1, 1]
        if not (min(focal) > 1.0 and max(focal) < 1e5 and 0.5 < focal[0] / focal[1] < 2.0):
            raise self._error(
                f"expected focal lengths in pixels, got {focal[0]:g} and {focal[1]:g}", path
            )
        if np.abs(matrix[1:, 0]).max() > 0.0 or matrix[2].tolist() != [0.0, 0.0, 1.0]:
            raise self._error("expected the rows fx 0 cx, 0 fy cy, 0 0 1", path)
        if abs(matrix[0, 1]) > 0.01 * focal[0]:
            raise self._error(f"expected no skew, got {matrix[0, 1]:g} px", path)
        size = self.size()
        x, y = matrix[:2, 2]
        if size is not None and not (0.0 < x < size[0] and 0.0 < y < size[1]):
            raise self._error(
                f"the principal point ({x:g}, {y:g}) lies outside of images of {size[0]} x "
                f"{size[1]} px",
                path,
            )
        return matrix

    def coefficients(self, model: str) -> Array:
        path, numbers = self._numbers(self._needed(_COEFFICIENTS))
        if numbers.size not in _COUNTS[model]:
            counts = " or ".join(map(str, _COUNTS[model][1:]))
            raise self._error(
                f"expected {counts} coefficients for {model}, got {numbers.size}", path
            )
        return numbers

    def size(self) -> tuple[int, int] | None:
        width, height, both = self._key(_WIDTH), self._key(_HEIGHT), self._key(_SIZE)
        if width is not None and height is not None:
            return self._side((width,)), self._side((height,))
        if both is not None:
            sides = self._document.at((both,))
            if not isinstance(sides, list) or len(sides) != 2:
                raise self._error("expected [width, height]", (both,))
            return self._side((both, 0)), self._side((both, 1))
        lonely = width or height
        if lonely is not None:
            other = _HEIGHT[0] if width else _WIDTH[0]
            raise self._error(f"has no counterpart {other!r}", (lonely,))
        return None

    def _by_count(self) -> str:
        numbers = self._numbers(self._needed(_COEFFICIENTS))[1]
        return "plumb_bob" if numbers.size <= 5 else "rational_polynomial"

    def _side(self, path: KeyPath) -> int:
        value = self._document.at(path)
        if not isinstance(value, int) or not 1 <= value <= _MAX_SIDE:
            raise self._error(f"expected pixels, 1 to {_MAX_SIDE}, got {value!r:.40}", path)
        return int(value)

    def _numbers(self, key: str) -> tuple[KeyPath, Array]:
        """Path and numbers (n,) of a matrix: a list, a list of rows, or a mapping with ``data``."""
        path: KeyPath = (key,)
        value = self._document.at(path)
        if isinstance(value, dict):
            path = (key, "data")
            value = value.get("data")
        if not isinstance(value, list):
            raise self._error("expected a list of numbers", path)
        rows = [row if isinstance(row, list) else [row] for row in value]
        numbers = [self._number(cell, path) for row in rows for cell in row]
        return path, np.array(numbers)

    def _number(self, value: Any, path: KeyPath) -> float:
        try:
            number = math.nan if isinstance(value, bool) else float(value)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            raise self._error(f"{value!r:.40} is not a number", path)
        return number

    def _key(self, names: Iterable[str]) -> str | None:
        return next((name for name in names if name in self._document.data), None)

    def _needed(self, names: tuple[str, ...]) -> str:
        key = self._key(names)
        if key is None:
            near = did_you_mean(names[0], map(str, self._document.data))
            hint = f"; {near}" if near.startswith("did") else ""
            raise InputError(f"has no key {names[0]!r}{hint}", file=self._document.file)
        return key

    def _error(self, message: str, path: KeyPath) -> InputError:
        line = self._document.line_of(path)
        return InputError(message, file=self._document.file, line=line, key=key_text(path))


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
        self.notes: list[str] = []
        self._lens = replace(calibration, matrix=self._scaled_matrix())
        focal = self._focal()
        self.hfov = 2.0 * math.atan(0.5 * width / focal)
        if self.hfov < _MIN_VIEW:
            raise self._error(
                f"gives a field of view of {math.degrees(self.hfov):.1f} degrees; expected focal "
                "lengths in pixels of this size of images"
            )
        self._maps = self._lens.pinhole_maps(focal, width, height)
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
            x, y = matrix[:2, 2]
            if not (0.25 * width < x < 0.75 * width and 0.25 * height < y < 0.75 * height):
                raise self._error(
                    f"has its principal point at ({x:g}, {y:g}), far from the centre of images of "
                    f"{width} x {height} px; calibrate at the size of the recording"
                )
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
        points = self._lens.project(rays)
        inside = (points >= 0.0) & (points <= np.array([width - 1.0, height - 1.0]))
        if not inside.all():
            return False
        # a polynomial may turn back: points farther out then lie in the image once more
        grown = self._lens.project(1.01 * rays) - points
        outward = (grown * (points - self._lens.matrix[:2, 2])).sum(axis=-1)
        return bool((outward >= 0.0).all())

    def _error(self, message: str) -> InputError:
        return InputError(message, file=self._calibration.file, key="--calibration")
