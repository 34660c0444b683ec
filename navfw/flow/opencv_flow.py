"""Dense flow, one mean vector per grid cell; OpenCV's DIS is one such processor."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.flow import grid_flow
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats
from navfw.robot import RobotModel

SIGMA_FLOOR = 0.05  # chosen
"""Least standard deviation of a cell's mean vector, or of a tracked one [px]."""
#: Factor that scales the noise model to the errors measured on rendered frames.
_SIGMA_SCALE = 1.5  # measured
#: Share of the standard deviation of the flow within a cell that counts as error of its mean.
_SPREAD_SHARE = 0.45  # chosen

TEXTURE = 0.8, 2.5  # chosen
"""Gradients across the weakest direction [grey levels/px]: no texture, ample texture."""

_MATCH = 0.6, 0.85  # chosen
"""Correlations of a cell with its match: no match, certain match."""

_SPREAD = 1.0, 2.5  # chosen
"""Spreads of the flow within a cell [px]: one motion, several motions."""

PRESETS = {
    "ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    "fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
    "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}
"""OpenCV's presets of DIS by name."""


class DenseFlow(grid_flow.MatchedFlow):
    """Base class of processors that compute a vector per pixel; the field has means of grid cells.

    A cell's confidence requires texture in both directions and correlation of the current image
    with the past image moved along the flow. Its sigma follows from that correlation and from the
    spread of the flow within the cell.
    """

    def __init__(
        self, robot: RobotModel, params: grid_flow.MatchedFlow.Params | None = None
    ) -> None:
        super().__init__(robot, params)
        y, x = np.mgrid[: robot.camera.height, : robot.camera.width].astype(np.float32)
        self._pixel_x, self._pixel_y = x, y

    @abstractmethod
    def dense(self, now: Image, past: Image) -> Floats:
        """Measure the displacement (height, width, 2) [px], past - now, of each pixel of now."""

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        dense = self.dense(now, past)
        source_x, source_y = self._pixel_x + dense[..., 0], self._pixel_y + dense[..., 1]
        moved = cv2.remap(past, source_x, source_y, cv2.INTER_LINEAR).astype(np.uint8)
        seen = grid_flow.is_visible(source_x, source_y, visible).astype(np.float32)
        cells = _Cells(self.params.rows, self.params.cols, seen)
        back = np.stack([cells.mean(dense[..., 0]), cells.mean(dense[..., 1])], axis=-1)
        spread = np.sqrt(cells.variance(dense[..., 0]) + cells.variance(dense[..., 1]))
        score, texture = _agreement(cells, now, moved)
        gradient, curvature = _structure(cells, now, texture)

        confidence = grid_flow.ramp(cells.share, 0.5, 0.9) * grid_flow.ramp(score, *_MATCH)
        confidence *= grid_flow.ramp(gradient, *TEXTURE)
        confidence *= 1.0 - grid_flow.ramp(spread, *_SPREAD)
        noise = _SIGMA_SCALE * grid_flow.match_sigma(score, curvature, cells.pixels)
        sigma = np.sqrt(noise**2 + (_SPREAD_SHARE * spread) ** 2 + SIGMA_FLOOR**2)
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

    class Params(grid_flow.MatchedFlow.Params):
        """Grid, and OpenCV's settings."""

        preset: Literal["ultrafast", "fast", "medium"] = Field(
            "ultrafast", description="OpenCV's preset"
        )
        finest_scale: int = Field(
            0, ge=0, le=3, description="finest pyramid level, in halvings of the image"
        )

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._dis = cv2.DISOpticalFlow.create(PRESETS[self.params.preset])
        self._dis.setFinestScale(self.params.finest_scale)

    def dense(self, now: Image, past: Image) -> Floats:
        """Compute the displacement of each pixel; see ``DenseFlow.dense``."""
        start: Floats = np.zeros((*now.shape, 2), dtype=np.float32)
        return np.asarray(self._dis.calc(now, past, start), dtype=np.float32)
