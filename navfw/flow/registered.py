"""Coarse dense flow, refined in each cell by affine registration, with a sigma that is measured."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import cv2
import numpy as np
from pydantic import Field

from navfw.flow.grid_flow import MatchedFlow, ramp
from navfw.flow.registration import grid_windows, register_windows
from navfw.flow.registration_kernels import roughness
from navfw.numerics import Array, Image
from navfw.robot import RobotModel
from navfw.signals.immutability import read_only

#: Least standard deviation of a registered vector [px], however well the window fits.
_FLOOR = 0.035
#: Standard deviation [grey levels] of rounding to whole grey levels: residuals of images without
#: noise may be smaller by chance.
_ROUNDING = 0.29
#: Shares that count as standard deviation: of the bend of the field at a vector, of its
#: disagreement with both neighbours (``Registration.mixture``), and of its length. These,
#: ROUGHNESS_POWER and _USUAL_ROUGHNESS were fitted to the odd pairs of ``navfw bench flow``, so
#: that the shares within one and two sigmas are right for short and long, good and bad vectors.
_BEND_SHARE, _MIXTURE_SHARE, _LENGTH_SHARE = 0.70, 0.19, 0.0052
#: Power of the field's roughness by which all its sigmas are scaled: images with blur, or with a
#: motion that varies within windows, have errors that no single window's residual shows.
ROUGHNESS_POWER = 0.77
#: Roughness at which the parts above are the whole error.
_USUAL_ROUGHNESS = 1.17
#: Roughness that is assumed if too few neighbours are there to measure it, the least number of
#: triples for measuring, and the range that is believed.
UNKNOWN_ROUGHNESS, _MIN_TRIPLES, ROUGHNESS_RANGE = 1.5, 10, (0.6, 3.0)
#: Least score and least share inside the past image of the vectors that the roughness is taken of.
#: All others have confidence 0.
_LIKELY = 0.8, 0.6


class Registered(MatchedFlow):
    """Dense inverse search on a coarse scale, then affine registration of a window in each cell.

    OpenCV's dense inverse search finds large displacements at little cost. Around each cell's
    centre a window is registered from there (``register_windows``), which is more accurate than the
    finest scale of any of OpenCV's methods of equal cost, as it fits expansion and slant.

    A vector's sigma follows from the window's residual and gradients, from rounding, from the
    disagreement with its neighbours, from its length, and from the roughness of the whole field.
    Errors are longer along an edge in the image than across: were the two known exactly, one sigma
    for both would hold 42 to 47 % within one where it holds 86 % within two. Where the window
    matches, the confidence is that of a small sigma, and falls with its inverse square.

    Windows at the border are clipped to the image; the field's ``points`` are the centres of the
    clipped windows.
    """

    name: ClassVar[str] = "registered"

    class Params(MatchedFlow.Params):
        """Grid, windows, and limits of the confidence (METHOD 2.9)."""

        finest_scale: Annotated[
            int, Field(ge=0, le=3, description="finest level of the search, in halvings")
        ] = 2
        window: Annotated[int, Field(ge=6, le=128, description="side of a window [px]")] = 20
        stride: Annotated[
            int, Field(ge=1, le=8, description="sampling interval of registration [px]")
        ] = 2
        weight_width: Annotated[
            float,
            Field(ge=0.2, le=10.0, description="sigma of registration's weights [half windows]"),
        ] = 0.8
        registered_low: Annotated[
            float, Field(ge=0.8, lt=1.0, description="registered correlation: no match")
        ] = 0.85
        registered_high: Annotated[
            float, Field(gt=0.0, le=1.0, description="registered correlation: certain match")
        ] = 0.95
        sigma_full: Annotated[
            float, Field(gt=0.0, le=10.0, description="largest sigma of full confidence [px]")
        ] = 0.175
        sigma_max: Annotated[
            float, Field(gt=0.0, le=10.0, description="largest sigma of a useful vector [px]")
        ] = 1.0

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p, camera = self.params, robot.camera
        self._x_windows = x = grid_windows(camera.width, p.cols, p.window, 1)
        self._y_windows = y = grid_windows(camera.height, p.rows, p.window, 1)
        columns, rows = np.meshgrid(x.mean(axis=1), y.mean(axis=1))
        half = 0.5 * np.array([camera.width, camera.height])
        self._points = read_only(np.stack([columns, rows], axis=-1) - half)
        # a pixel's centre is half a pixel from its corner
        self._column = (columns - 0.5).astype(np.float32)
        self._row = (rows - 0.5).astype(np.float32)
        self._all = read_only(np.ones(self._points.shape[:2], np.bool_))
        self._dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._dis.setFinestScale(p.finest_scale)

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        p = self.params
        now, past = np.ascontiguousarray(now), np.ascontiguousarray(past)
        registration = register_windows(
            now,
            past,
            self._x_windows,
            self._y_windows,
            self._coarse(now, past),
            self._all,
            visible,
            p.stride,
            p.weight_width,
        )
        likely = (registration.score > _LIKELY[0]) & (registration.share > _LIKELY[1])
        grey = np.where(likely, registration.sensitivity, 0.0)
        variance = registration.sigma**2 + (_ROUNDING * grey) ** 2 + _FLOOR**2
        rough, bend = roughness(registration.vectors, variance, likely, _MIN_TRIPLES)
        rough = UNKNOWN_ROUGHNESS if math.isnan(rough) else rough
        rough = min(max(rough, ROUGHNESS_RANGE[0]), ROUGHNESS_RANGE[1])
        variance += (_BEND_SHARE * bend) ** 2 + (_MIXTURE_SHARE * registration.mixture) ** 2
        variance += _LENGTH_SHARE**2 * (registration.vectors**2).sum(axis=-1)
        sigma = (rough / _USUAL_ROUGHNESS) ** ROUGHNESS_POWER * np.sqrt(variance)
        confidence = ramp(registration.score, p.registered_low, p.registered_high)
        confidence *= ramp(registration.share, 0.6, 0.9)
        confidence *= np.minimum((p.sigma_full / sigma) ** 2, 1.0) * (sigma <= p.sigma_max)
        return registration.vectors, confidence, sigma

    def _coarse(self, now: Image, past: Image) -> Array:
        """Displacements (rows, cols, 2) [px], now - past, of the windows by dense search."""
        start = np.zeros((*now.shape, 2), np.float32)
        dense = self._dis.calc(now, past, start)
        back = cv2.remap(dense, self._column, self._row, cv2.INTER_LINEAR)
        return -np.asarray(back, dtype=np.float64)
