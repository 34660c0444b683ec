"""The regular sparse grid of image points at which flow is measured (paper sec 3)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.robot import CameraModel
from navfw.signals import FlowField, Frame
from navfw.signals.immutability import read_only


def above_horizon(flow: FlowField, camera: CameraModel) -> FlowField:
    """``flow`` with confidence 0 below the horizon, where a ray may meet the floor (METHOD 2.8)."""
    falls = flow.points[..., 1] * math.cos(camera.pitch) + camera.focal * math.sin(camera.pitch)
    return dataclasses.replace(flow, confidence=np.where(falls > 0.0, 0.0, flow.confidence))


def check_grid(camera: CameraModel, rows: int, cols: int, owner: str) -> None:
    """Check that ``rows`` x ``cols`` equal cells fill the camera's image.

    Raises:
        ConfigError: the image's height or width is not a multiple. The key in the message starts
            with ``owner``, the plugin's name.

    """
    for key, count, side, size in (
        ("rows", rows, "height", camera.height),
        ("cols", cols, "width", camera.width),
    ):
        if size % count:
            divisors = [n for n in range(4, size // 4 + 1) if size % n == 0]
            nearest = sorted(sorted(divisors, key=lambda n: abs(n - count))[:4])
            possible = ", ".join(map(str, nearest)) or "none"
            raise ConfigError(
                f"{count} cells cannot divide the image {side} of {size} px equally; "
                f"possible nearby: {possible}",
                key=f"{owner}.{key}",
            )


def grid_points(camera: CameraModel, rows: int, cols: int) -> Array:
    """(rows, cols, 2) centres of the grid's cells [px, relative to the principal point]."""
    x = (np.arange(cols) + 0.5) * (camera.width / cols) - 0.5 * camera.width
    y = (np.arange(rows) + 0.5) * (camera.height / rows) - 0.5 * camera.height
    return read_only(np.stack(np.meshgrid(x, y), axis=-1))


def check_frame(frame: Frame, camera: CameraModel) -> None:
    """Check that ``frame`` has the camera's size and is uint8 luminance.

    Raises:
        ConfigError: size or type differ.

    """
    image = frame.image
    if image.shape != (camera.height, camera.width) or image.dtype != np.uint8:
        found = " x ".join(map(str, image.shape[::-1]))
        raise ConfigError(
            f"the frame at {frame.time:.3f} s is {found} {image.dtype}, but the camera model "
            f"specifies {camera.width} x {camera.height} uint8 luminance",
            key="camera",
        )
