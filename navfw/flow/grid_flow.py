"""The regular sparse grid of image points at which flow is measured, and bases of processors."""

from __future__ import annotations

import dataclasses
import math
from abc import abstractmethod
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from navfw import interfaces
from navfw.camera_geometry.rotations import rotate_points
from navfw.errors import ConfigError
from navfw.flow.aligned_past import align_past, visible_in_past
from navfw.flow.confidence import SIGMA_UNKNOWN, is_frozen
from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import FlowField, Frame, FramePair
from navfw.signals.immutability import read_only


def above_horizon(flow: FlowField, camera: CameraModel) -> FlowField:
    """``flow`` with confidence 0 below the horizon, where a ray may meet the floor (METHOD 2.8)."""
    falls = flow.points[..., 1] * math.cos(camera.pitch) + camera.focal * math.sin(camera.pitch)
    return dataclasses.replace(flow, confidence=np.where(falls > 0.0, 0.0, flow.confidence))


def _check_grid(camera: CameraModel, rows: int, cols: int, owner: str) -> None:
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
        size = " x ".join(map(str, image.shape[::-1]))
        raise ConfigError(
            f"the frame at {frame.time:.3f} s is {size} {image.dtype}, but the camera model "
            f"specifies {camera.width} x {camera.height} uint8 luminance",
            key="camera",
        )


class GridFlow(interfaces.FlowProcessor):
    """Base of processors whose field has one vector per cell of a regular grid."""

    class Params(interfaces.FlowProcessor.Params):
        """The grid. Each field ``..._low`` is checked to be less than its ``..._high``."""

        rows: Annotated[int, Field(ge=2, le=120, description="rows of the grid")] = 12
        cols: Annotated[int, Field(ge=2, le=160, description="columns of the grid")] = 16

        @model_validator(mode="after")
        def _ramps_rise(self) -> Self:
            for low in type(self).model_fields:
                high = low.removesuffix("_low") + "_high"
                if low.endswith("_low") and getattr(self, low) >= getattr(self, high):
                    raise ValueError(
                        f"{low} {getattr(self, low)} is not below {high} {getattr(self, high)}"
                    )
            return self

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p, camera = self.params, robot.camera
        _check_grid(camera, p.rows, p.cols, self.name)
        self._points = grid_points(camera, p.rows, p.cols)


class MatchedFlow(GridFlow):
    """Base of processors that match two images.

    The past image is first warped by the camera's known rotation, so that the method has to match
    the translational part only. The resulting field contains the whole motion again.
    """

    @abstractmethod
    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        """Match ``now`` with ``past``, which is already warped into the current axes.

        ``visible`` (left, right, top, bottom) limits the pixels of ``past`` that come from the past
        image. Returns vectors (rows, cols, 2) [px], now - past; confidence (rows, cols); and sigma
        (rows, cols) [px].
        """

    def compute(self, pair: FramePair) -> FlowField:
        """Flow from ``pair.past`` to ``pair.now``, with confidence and sigma of each cell.

        Raises:
            ConfigError: size or type of a frame is not the camera's.

        """
        camera, rotation = self.robot.camera, pair.motion.rotation
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        past = align_past(pair.past.image, rotation, camera)
        visible = visible_in_past(rotation, camera)
        vectors, confidence, sigma = self._match(pair.now.image, past, visible)
        if is_frozen(pair, camera):
            confidence[:] = 0.0
        origins = rotate_points(self._points - vectors, rotation.T, camera.focal)
        return FlowField(
            time=pair.now.time,
            points=self._points,
            vectors=self._points - origins,
            confidence=confidence,
            sigma=np.where(confidence > 0.0, np.minimum(sigma, SIGMA_UNKNOWN), SIGMA_UNKNOWN),
            motion=pair.motion,
        )
