"""OpenCV's flow by Farneback, and pyramidal Lucas-Kanade at the centre of each grid cell."""

from __future__ import annotations

from typing import Annotated, ClassVar

import cv2
import numpy as np
from pydantic import Field

from navfw import Array, Image, RobotModel
from navfw.flow import grid_flow
from navfw.flow.opencv_flow import SIGMA_FLOOR, TEXTURE, DenseFlow
from navfw.numerics.arrays import Floats


class Farneback(DenseFlow):
    """OpenCV's Farneback flow, one mean vector per grid cell (Farneback 2003).

    Each neighbourhood of both images is approximated by a quadratic polynomial; the displacement
    follows from the change of its coefficients, from coarse to fine levels of a pyramid.
    """

    name: ClassVar[str] = "farneback"

    class Params(grid_flow.MatchedFlow.Params):
        """Grid, limits of the confidence (METHOD 2.9), and the averaging window."""

        window: Annotated[int, Field(ge=5, le=63, description="averaging window [px]")] = 9

    params: Params

    def dense(self, now: Image, past: Image) -> Floats:
        """See ``DenseFlow.dense``."""
        start: Floats = np.zeros((*now.shape, 2), dtype=np.float32)
        flow = cv2.calcOpticalFlowFarneback(
            now,
            past,
            start,
            pyr_scale=0.5,
            levels=3,
            winsize=self.params.window,
            iterations=3,
            poly_n=5,
            poly_sigma=1.1,  # as OpenCV recommends for a neighbourhood of 5 px
            flags=0,
        )
        return np.asarray(flow, dtype=np.float32)


_WINDOW, _LEVELS = 11, 2
"""Side of a window [px], and halvings of the image."""
_RETURN_LOW, _RETURN_HIGH = 0.3, 1.0
"""Forward-backward errors of a certain match and of no match [px]."""
_RESIDUAL_LOW, _RESIDUAL_HIGH = 0.35, 0.7
"""Residuals over contrast of a certain match and of no match."""
#: Factor that scales the noise model to the errors measured on rendered frames.
_NOISE_SCALE = 1.3
#: Shares that count as standard deviation: of the forward-backward error, and of the variation
#: between cells.
_RETURN_SHARE, _VARIATION_SHARE = 0.5, 0.25


class LucasKanade(grid_flow.MatchedFlow):
    """Pyramidal Lucas-Kanade at the centres of the cells, with a forward-backward check.

    Confidence requires texture in both directions, a small forward-backward error, and agreement of
    the image patches.
    """

    name: ClassVar[str] = "lucas_kanade"

    def __init__(
        self, robot: RobotModel, params: grid_flow.MatchedFlow.Params | None = None
    ) -> None:
        super().__init__(robot, params)
        self._seeds = self._points + 0.5 * np.array([robot.camera.width, robot.camera.height]) - 0.5

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        origins, returned, residual = self._track(now, past, visible)
        gradient, contrast = _texture(now, self._seeds, _WINDOW)
        trust = 1.0 - grid_flow.ramp(returned, _RETURN_LOW, _RETURN_HIGH)
        trust *= 1.0 - grid_flow.ramp(
            residual / np.maximum(contrast, 1.0), _RESIDUAL_LOW, _RESIDUAL_HIGH
        )
        trust *= grid_flow.ramp(gradient, *TEXTURE)
        noise = _NOISE_SCALE * residual / (np.maximum(gradient, 0.1) * _WINDOW)
        variance = noise**2 + (_RETURN_SHARE * np.minimum(returned, grid_flow.SIGMA_UNKNOWN)) ** 2
        vectors = self._seeds - origins
        spread = _VARIATION_SHARE * grid_flow.local_spread(vectors, trust)
        return vectors, trust, np.sqrt(variance + spread**2 + SIGMA_FLOOR**2)

    def _track(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        """Positions of the seeds in ``past``, forward-backward error [px] and residual [grey].

        The error of lost points is infinite.
        """
        size = (_WINDOW, _WINDOW)
        seeds = self._seeds.reshape(-1, 1, 2).astype(np.float32)
        origins, is_tracked, error = cv2.calcOpticalFlowPyrLK(
            now, past, seeds, seeds.copy(), winSize=size, maxLevel=_LEVELS
        )
        back, is_returned, _ = cv2.calcOpticalFlowPyrLK(
            past, now, origins, np.array(origins), winSize=size, maxLevel=_LEVELS
        )
        origins, is_tracked, error = np.asarray(origins), np.asarray(is_tracked), np.asarray(error)
        shape = self._seeds.shape[:-1]
        off = np.linalg.norm(np.asarray(back) - seeds, axis=-1).reshape(shape).astype(np.float64)
        x, y = origins[:, 0, 0].reshape(shape), origins[:, 0, 1].reshape(shape)
        good = (is_tracked.reshape(shape) > 0) & (np.asarray(is_returned).reshape(shape) > 0)
        good &= grid_flow.is_visible(x, y, visible)
        return (
            origins.reshape(*shape, 2).astype(np.float64),
            np.where(good, off, np.inf),
            # the residual of a lost point is undefined
            np.where(good, error.reshape(shape), np.float32(255.0)).astype(np.float64),
        )


def _texture(image: Image, seeds: Array, window: int) -> tuple[Array, Array]:
    """Gradient [grey/px] in its weakest direction and deviation [grey] of the seeds' windows."""
    size = (window, window)
    at = np.rint(seeds).astype(np.int64)
    column = at[..., 0].clip(0, image.shape[1] - 1)
    row = at[..., 1].clip(0, image.shape[0] - 1)
    xx, yy, xy = (
        np.asarray(cv2.boxFilter(product, -1, size), np.float32)[row, column]
        for product in grid_flow.gradient_products(image)
    )
    grey = image.astype(np.float32) - np.float32(128.0)
    mean = np.asarray(cv2.boxFilter(grey, -1, size))[row, column]
    variance = np.asarray(cv2.sqrBoxFilter(grey, -1, size))[row, column] - mean**2
    return (
        np.sqrt(grid_flow.smaller_eigenvalue(xx, yy, xy).astype(np.float64)),
        np.sqrt(np.maximum(variance, 0.0).astype(np.float64)),
    )
