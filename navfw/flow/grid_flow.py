"""Bases of flow processors: the regular grid, and the steps before and after matching."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from navfw import interfaces
from navfw.camera_geometry.rotations import rotate_points
from navfw.flow.aligned_past import align_past, visible_in_past
from navfw.flow.confidence import SIGMA_UNKNOWN, check_ramps, is_frozen
from navfw.flow.grid import check_frame, check_grid, grid_points
from navfw.numerics import Array, Image
from navfw.robot import RobotModel
from navfw.signals import FlowField, FramePair


class GridFlow(interfaces.FlowProcessor):
    """Base of processors whose field has one vector per cell of a regular grid."""

    class Params(interfaces.FlowProcessor.Params):
        """The grid. Each field ``..._low`` is checked to be less than its ``..._high``."""

        rows: Annotated[int, Field(ge=2, le=120, description="rows of the grid")] = 12
        cols: Annotated[int, Field(ge=2, le=160, description="columns of the grid")] = 16

        @model_validator(mode="after")
        def _ramps_rise(self) -> Self:
            check_ramps(self)
            return self

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p, camera = self.params, robot.camera
        check_grid(camera, p.rows, p.cols, self.name)
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
