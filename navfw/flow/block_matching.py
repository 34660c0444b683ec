"""The paper's flow processor: two-dimensional correlation of fixed windows (paper sec 3)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from navfw import kinds
from navfw.flow.confidence import SIGMA_UNKNOWN, check_ramps, local_spread, match_sigma, ramp
from navfw.flow.derotation import align_past, rotate_points, visible_in_past
from navfw.flow.grid import check_frame, check_grid
from navfw.flow.kernels import correlate, find_peaks
from navfw.robot import RobotModel
from navfw.signals import Array, FlowField, FramePair

__all__ = ["BlockMatching"]

Integers = npt.NDArray[np.int64]

#: Sub-pixel refinement is never better than this [px].
SIGMA_FLOOR = 0.05
#: Scales the noise model to the errors measured on rendered frames.
SIGMA_SCALE = 2.0
#: Share of the flow's variation within a window that becomes an error of its one vector.
SPREAD_SHARE = 0.3


class BlockMatching(kinds.FlowProcessor):
    """Normalised two-dimensional correlation block matching on a regular grid (paper sec 3).

    A window around each grid point of the current image is sought in the past image by exhaustive
    zero-mean normalised cross-correlation within ``search`` pixels of where the camera's known
    rotation puts it, and the peak is refined below a pixel by a quadratic surface. The rotation is
    predicted by turning the whole past image, so the windows meet undistorted.

    Windows at the border are clipped to the image, a little inside it. The field's ``points`` are
    the centres of the windows as compared: the grid points, except at the border, where they stand
    some pixels further inside.
    """

    name: ClassVar[str] = "block_matching"

    class Params(kinds.FlowProcessor.Params):
        """Grid, windows, search, and when to trust a match (METHOD 2.9)."""

        rows: Annotated[int, Field(ge=2, le=120, description="rows of the grid")] = 12
        cols: Annotated[int, Field(ge=2, le=160, description="columns of the grid")] = 16
        window: Annotated[int, Field(ge=6, le=128, description="side of a window [px]")] = 24
        search: Annotated[
            int, Field(ge=2, le=32, description="largest displacement searched per axis [px]")
        ] = 8
        margin: Annotated[
            int, Field(ge=0, le=16, description="windows keep this far off the border [px]")
        ] = 2
        texture_low: Annotated[
            float, Field(ge=0.5, description="grey deviation that says nothing [grey levels]")
        ] = 2.0
        texture_high: Annotated[
            float, Field(gt=0.5, description="grey deviation that is plenty [grey levels]")
        ] = 6.0
        peak_low: Annotated[
            float, Field(ge=0.0, lt=1.0, description="correlation that is no match")
        ] = 0.7
        peak_high: Annotated[
            float, Field(gt=0.0, le=1.0, description="correlation that is a sure match")
        ] = 0.9

        @model_validator(mode="after")
        def _ramps_rise(self) -> Self:
            check_ramps(self)
            return self

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p, camera = self.params, robot.camera
        check_grid(camera, p.rows, p.cols, self.name)
        self._x_windows = x = _windows(camera.width, p.cols, p.window, p.margin)
        self._y_windows = y = _windows(camera.height, p.rows, p.window, p.margin)
        self._points = np.stack(
            np.meshgrid(
                x.mean(axis=1) - 0.5 * camera.width,
                y.mean(axis=1) - 0.5 * camera.height,
            ),
            axis=-1,
        )
        self._pixels = np.outer(y[:, 1] - y[:, 0], x[:, 1] - x[:, 0]).astype(np.float64)

    def compute(self, pair: FramePair) -> FlowField:
        """Flow of ``pair.now`` against ``pair.past``, with confidence and sigma of every cell."""
        camera, p = self.robot.camera, self.params
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        rotation = pair.motion.rotation
        scores, deviation = correlate(
            np.ascontiguousarray(pair.now.image),
            np.ascontiguousarray(align_past(pair.past.image, rotation, camera)),
            self._x_windows,
            self._y_windows,
            p.search,
            visible_in_past(rotation, camera),
        )
        _, fine, height, second, curvature, inner = find_peaks(scores)
        confidence = np.where(inner & (curvature > 0.0), 1.0, 0.0)
        confidence *= ramp(deviation.astype(np.float64), p.texture_low, p.texture_high)
        confidence *= ramp(height, p.peak_low, p.peak_high)
        confidence *= _unambiguous(height, second)
        noise = SIGMA_SCALE * match_sigma(height, curvature, self._pixels)
        spread = SPREAD_SHARE * local_spread(fine, confidence)
        sigma = np.minimum(np.sqrt(noise**2 + spread**2 + SIGMA_FLOOR**2), SIGMA_UNKNOWN)
        sigma[confidence <= 0.0] = SIGMA_UNKNOWN
        past = rotate_points(self._points - fine, rotation.T, camera.focal)
        return FlowField(
            time=pair.now.time,
            points=self._points.copy(),
            vectors=self._points - past,
            confidence=confidence,
            sigma=sigma,
            motion=pair.motion,
        )


def _windows(size: int, count: int, window: int, margin: int) -> Integers:
    """(count, 2) first pixel and one past the last of the windows along one axis of the image."""
    centres = (np.arange(count) + 0.5) * (size / count)
    first = np.floor(centres - 0.5 * window).astype(np.int64)
    return np.stack([first, first + window], axis=1).clip(margin, size - margin)


def _unambiguous(height: Array, second: Array) -> Array:
    """1 when the peak stands alone, 0 when another displacement fits as well (METHOD 2.9)."""
    # 1 - score measures the mismatch: a rival has to mismatch clearly more than the peak does
    mismatch = np.maximum(1.0 - height, 1e-3)
    return ramp((1.0 - second) / mismatch, 1.0, 1.5)
