"""Options of the perceiver, its assumptions on a camera that is not known, and working images.

Images are scaled and cropped to a size that the flow's grid divides.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import cv2
import numpy as np

from navfw.assumption import Assumption
from navfw.errors import InputError
from navfw.numerics import Array, Image
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.motion_record import MotionRecord
from navfw.robot import CameraModel

HFOV = (15.0, 155.0)
"""Smallest and largest horizontal field of view [deg] of a pinhole camera."""
_AREA = 160 * 120
"""Area of the paper's images [px^2], for which windows and search range are chosen."""
_CONTRAST, _TEXTURED = 6.0, 0.3
"""Standard deviation [grey levels] in a cell with texture; share of such cells in a textured
image."""
_MIN_SIDE = 24
"""Least side of an image [px], the side of a window of block matching."""


@dataclass(frozen=True, slots=True)
class WorkingSize:
    """Conversion of images (``width`` x ``height`` px) to working images for the flow.

    Images are scaled by ``scale`` along both axes, then cropped around the centre to ``cut_width``
    x ``cut_height``, multiples of the grid.
    """

    width: int
    height: int
    scale: float
    cut_width: int
    cut_height: int

    @classmethod
    def of(cls, width: int, height: int, rows: int, cols: int) -> WorkingSize:
        """Find the working size closest to the paper's with the least cropping.

        Raises:
            InputError: the images are too small, or far too long for the grid.

        """
        if min(width, height) < _MIN_SIDE:
            raise InputError(
                f"images of {width} x {height} px are too small; at least {_MIN_SIDE} px are "
                "needed per side"
            )
        best: tuple[float, WorkingSize] | None = None
        for cell_width in range(2, 1 + math.ceil(math.sqrt(4 * _AREA * width / height) / cols)):
            cut_width = cell_width * cols
            exact = cut_width * height / (width * rows)  # with the least cropping
            for cell_height in {math.floor(exact), math.ceil(exact)} - {0, 1}:
                cut_height = cell_height * rows
                scale = max(cut_width / width, cut_height / height)
                kept = cut_width * cut_height / (scale * scale * width * height)
                area = cut_width * cut_height / _AREA
                if not (32 <= cut_width <= 1920 and _MIN_SIDE <= cut_height <= 1080):
                    continue  # as CameraModel
                if area > 4.0:
                    continue
                # a factor of two in area costs as much as 15 % cropping
                cost = (1.0 - kept) + 0.15 * abs(math.log2(area))
                if best is None or cost < best[0] - 1e-9:
                    best = cost, cls(width, height, scale, cut_width, cut_height)
        if best is None:
            raise InputError(
                f"a grid of {rows} x {cols} does not fit images of {width} x {height} px"
            )
        return best[1]

    def camera(self, hfov: float, height: float, pitch: float, rate: float) -> CameraModel:
        """Return the camera model of the working images.

        ``hfov`` [rad] is the horizontal field of view of the original images, ``height`` [m] that
        of the camera above the floor, ``pitch`` [rad] nose down, ``rate`` [1/s].
        """
        focal = 0.5 * self.scale * self.width / math.tan(0.5 * hfov)
        return CameraModel(
            width=self.cut_width,
            height=self.cut_height,
            hfov=2.0 * math.atan(0.5 * self.cut_width / focal),
            mount_height=height,
            mount_forward=0.0,
            pitch=pitch,
            rate=rate,
        )

    def prepare(self, image: Image) -> Image:
        """Return the grey working image (cut_height, cut_width) of ``image`` (height, width, 3)."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        width = max(round(self.scale * self.width), self.cut_width)
        height = max(round(self.scale * self.height), self.cut_height)
        way = cv2.INTER_AREA if self.scale < 1.0 else cv2.INTER_LINEAR
        scaled = cv2.resize(grey, (width, height), interpolation=way)
        x, y = (width - self.cut_width) // 2, (height - self.cut_height) // 2
        cut = scaled[y : y + self.cut_height, x : x + self.cut_width]
        return np.ascontiguousarray(cut, dtype=np.uint8)

    def to_image(self, points: Array) -> Array:
        """Convert ``points`` (..., 2) [px from the working image's centre] to the original [px]."""
        return points / self.scale + 0.5 * np.array([self.width, self.height])


def are_alike(past: Image, now: Image) -> bool:
    """Return whether two grey images (height, width) with some contrast show no difference."""
    change = np.abs(now.astype(np.int16) - past).mean()
    return bool(change < 0.1 * now.std() and now.std() > 4.0)


def has_texture(image: Image, shape: tuple[int, int]) -> bool:
    """Return whether enough cells of a grid of ``shape`` over a grey image have contrast."""
    grey, size = image.astype(np.float32), shape[::-1]
    mean, squares = (cv2.resize(i, size, interpolation=cv2.INTER_AREA) for i in (grey, grey**2))
    contrast = np.sqrt(np.maximum(squares - np.square(mean), 0.0))
    return float((contrast > _CONTRAST).mean()) > _TEXTURED


_USUAL_VIEW = 65.0
"""Field of view [deg] along the longer side of an image that is assumed if none is given: that of
the main camera of telephones."""
GRID = (12, 16)
"""Rows and columns of the flow, as in the paper, for images wider than high."""
MAX_SPEED = 100.0
"""Largest speed of the camera [m/s]."""
MAX_STRIDE = 15
"""Largest distance between the images of a pair [images]."""


@dataclass(frozen=True, slots=True)
class PerceiverOptions:
    """Known properties of the camera and its motion, and the flow processor.

    ``hfov`` [deg] is the horizontal field of view of the original images, None if unknown;
    ``speed`` [m/s] the forward speed, None or 0 if unknown; ``height`` [m] that of the camera above
    the floor, None if unknown; ``pitch`` [deg] nose down, None if unknown: 0 is then assumed;
    ``flow`` the name of the plugin, on a ``grid`` of (rows, columns), None to choose it by the
    images; ``stride`` [images] the distance between the images of a pair, None to adapt it to the
    flow; ``gyro`` the record of the camera's motion: gyro rates, or poses.

    Raises:
        InputError: a value is out of its range.

    """

    hfov: float | None = None
    speed: float | None = None
    height: float | None = None
    pitch: float | None = None
    flow: str = "registered"
    grid: tuple[int, int] | None = None
    stride: int | None = None
    gyro: MotionRecord | None = None

    def __post_init__(self) -> None:
        rows, cols = self.grid or GRID
        for option, value, low, high, unit in (
            ("--hfov", self.hfov, *HFOV, "deg"),
            ("--speed", self.speed, 0.0, MAX_SPEED, "m/s"),
            ("--height", self.height, 0.05, 20.0, "m"),
            ("--pitch", self.pitch, -45.0, 45.0, "deg"),
            ("--grid rows", rows, 4, 60, "cells"),
            ("--grid columns", cols, 4, 80, "cells"),
            ("--stride", self.stride, 1, MAX_STRIDE, "images"),
        ):
            if value is not None and not low <= value <= high:
                raise InputError(
                    f"must be between {low:g} and {high:g} {unit}, got {value:g}", key=option
                )

    def grid_for(self, width: int, height: int) -> tuple[int, int]:
        """Return rows and columns of the flow for images of ``width`` x ``height`` px.

        If no grid is given, the larger number is along the longer side: cells are then about
        square.
        """
        if self.grid is not None:
            return self.grid
        return GRID if width >= height else GRID[::-1]

    def angle_of_view(self, width: int, height: int, calibrated: float | None) -> float:
        """Return the horizontal field of view [rad] of images of ``width`` x ``height`` px.

        ``calibrated`` [rad] is that of a calibration. Without one, and without ``hfov``, the longer
        side of the images shows ``_USUAL_VIEW``.
        """
        if calibrated is not None:
            return calibrated
        if self.hfov is not None:
            return math.radians(self.hfov)
        along = math.tan(0.5 * math.radians(_USUAL_VIEW))
        return 2.0 * math.atan(along * width / max(width, height))

    def speed_between(self, begin: float, end: float) -> float | None:
        """Return the speed [m/s] between two times [s], given or by the record, or None."""
        if self.speed or self.gyro is None:
            return self.speed or None
        way = self.gyro.translation_between(begin, end)
        if way is None:
            return None
        speed = float(np.linalg.norm(way)) / (end - begin)
        return speed if 0.0 < speed <= MAX_SPEED else None  # where poses jump, none

    def assumptions(self, source: ImageSource, size: WorkingSize) -> list[Assumption]:
        """List what results for images of ``source`` assume; nothing on the motion."""
        assumed = []
        if source.hfov is None:
            view = math.degrees(self.angle_of_view(size.width, size.height, None))
            reason, option = "of the main camera of a telephone", "--hfov, --calibration"
            what = Assumption("horizontal field of view", f"{view:.3g} degrees", reason, option)
            assumed += [what] if self.hfov is None else []
            assumed.append(Assumption("lens distortion", "none", "", "--calibration"))
        if self.pitch is None:
            assumed.append(Assumption("pitch", "0 degrees until the floor shows it", "", "--pitch"))
        return [*assumed, *source.assumed, *(() if self.gyro is None else self.gyro.assumed)]


def parse_grid(text: str) -> tuple[int, int]:
    """Return rows and columns of a grid such as ``12x16``.

    Raises:
        InputError: ``text`` is not of that form.

    """
    match = re.fullmatch(r"\s*([0-9]{1,3})\s*[xX*]\s*([0-9]{1,3})\s*", text)
    if match is None:
        raise InputError(f"expected ROWSxCOLUMNS such as 12x16, got {text!r}", key="--grid")
    return int(match[1]), int(match[2])
