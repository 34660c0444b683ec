"""OpenCV's flow by Farneback, and pyramidal Lucas-Kanade on points of each grid cell."""

from __future__ import annotations

from typing import Annotated, ClassVar

import cv2
import numpy as np
from pydantic import Field

from navfw import Array, CameraModel, Image, RobotModel
from navfw.flow import grid_flow
from navfw.flow.opencv_flow import SIGMA_FLOOR, DenseFlow, TextureParams
from navfw.numerics.arrays import Floats


class Farneback(DenseFlow):
    """OpenCV's Farneback flow, one mean vector per grid cell (Farneback 2003).

    Each neighbourhood of both images is approximated by a quadratic polynomial; the displacement
    follows from the change of its coefficients, from coarse to fine levels of a pyramid.
    """

    name: ClassVar[str] = "farneback"

    class Params(DenseFlow.Params):
        """Grid, limits of the confidence (METHOD 2.9), and OpenCV's settings."""

        levels: Annotated[int, Field(ge=1, le=6, description="levels of the image pyramid")] = 3
        window: Annotated[int, Field(ge=5, le=63, description="averaging window [px]")] = 9
        iterations: Annotated[int, Field(ge=1, le=10, description="iterations at each level")] = 3
        neighbourhood: Annotated[
            int, Field(ge=5, le=9, description="side of the polynomials' support [px]")
        ] = 5

    params: Params

    def dense(self, now: Image, past: Image) -> Floats:
        """See ``DenseFlow.dense``."""
        p = self.params
        start: Floats = np.zeros((*now.shape, 2), dtype=np.float32)
        flow = cv2.calcOpticalFlowFarneback(
            now,
            past,
            start,
            pyr_scale=0.5,
            levels=p.levels,
            winsize=p.window,
            iterations=p.iterations,
            poly_n=p.neighbourhood,
            # as OpenCV recommends: 1.1 for 5 px, 1.5 for 7 px
            poly_sigma=0.2 * p.neighbourhood + 0.1,
            flags=0,
        )
        return np.asarray(flow, dtype=np.float32)


#: Factor that scales the noise model to the errors measured on rendered frames.
_NOISE_SCALE = 1.3
#: Shares that count as standard deviation: of the forward-backward error, of the disagreement
#: within a cell, and of the variation between cells (over the points per axis of a cell).
_RETURN_SHARE, _CELL_SHARE, _VARIATION_SHARE = 0.5, 0.5, 0.25


class LucasKanade(grid_flow.MatchedFlow):
    """Pyramidal Lucas-Kanade at points of a regular grid, with a forward-backward check.

    A cell's vector is the median of its points that pass the check. Its confidence requires texture
    in both directions, a small forward-backward error, and agreement of the image patches.
    """

    name: ClassVar[str] = "lucas_kanade"

    class Params(TextureParams):
        """Grid, windows, and limits of the confidence (METHOD 2.9)."""

        points: Annotated[int, Field(ge=1, le=4, description="points per cell along each axis")] = 1
        window: Annotated[int, Field(ge=5, le=63, description="side of a window [px]")] = 11
        levels: Annotated[int, Field(ge=0, le=5, description="halvings of the image")] = 2
        return_low: Annotated[
            float, Field(ge=0.0, le=100.0, description="forward-backward error: certain match [px]")
        ] = 0.3
        return_high: Annotated[
            float, Field(gt=0.0, le=100.0, description="forward-backward error: no match [px]")
        ] = 1.0
        residual_low: Annotated[
            float, Field(ge=0.0, le=100.0, description="residual over contrast: certain match")
        ] = 0.35
        residual_high: Annotated[
            float, Field(gt=0.0, le=100.0, description="residual over contrast: no match")
        ] = 0.7

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p = self.params
        self._seeds = _seeds(robot.camera, p.rows, p.cols, p.points)

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        p = self.params
        origins, returned, residual = self._track(now, past, visible)
        gradient, contrast = _texture(now, self._seeds, p.window)
        trust = 1.0 - grid_flow.ramp(returned, p.return_low, p.return_high)
        trust *= 1.0 - grid_flow.ramp(
            residual / np.maximum(contrast, 1.0), p.residual_low, p.residual_high
        )
        trust *= grid_flow.ramp(gradient, p.gradient_low, p.gradient_high)
        noise = _NOISE_SCALE * residual / (np.maximum(gradient, 0.1) * p.window)
        point_variance = (
            noise**2 + (_RETURN_SHARE * np.minimum(returned, grid_flow.SIGMA_UNKNOWN)) ** 2
        )
        vectors, confidence, variance = _cells(self._seeds - origins, trust, point_variance)
        spread = _VARIATION_SHARE / p.points * grid_flow.local_spread(vectors, confidence)
        return vectors, confidence, np.sqrt(variance + spread**2 + SIGMA_FLOOR**2)

    def _track(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        """Positions of the seeds in ``past``, forward-backward error [px] and residual [grey].

        The error of lost points is infinite.
        """
        p = self.params
        size = (p.window, p.window)
        seeds = self._seeds.reshape(-1, 1, 2).astype(np.float32)
        origins, is_tracked, error = cv2.calcOpticalFlowPyrLK(
            now, past, seeds, seeds.copy(), winSize=size, maxLevel=p.levels
        )
        back, is_returned, _ = cv2.calcOpticalFlowPyrLK(
            past, now, origins, np.array(origins), winSize=size, maxLevel=p.levels
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


def _seeds(camera: CameraModel, rows: int, cols: int, points: int) -> Array:
    """(rows, cols, points^2, 2) pixel coordinates, evenly spaced in each cell."""
    fine = grid_flow.grid_points(camera, rows * points, cols * points)
    pixels = fine + 0.5 * np.array([camera.width, camera.height]) - 0.5
    split = pixels.reshape(rows, points, cols, points, 2).transpose(0, 2, 1, 3, 4)
    return np.ascontiguousarray(split.reshape(rows, cols, points * points, 2))


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


def _cells(tracks: Array, trust: Array, variance: Array) -> tuple[Array, Array, Array]:
    """Vector, confidence and variance (rows, cols) from the points (rows, cols, n) of each cell."""
    if trust.shape[-1] == 1:
        return tracks[..., 0, :], trust[..., 0], variance[..., 0]
    good = trust > 0.0
    none = np.asarray(~good.any(axis=-1, keepdims=True))
    usable = np.where((good | none)[..., None], tracks, np.nan)
    vectors: Array = np.nanmedian(usable, axis=2)
    apart = np.where(good, np.linalg.norm(tracks - vectors[..., None, :], axis=-1), 0.0)
    count = np.maximum(good.sum(axis=-1), 1)
    disagreement = (apart**2).sum(axis=-1) / count
    mean_variance = np.where(good, variance, 0.0).sum(axis=-1) / count
    # the mean confidence of all points of a cell, lost ones included
    return vectors, trust.mean(axis=-1), mean_variance + _CELL_SHARE**2 * disagreement
