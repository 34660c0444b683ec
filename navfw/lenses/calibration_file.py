"""Camera calibrations in YAML: OpenCV's FileStorage, camera_info of ROS."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.document import YamlDocument, parse_yaml
from navfw.config.input_file import read_input_text, shown_path
from navfw.config.yaml_text import KeyPath, key_text
from navfw.errors import InputError, did_you_mean
from navfw.lenses.lens_models import ARCTAN, FISHEYE, CameraCalibration
from navfw.numerics import Array

_COUNTS: dict[str, tuple[int, ...]] = {  # defined
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
_MAX_SIDE = 20_000  # chosen
"""Longest side of an image [px]."""


def load_calibration(path: Path) -> CameraCalibration:
    """Load the calibration in a YAML file; nothing in the file is ever executed.

    Raises:
        InputError: the file cannot be read, is no YAML, or lacks a camera matrix or coefficients; a
            number is missing, no number or out of range; the model is unknown; with file and line.

    """
    file = shown_path(path)
    text = read_input_text(path)
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
