"""Read camera calibrations of OpenCV, ROS, Kalibr, EuRoC, VINS and ORB-SLAM."""

from __future__ import annotations

import contextlib
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
"""Model names of lenses whose model follows from the number of coefficients."""
_REFUSED = {"omni", "mei", "ds", "eucm", "fov", "scaramuzza"}
"""Models of Kalibr and VINS that are not supported, even if the file names another, too."""
# names of the same thing, whatever their case: OpenCV's programs; ROS's camera_info files and
# messages; cameracalibrator's ost.txt; Kalibr and EuRoC
_MATRIX = ("camera_matrix", "cameramatrix", "camera matrix", "k", "intrinsics")
_COEFFICIENTS = (
    *("distortion_coefficients", "dist_coeffs", "distcoeffs", "dist_coeff"),
    *("distortion_coeffs", "distortion", "d"),
)
_FOCALS = (("fx", "fy", "cx", "cy"), ("mu", "mv", "u0", "v0"))
"""Names of the numbers of a camera matrix: of ORB-SLAM and VINS, and of VINS's fisheyes."""
_NAMED = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""Names of coefficients in OpenCV's order; those of VINS's fisheyes begin with k2."""
_PARTS = ("distortion_parameters", "mirror_parameters")
_WIDTH = ("image_width", "width", "imagewidth", "cols")
_HEIGHT = ("image_height", "height", "imageheight", "rows")
_SIZE = ("image_size", "imagesize", "resolution")
_MODEL = ("distortion_model", "camera_model", "model_type", "model", "type")
_FISHEYE_FLAG = ("fisheye_model", "fisheye")
_MAX_SIDE = 20_000  # chosen
"""Longest side of an image [px]."""
_CENTRAL = (0.2, 0.3)  # chosen
"""Least share of the image on each side of the principal point, and if images are binned."""


def load_calibration(path: Path, camera: str | None = None) -> CameraCalibration:
    """Load the calibration in a file; nothing in the file is ever executed.

    It is YAML of OpenCV, ROS, Kalibr, EuRoC, VINS or ORB-SLAM, XML of OpenCV, or the text of
    cameracalibrator. ``camera`` is the name or topic of one of several cameras in it; for binned
    and cut images the keys of ``camera_info`` apply (REP 104).

    Raises:
        InputError: the file cannot be read, is none of these, or lacks a camera matrix or
            coefficients; a number is missing, no number or out of range; the model is not
            supported; there are several cameras, and none is named; with file and line.

    """
    return read_calibration(read_input_text(path), shown_path(path), camera)


def read_calibration(text: str, file: str, camera: str | None = None) -> CameraCalibration:
    """Parse the ``text`` of a calibration ``file``; see ``load_calibration``."""
    if text.lstrip().startswith("<"):
        document = _xml_document(text, file)
    else:
        document = parse_yaml(_plain_yaml(text, file), file)
    if not isinstance(document.data, dict):
        raise InputError("expected a calibration ('camera_matrix: ...')", file=file)
    reader = _Reader(document, camera)
    matrix, size = reader.of_the_image()
    model = reader.model()
    return CameraCalibration(file, matrix, reader.coefficients(model), model, size)


def _plain_yaml(text: str, file: str) -> str:
    """Return ``text`` as standard YAML, with the same lines.

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
    """Return the content of OpenCV's XML as if it were YAML."""
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
    """The checked parts of a calibration ``document``; those of ``camera`` if it has several."""

    def __init__(self, document: YamlDocument, camera: str | None) -> None:
        self._document = document
        self._paths: dict[str, KeyPath] = {}
        places = [((), ""), ((), "Camera."), *(((part,), "") for part in _PARTS)]
        for place, prefix in [*places, *self._camera(camera)]:
            node = document.at(place)
            keys = [key for key in node if key.startswith(prefix)] if isinstance(node, dict) else []
            self._paths |= {key.removeprefix(prefix).lower(): (*place, key) for key in keys}

    def _camera(self, wanted: str | None) -> list[tuple[KeyPath, str]]:
        """Return where the ``wanted`` camera's numbers are: below a key, or behind a prefix."""
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
        keys = [self._paths[name] for name in _MODEL if name in self._paths]
        written = [str(self._document.at(key)).strip() for key in keys]
        said = [name.lower() for name in written]
        known = [model for name in said if (model := _OTHER_NAMES.get(name, name)) in _COUNTS]
        for name, key, text in zip(said, keys, written, strict=True):
            if name in _REFUSED or not (known or name in _BY_COUNT):
                hint = "calibrate as a pinhole camera with radtan or equidistant distortion"
                hint = hint if name in _REFUSED else did_you_mean(name, [*_COUNTS, *_OTHER_NAMES])
                raise self._error(f"the model {text!r} is not supported: {hint}", key)
        flag = self._key(_FISHEYE_FLAG)
        if flag and not said and self._document.at(flag) == 1:
            return FISHEYE
        few = self._coefficients(_NAMED)[1].size <= 5
        return [*known, "plumb_bob" if few else "rational_polynomial"][0]

    def of_the_image(self) -> tuple[Array, tuple[int, int] | None]:
        """Return matrix and size of the image as sent: cut out of the sensor's, and binned."""
        matrix, size = self.matrix(), self.size()
        steps = [max(self._pixels(self._paths.get(f"binning_{axis}", ())), 1) for axis in "xy"]
        for k, side in enumerate(size or ()):
            least = _CENTRAL[max(steps) > 1]
            if not least < matrix[k, 2] / side < 1.0 - least:
                what = f"its principal point {matrix[k, 2]:g} is not near the middle of {side} px"
                why = "the camera matrix is that of another size, or was binned already"
                key = self._key((*_MATRIX, *(names[2 + k] for names in _FOCALS))) or ()
                raise self._error(f"{what}: {why}", key)
        part = self._paths.get("roi", ("roi",))
        roi = [self._pixels((*part, name)) for name in ("x_offset", "y_offset", "width", "height")]
        for k, step in enumerate(steps):
            # pixel centres have whole coordinates, so the corner of the image is at -0.5
            matrix[k, 2] = (matrix[k, 2] - roi[k] + 0.5) / step - 0.5
            matrix[k, k] /= step
        if size is None:
            return matrix, None
        return matrix, ((roi[2] or size[0]) // steps[0], (roi[3] or size[1]) // steps[1])

    def matrix(self) -> Array:
        named = next((names for names in _FOCALS if names[0] in self._paths), None)
        if named is None:
            path, numbers = self._numbers(self._needed(_MATRIX))
        else:
            path = self._paths[named[0]]
            numbers = np.array([self._number(self._needed((name,))) for name in named])
        if numbers.size == 4:
            x, y, u, v = numbers.tolist()
            numbers = np.array([x, 0.0, u, 0.0, y, v, 0.0, 0.0, 1.0])
        if numbers.size != 9:
            raise self._error(f"expected 3 x 3 numbers, got {numbers.size}", path)
        matrix: Array = numbers.reshape(3, 3)
        fx, fy = matrix[0, 0], matrix[1, 1]
        if not (min(fx, fy) > 1.0 and max(fx, fy) < 1e5 and 0.5 < fx / fy < 2.0):
            raise self._error(f"expected focal lengths in pixels, got {fx:g} and {fy:g}", path)
        if np.abs(matrix[1:, 0]).max() > 0.0 or matrix[2].tolist() != [0.0, 0.0, 1.0]:
            raise self._error("expected the rows fx 0 cx, 0 fy cy, 0 0 1", path)
        if abs(matrix[0, 1]) > 0.01 * fx:
            raise self._error(f"expected no skew, got {matrix[0, 1]:g} px", path)
        return matrix

    def coefficients(self, model: str) -> Array:
        first = int(model == FISHEYE and "k1" not in self._paths)
        fisheye = [f"k{number + first}" for number in (1, 2, 3, 4)]
        path, numbers = self._coefficients(fisheye if model == FISHEYE else _NAMED)
        if numbers.size not in _COUNTS[model]:
            counts = " or ".join(map(str, _COUNTS[model][1:]))
            what = f"expected {counts} coefficients for {model}, got {numbers.size}"
            raise self._error(what, path)
        return numbers

    def size(self) -> tuple[int, int] | None:
        both = self._key(_SIZE)
        if self._key(_WIDTH + _HEIGHT) is not None:
            sides = self._needed(_WIDTH), self._needed(_HEIGHT)
        elif both is None:
            return None
        else:
            sides = (*both, 0), (*both, 1)
        return self._pixels(sides[0], 1), self._pixels(sides[1], 1)

    def _coefficients(self, names: Sequence[str]) -> tuple[KeyPath, Array]:
        """Return path and numbers (n,) of a list, or of numbers with ``names``, 0 if missing."""
        if self._key((*_COEFFICIENTS, *_MATRIX)) is not None:
            return self._numbers(self._needed(_COEFFICIENTS))
        last = max((k for k, name in enumerate(names, 1) if name in self._paths), default=0)
        paths = [self._paths.get(name) for name in names[:last]]
        return (), np.array([0.0 if path is None else self._number(path) for path in paths])

    def _pixels(self, path: KeyPath, least: int = 0) -> int:
        """Return the whole number at ``path``; 0 where there is none, if that is not too little."""
        value = self._document.at(path)
        if not path or (value is None and least == 0):
            return 0
        if not isinstance(value, int) or not least <= value <= _MAX_SIDE:
            raise self._error(f"expected pixels, {least} to {_MAX_SIDE}, got {value!r:.40}", path)
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
        return path, np.array([self._as_number(cell, path) for row in rows for cell in row])

    def _number(self, path: KeyPath) -> float:
        return self._as_number(self._document.at(path), path)

    def _as_number(self, value: Any, path: KeyPath) -> float:
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            if not isinstance(value, bool) and math.isfinite(number := float(value)):
                return number
        raise self._error(f"{value!r:.40} is not a number", path)

    def _key(self, names: Iterable[str]) -> KeyPath | None:
        """Return the path of the first of ``names`` that there is."""
        return next((self._paths[name] for name in names if name in self._paths), None)

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
