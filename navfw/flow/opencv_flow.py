"""Flow processors of OpenCV: dense ones, and pyramidal Lucas-Kanade on points of each grid cell."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.flow import grid_flow
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats
from navfw.robot import CameraModel, RobotModel

#: Least standard deviation of a cell's mean vector, or of a tracked one [px].
_SIGMA_FLOOR = 0.05
#: Factor that scales the noise model to the errors measured on rendered frames.
_SIGMA_SCALE = 1.5
#: Share of the standard deviation of the flow within a cell that counts as error of its mean.
_SPREAD_SHARE = 0.45

PRESETS = {
    "ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    "fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
    "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}
"""OpenCV's presets of DIS by name."""


class _TextureParams(grid_flow.MatchedFlow.Params):
    """Grid, and the gradients across the weakest direction between which confidence rises."""

    gradient_low: Annotated[
        float, Field(ge=0.1, le=255.0, description="gradient: no texture [grey levels/px]")
    ] = 0.8
    gradient_high: Annotated[
        float, Field(gt=0.1, le=255.0, description="gradient: ample texture [grey levels/px]")
    ] = 2.5


class DenseFlow(grid_flow.MatchedFlow):
    """Base of processors that compute a vector per pixel; the field has their mean per grid cell.

    A cell's confidence requires texture in both directions and correlation of the current image
    with the past image moved along the flow. Its sigma follows from that correlation and from the
    spread of the flow within the cell.
    """

    class Params(_TextureParams):
        """Grid, and limits of the confidence (METHOD 2.9)."""

        match_low: Annotated[float, Field(ge=0.0, lt=1.0, description="correlation: no match")] = (
            0.6
        )
        match_high: Annotated[
            float, Field(gt=0.0, le=1.0, description="correlation: certain match")
        ] = 0.85
        spread_low: Annotated[
            float, Field(ge=0.0, le=100.0, description="spread within a cell: one motion [px]")
        ] = 1.0
        spread_high: Annotated[
            float, Field(gt=0.0, le=100.0, description="spread within a cell: several motions [px]")
        ] = 2.5

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        y, x = np.mgrid[: robot.camera.height, : robot.camera.width].astype(np.float32)
        self._pixel_x, self._pixel_y = x, y

    @abstractmethod
    def dense(self, now: Image, past: Image) -> Floats:
        """Displacement (height, width, 2) [px], past - now, of each pixel of ``now``."""

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        p = self.params
        dense = self.dense(now, past)
        source_x, source_y = self._pixel_x + dense[..., 0], self._pixel_y + dense[..., 1]
        moved = cv2.remap(past, source_x, source_y, cv2.INTER_LINEAR).astype(np.uint8)
        seen = grid_flow.is_visible(source_x, source_y, visible).astype(np.float32)
        cells = _Cells(p.rows, p.cols, seen)
        back = np.stack([cells.mean(dense[..., 0]), cells.mean(dense[..., 1])], axis=-1)
        spread = np.sqrt(cells.variance(dense[..., 0]) + cells.variance(dense[..., 1]))
        score, texture = _agreement(cells, now, moved)
        gradient, curvature = _structure(cells, now, texture)

        confidence = grid_flow.ramp(cells.share, 0.5, 0.9) * grid_flow.ramp(
            score, p.match_low, p.match_high
        )
        confidence *= grid_flow.ramp(gradient, p.gradient_low, p.gradient_high)
        confidence *= 1.0 - grid_flow.ramp(spread, p.spread_low, p.spread_high)
        noise = _SIGMA_SCALE * grid_flow.match_sigma(score, curvature, cells.pixels)
        sigma = np.sqrt(noise**2 + (_SPREAD_SHARE * spread) ** 2 + _SIGMA_FLOOR**2)
        return -back, confidence, sigma


class _Cells:
    """Means over the grid's cells of the pixels visible in the past image (``seen`` is 1)."""

    def __init__(self, rows: int, cols: int, seen: Floats) -> None:
        self._rows, self._cols = rows, cols
        self._seen = seen
        self.pixels = float(seen.size / (rows * cols))
        self.share = self._sum(seen) / self.pixels
        self._count = np.maximum(self._sum(seen), 1.0)

    def _sum(self, dense: Floats) -> Array:
        height, width = dense.shape
        small = cv2.resize(dense, (self._cols, self._rows), interpolation=cv2.INTER_AREA)
        mean: Array = np.asarray(small, dtype=np.float64)
        return np.asarray(mean * (height * width / (self._rows * self._cols)))

    def mean(self, dense: Floats) -> Array:
        """(rows, cols) mean of ``dense`` (height, width)."""
        return np.asarray(self._sum(dense * self._seen) / self._count)

    def variance(self, dense: Floats) -> Array:
        """(rows, cols) population variance of ``dense`` (height, width)."""
        # centred first: float32 squares of grey values would lose digits
        centred: Floats = dense - np.float32(dense.mean())
        squares: Array = self.mean(centred * centred) - self.mean(centred) ** 2
        return np.maximum(squares, 0.0)


def _agreement(cells: _Cells, now: Image, moved: Image) -> tuple[Array, Array]:
    """Normalised correlation of the two images in each cell, and the variance of ``now``."""
    grey = np.float32(128.0)
    a: Floats = now.astype(np.float32) - grey
    b: Floats = moved.astype(np.float32) - grey
    var_a, var_b = cells.variance(a), cells.variance(b)
    covariance = cells.mean(a * b) - cells.mean(a) * cells.mean(b)
    return covariance / np.sqrt(np.maximum(var_a * var_b, 1e-3)), var_a


def _structure(cells: _Cells, image: Image, variance: Array) -> tuple[Array, Array]:
    """Gradient [grey/px] in its weakest direction, and the curvature [1/px^2] of a correlation."""
    xx, yy, xy = (cells.mean(product) for product in grid_flow.gradient_products(image))
    smaller = grid_flow.smaller_eigenvalue(xx, yy, xy).astype(np.float64)
    return np.sqrt(smaller), smaller / np.maximum(variance, 1e-3)


class Dis(DenseFlow):
    """OpenCV's dense inverse search (DIS) flow, one mean vector per grid cell (METHOD 2.7)."""

    name: ClassVar[str] = "dis"

    class Params(DenseFlow.Params):
        """Grid, limits of the confidence (METHOD 2.9), and OpenCV's settings."""

        preset: Annotated[
            Literal["ultrafast", "fast", "medium"], Field(description="OpenCV's preset")
        ] = "ultrafast"
        finest_scale: Annotated[
            int, Field(ge=0, le=3, description="finest pyramid level, in halvings of the image")
        ] = 0

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._dis = cv2.DISOpticalFlow.create(PRESETS[self.params.preset])
        self._dis.setFinestScale(self.params.finest_scale)

    def dense(self, now: Image, past: Image) -> Floats:
        """See ``DenseFlow.dense``."""
        start: Floats = np.zeros((*now.shape, 2), dtype=np.float32)
        return np.asarray(self._dis.calc(now, past, start), dtype=np.float32)


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

    class Params(_TextureParams):
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
        return vectors, confidence, np.sqrt(variance + spread**2 + _SIGMA_FLOOR**2)

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
