"""Camera calibrations: of OpenCV, ROS, Kalibr, EuRoC, VINS and ORB-SLAM."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.document import Origin, YamlDocument, parse_yaml
from navfw.config.foreign_files import line_of, parse_xml
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
    **dict.fromkeys(("radtan", "radial-tangential", "brown_conrady"), "plumb_bob"),
    **dict.fromkeys(("rational", "thin_prism"), "rational_polynomial"),
    **dict.fromkeys(("fisheye", "equi", "kannala_brandt", "kannalabrandt8"), FISHEYE),
}
_BY_COUNT = {"", "pinhole", "pinhole_full", "perspective", "rectified", "none"}
"""What is said of lenses whose model follows from the number of coefficients."""
_REFUSED = {
    **{"omni": "omni", "mei": "MEI", "ds": "ds", "eucm": "eucm", "fov": "fov"},
    "scaramuzza": "SCARAMUZZA",
}
"""Models of Kalibr and VINS that are known and not supported."""
# names of the same thing, whatever their case: OpenCV's programs; ROS's camera_info files and
# messages; cameracalibrator's ost.txt; Kalibr and EuRoC
_MATRIX = ("camera_matrix", "cameramatrix", "camera matrix", "k", "intrinsics")
_COEFFICIENTS = (
    "distortion_coefficients",
    "dist_coeffs",
    "distcoeffs",
    "dist_coeff",
    "distortion_coeffs",
    "distortion",
    "d",
)
_FOCALS = (("fx", "fy", "cx", "cy"), ("mu", "mv", "u0", "v0"))
"""Names of the numbers of a camera matrix: of ORB-SLAM and VINS, and of VINS's fisheyes."""
_NAMED = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_NAMED_FISHEYE = (("k1", "k2", "k3", "k4"), ("k2", "k3", "k4", "k5"))
"""Names of coefficients in OpenCV's order, beside each of ``_FOCALS`` for a fisheye."""
_PARTS = ("distortion_parameters", "mirror_parameters")
_WIDTH = ("image_width", "width", "imagewidth", "cols")
_HEIGHT = ("image_height", "height", "imageheight", "rows")
_SIZE = ("image_size", "imagesize", "resolution")
_MODEL = ("distortion_model", "camera_model", "model_type", "model", "type")
_FISHEYE_FLAG = ("fisheye_model", "fisheye")
_MAX_SIDE = 20_000  # chosen
"""Longest side of an image [px]."""
_CENTRAL = 0.3  # chosen
"""Least share of the image's width left and right of the principal point of the unbinned image."""


def load_calibration(path: Path, camera: str | None = None) -> CameraCalibration:
    """Load the calibration in a file; nothing in the file is ever executed.

    It is YAML of OpenCV, ROS, Kalibr, EuRoC, VINS or ORB-SLAM, XML of OpenCV, or the text of
    cameracalibrator. ``camera`` is the name or topic of one of several; binned and cut images are
    those of ``camera_info`` (REP 104).

    Raises:
        InputError: the file cannot be read, is none of these, or lacks a camera matrix or
            coefficients; a number is missing, no number or out of range; the model is unknown or
            not supported; there are several cameras, and none is named; with file and line.

    """
    file = shown_path(path)
    text = read_input_text(path)
    if text.lstrip().startswith("<"):
        document = _xml_document(text, file)
    else:
        document = parse_yaml(_plain_yaml(text, file), file)
    if not isinstance(document.data, dict):
        raise InputError("expected a calibration ('camera_matrix: ...')", file=file)
    reader = _Reader(document, camera)
    matrix, size = reader.of_the_image()
    model = reader.model()
    return CameraCalibration(
        file=file,
        matrix=matrix,
        coefficients=reader.coefficients(model),
        model=model,
        size=size,
    )


def _plain_yaml(text: str, file: str) -> str:
    """``text`` in standard YAML, with the same lines.

    OpenCV begins its files with the directive ``%YAML:1.0``, which no standard knows, and marks
    matrices by a tag; a printed message of ROS ends with the beginning of the next.
    cameracalibrator writes names and, below each, numbers.
    """
    if re.search(r"(?m)^\s*camera matrix\s*$", text):
        cameras = re.findall(r"(?m)^\s*\[(?!image\])(.+)\]\s*$", text)
        if len(cameras) > 1:
            what = f"has several cameras, {', '.join(cameras)}: save each in a file of its own"
            raise InputError(f"{what}, below the lines of [image]", file=file)
        lines = [re.sub(r"^\[.*", "", line.strip()) for line in text.splitlines()]
        return "\n".join(f"{line}:" if line[:1].isalpha() else f" {line}" for line in lines)
    text = re.sub(r"(?m)^%YAML.*$", "", text.rstrip().removesuffix("\n---"))
    return re.sub(r"!!opencv-(nd-)?matrix\b", "", text)


def _xml_document(text: str, file: str) -> YamlDocument:
    """The content of OpenCV's XML as if it were YAML."""
    root = parse_xml(text.encode(), file, "XML of OpenCV's FileStorage")
    data: dict[str, Any] = {}
    origins: dict[KeyPath, Origin] = {}
    for node in root:
        parts = {part.tag: (part.text or "").strip() for part in node}
        whole = (node.text or "").strip()
        data[node.tag] = parts or (int(whole) if whole.isdecimal() else whole)
        origins[(node.tag,)] = Origin(file, line_of(node))
    return YamlDocument(file, data, origins)


class _Reader:
    """The parts of a calibration ``document``, checked; of a ``camera`` if it has several."""

    def __init__(self, document: YamlDocument, camera: str | None) -> None:
        self._document = document
        self._places: list[tuple[KeyPath, str]] = [((), "")]
        if self._key(_MATRIX) is None or isinstance(self._document.at(self._needed(_MATRIX)), dict):
            self._places = [*self._camera(camera), *(((part,), "") for part in _PARTS)]
            self._places += [((), "Camera."), ((), "")]

    def _camera(self, wanted: str | None) -> list[tuple[KeyPath, str]]:
        """Where the numbers of the ``wanted`` camera are: below a key, or beside it after a dot."""
        cameras: dict[str, tuple[KeyPath, str]] = {}
        marks = {"intrinsics", *(names[0] for names in _FOCALS)}
        for key, value in self._document.data.items():
            name, dot, last = key.rpartition(".")
            if isinstance(value, dict) and marks & value.keys():
                cameras[key] = (key,), ""
            elif dot and last in marks:
                cameras[name] = (), f"{name}."
        if len(cameras) < 2:
            return list(cameras.values())
        topics = {str(self._document.at((name, "rostopic"))): name for name in cameras}
        chosen = topics.get(wanted or "", wanted)
        if chosen not in cameras:
            what = f"has several cameras, {', '.join(cameras)}"
            raise self._error(f"{what}: choose one by --camera, or keep one", ())
        return [cameras[chosen]]

    def model(self) -> str:
        flag = self._key(_FISHEYE_FLAG)
        keys = [key for key in map(self._key, zip(_MODEL, strict=True)) if key is not None]
        said = [(str(self._document.at(key)).strip().lower(), key) for key in keys]
        for name, key in said:
            if name in _REFUSED:
                how = "calibrate as a pinhole camera with radtan or equidistant distortion"
                raise self._error(f"the model {_REFUSED[name]!r} is not supported: {how}", key)
        for name, key in said:
            model = _OTHER_NAMES.get(name, name)
            if model in _COUNTS:
                return model
            if name not in _BY_COUNT:
                hint = did_you_mean(name, [*_COUNTS, *_OTHER_NAMES])
                raise self._error(f"unknown distortion model {name!r}: {hint}", key)
        if flag and not said and self._document.at(flag) == 1:
            return FISHEYE
        return "plumb_bob" if self._coefficients(_NAMED)[1].size <= 5 else "rational_polynomial"

    def of_the_image(self) -> tuple[Array, tuple[int, int] | None]:
        """Matrix and size of the image as it was sent: cut out of the sensor's, and binned."""
        matrix, size = self.matrix(), self.size()
        steps = [max(self._pixels(f"binning_{axis}"), 1) for axis in "xy"]
        if max(steps) > 1 and size is not None:
            for k, side in enumerate(size):
                if not _CENTRAL < matrix[k, 2] / side < 1.0 - _CENTRAL:
                    what = (
                        f"its principal point {matrix[k, 2]:g} is not near the middle of {side} px"
                    )
                    key = self._key((f"binning_{'xy'[k]}",)) or ()
                    raise self._error(f"{what}: the camera matrix was binned already", key)
        roi = [self._pixels("roi", name) for name in ("x_offset", "y_offset", "width", "height")]
        sides = list(size or ())
        for k, step in enumerate(steps):
            # pixel centres have whole coordinates, so the corner of the image is at -0.5
            matrix[k, 2] = (matrix[k, 2] - roi[k] + 0.5) / step - 0.5
            matrix[k, k] /= step
            sides[k : k + 1] = [(roi[2 + k] or side) // step for side in sides[k : k + 1]]
        return matrix, (sides[0], sides[1]) if size else None

    def matrix(self) -> Array:
        named = self._focals()
        path, numbers = self._values(_FOCALS[named]) if named is not None else self._matrix()
        if numbers.size == 4:
            x, y, u, v = numbers.tolist()
            numbers = np.array([x, 0.0, u, 0.0, y, v, 0.0, 0.0, 1.0])
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
        named = self._focals() or 0
        path, numbers = self._coefficients(_NAMED_FISHEYE[named] if model == FISHEYE else _NAMED)
        if numbers.size not in _COUNTS[model]:
            counts = " or ".join(map(str, _COUNTS[model][1:]))
            raise self._error(
                f"expected {counts} coefficients for {model}, got {numbers.size}", path
            )
        return numbers

    def size(self) -> tuple[int, int] | None:
        width, height, both = self._key(_WIDTH), self._key(_HEIGHT), self._key(_SIZE)
        if width is not None and height is not None:
            return self._side(width), self._side(height)
        if both is not None:
            sides = self._document.at(both)
            if not isinstance(sides, list) or len(sides) != 2:
                raise self._error("expected [width, height]", both)
            return self._side((*both, 0)), self._side((*both, 1))
        lonely = width or height
        if lonely is not None:
            other = _HEIGHT[0] if width else _WIDTH[0]
            raise self._error(f"has no counterpart {other!r}", lonely)
        return None

    def _focals(self) -> int | None:
        """Which of ``_FOCALS`` the file has."""
        return next((n for n, names in enumerate(_FOCALS) if self._key(names[:1])), None)

    def _matrix(self) -> tuple[KeyPath, Array]:
        return self._numbers(self._needed(_MATRIX))

    def _coefficients(self, names: tuple[str, ...]) -> tuple[KeyPath, Array]:
        """Path and numbers (n,) of a list, or of numbers with ``names``, of which any may lack."""
        if self._key(_COEFFICIENTS) is not None or self._focals() is None:
            return self._numbers(self._needed(_COEFFICIENTS))
        last = max((k for k, name in enumerate(names) if self._key((name,))), default=-1)
        known = [name for name in names[: last + 1] if self._key((name,))]
        path, numbers = self._values(known)
        values = dict(zip(known, numbers.tolist(), strict=True))
        return path, np.array([values.get(name, 0.0) for name in names[: last + 1]])

    def _values(self, names: Sequence[str]) -> tuple[KeyPath, Array]:
        """Path of the first, and numbers (n,) that have ``names``."""
        paths = [self._needed((name,)) for name in names]
        numbers = [self._number(self._document.at(path), path) for path in paths]
        return paths[0] if paths else (), np.array(numbers)

    def _pixels(self, *names: str) -> int:
        """The whole number at ``names``, 0 where there is none."""
        key = self._key(names[:1])
        value = None if key is None else self._document.at((*key, *names[1:]))
        if value is None:
            return 0
        if not isinstance(value, int) or not 0 <= value <= _MAX_SIDE:
            raise self._error(f"expected pixels, got {value!r:.40}", (*(key or ()), *names[1:]))
        return int(value)

    def _side(self, path: KeyPath) -> int:
        value = self._document.at(path)
        if not isinstance(value, int) or not 1 <= value <= _MAX_SIDE:
            raise self._error(f"expected pixels, 1 to {_MAX_SIDE}, got {value!r:.40}", path)
        return int(value)

    def _numbers(self, path: KeyPath) -> tuple[KeyPath, Array]:
        """Path and numbers (n,) of a matrix: a list, rows, text, or a mapping with ``data``."""
        value = self._document.at(path)
        if isinstance(value, dict):
            path = (*path, "data")
            value = value.get("data")
        if isinstance(value, str | float):
            value = str(value).split()
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

    def _key(self, names: Iterable[str]) -> KeyPath | None:
        """The path of the first of ``names`` that there is, whatever its case."""
        for place, prefix in self._places:
            node = self._document.at(place)
            keys = {key.lower(): key for key in node} if isinstance(node, dict) else {}
            for name in names:
                if (prefix + name).lower() in keys:
                    return (*place, keys[(prefix + name).lower()])
        return None

    def _needed(self, names: tuple[str, ...]) -> KeyPath:
        path = self._key(names)
        if path is None:
            near = did_you_mean(names[0], map(str, self._document.data))
            hint = f"; {near}" if near.startswith("did") else ""
            raise InputError(f"has no key {names[0]!r}{hint}", file=self._document.file)
        return path

    def _error(self, message: str, path: KeyPath) -> InputError:
        line = self._document.line_of(path)
        return InputError(message, file=self._document.file, line=line, key=key_text(path))
