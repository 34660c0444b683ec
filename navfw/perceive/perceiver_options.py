"""Options of the perceiver, and what it assumes about the camera where nothing is given."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navfw.errors import InputError
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.motion_record import MotionRecord
from navfw.perceive.working_size import HFOV, WorkingSize

_USUAL_VIEW = 65.0
"""Field of view along the longer side of an image that is assumed if none is given [deg]: that of
the main camera of telephones."""
GRID = (12, 16)
"""Rows and columns of the flow that the paper has for images wider than high."""
MAX_SPEED = 100.0
"""Largest speed of the camera [m/s]."""
MAX_STRIDE = 15
"""Largest distance between the images of a pair [images]."""


@dataclass(frozen=True, slots=True)
class PerceiverOptions:
    """Known properties of the camera and its motion, and the flow processor.

    ``hfov`` [deg] is the horizontal field of view of the original images, None if unknown;
    ``speed`` [m/s] ahead, None or 0 if unknown; ``height`` [m] of the camera above the floor, None
    if unknown; ``pitch`` [deg] nose down, None if unknown: 0 is then assumed; ``flow`` the name of
    the plugin, on a ``grid`` of (rows, columns), None to choose it by the images; ``stride``
    [images] from the first to the second image of a pair, None to adapt it to the flow; ``gyro``
    the record that measured the camera's motion: of a gyro, or poses.

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
        """Rows and columns of the flow for images of ``width`` x ``height`` px.

        If none are given, the larger number is along the longer side: cells are then about square.
        """
        if self.grid is not None:
            return self.grid
        return GRID if width >= height else GRID[::-1]

    def angle_of_view(self, width: int, height: int, calibrated: float | None) -> float:
        """Horizontal field of view [rad] of images of ``width`` x ``height`` px.

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
        """Speed [m/s] between two times [s]: as given, else by the record; None if unknown."""
        if self.speed or self.gyro is None:
            return self.speed or None
        way = self.gyro.translation_between(begin, end)
        if way is None:
            return None
        speed = float(np.linalg.norm(way)) / (end - begin)
        return speed if 0.0 < speed <= MAX_SPEED else None  # where poses jump, none


def assumptions(
    options: PerceiverOptions, source: ImageSource, size: WorkingSize
) -> dict[str, float | str]:
    """What the results for images of ``source`` assume; a key is missing where it was given.

    ``hfov_deg`` [deg] is the horizontal field of view, ``pitch_deg`` [deg] the camera's pitch,
    ``distortion`` that of the lens, ``fps`` [1/s] the frame rate. Of the motion nothing is assumed.
    """
    assumed: dict[str, float | str] = {}
    if options.hfov is None and source.hfov is None:
        view = options.angle_of_view(size.width, size.height, None)
        assumed["hfov_deg"] = round(math.degrees(view), 1)
    if source.hfov is None:
        assumed["distortion"] = "none"
    if options.pitch is None:
        assumed["pitch_deg"] = 0.0
    if not source.rate_known:
        assumed["fps"] = source.rate
    return assumed


def assumptions_line(assumed: Mapping[str, float | str]) -> str:
    """The assumptions in one line, with the options that replace them."""
    words = {
        "hfov_deg": "horizontal field of view {:g} degrees (--hfov, --calibration)",
        "distortion": "lens distortion {} (--calibration)",
        "pitch_deg": "pitch {:g} degrees until the floor shows it (--pitch)",
        "fps": "{:g} images a second (--fps, --times)",
    }
    return "assumed: " + ", ".join(words[key].format(value) for key, value in assumed.items())
