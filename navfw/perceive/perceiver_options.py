"""Options of the perceiver: the camera, its motion, and the flow processor."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.errors import InputError
from navfw.perceive.gyro_record import GyroRecord
from navfw.perceive.working_size import HFOV

__all__ = ["LONGEST", "PerceiverOptions"]

LONGEST = 15
"""Largest distance between the images of a pair [images]."""


@dataclass(frozen=True, slots=True)
class PerceiverOptions:
    """Known properties of the camera and its motion, and the flow processor.

    ``hfov`` [deg] is the horizontal field of view of the original images; ``speed`` [m/s] ahead,
    None or 0 if unknown; ``height`` [m] of the camera above the floor, None if unknown; ``pitch``
    [deg] nose down; ``flow`` the name of the plugin, on a grid of ``rows`` x ``cols``; ``stride``
    [images] from the first to the second image of a pair, None to adapt it to the flow.

    Raises:
        InputError: a value is out of its range.

    """

    hfov: float = 65.0
    speed: float | None = None
    height: float | None = None
    pitch: float = 0.0
    flow: str = "block_matching"
    rows: int = 12
    cols: int = 16
    stride: int | None = None
    gyro: GyroRecord | None = None

    def __post_init__(self) -> None:
        for option, value, low, high, unit in (
            ("--hfov", self.hfov, *HFOV, "deg"),
            ("--speed", self.speed, 0.0, 100.0, "m/s"),
            ("--height", self.height, 0.05, 20.0, "m"),
            ("--pitch", self.pitch, -45.0, 45.0, "deg"),
            ("--grid rows", self.rows, 4, 60, "cells"),
            ("--grid columns", self.cols, 4, 80, "cells"),
            ("--stride", self.stride, 1, LONGEST, "images"),
        ):
            if value is not None and not low <= value <= high:
                raise InputError(
                    f"must be between {low:g} and {high:g} {unit}, got {value:g}", key=option
                )
