"""Subpixel registration of the windows of two images, each by its own affine motion.

After Lucas and Kanade (1981); Baker and Matthews (2004).

The processor ``registered`` refines coarse dense flow so in each cell, with a measured sigma.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np
from pydantic import Field

from navfw.flow.grid_flow import MatchedFlow, ramp
from navfw.flow.registration_kernels import find_mixtures, register, vector_sigma
from navfw.numerics import Image
from navfw.numerics.arrays import Array, Floats, Indices, Mask
from navfw.numerics.functions import exp
from navfw.robot import RobotModel
from navfw.signals.immutability import read_only

START_LEVEL = 2  # chosen
"""Finest level of the search, in halvings."""
REGISTERED_LOW = 0.85  # chosen
"""Registered correlation: no match."""
REGISTERED_HIGH = 0.95  # chosen
"""Registered correlation: certain match."""

#: Standard deviation of the smoothing before registration [px]: without it interpolation is wrong
#: at edges.
_SMOOTHING = 0.8  # chosen
#: Regularisation of the affine part, as a mean gradient [grey/px]: less texture does not justify a
#: deformation of the window.
_STIFFNESS = 0.5  # chosen
_ITERATIONS = 6  # chosen
#: Step of the displacement [px] below which the iteration ends.
_TOLERANCE = 0.05  # chosen
#: Largest distance from the starting displacement [px]; a window that moves further is lost.
_REACH = 3.0  # chosen
#: Least score of the windows that are compared with their neighbours.
_LIKELY = 0.8  # chosen

_PLACES = np.arange(-3.0, 4.0)  # defined
_BELL = exp(-0.5 * (_PLACES / _SMOOTHING) ** 2)  # derived
_BELL /= _BELL.sum()
# derivative of the bell, scaled to give 1 for a slope of 1
_SLOPE = _PLACES * _BELL
_SLOPE /= (_PLACES * _SLOPE).sum()


@dataclass(frozen=True, slots=True)
class Registration:
    """Registration of the windows of the current image with the past image; arrays (rows, cols).

    ``vectors`` (rows, cols, 2) [px] are the displacements of the windows' centres, now - past;
    ``score`` is the normalised correlation after registration, 0 for inactive or lost windows;
    ``sigma`` [px] is the standard deviation of a vector's worse component for residuals that are
    independent from sample to sample, ``sensitivity`` [px/grey level] the same for residuals of one
    grey level; ``share`` is the share of the samples inside the past image;
    ``mixture`` [px] is the disagreement with both neighbours, large for a window that spans two
    surfaces.
    """

    vectors: Array
    score: Array
    sigma: Array
    sensitivity: Array
    share: Array
    mixture: Array


def grid_windows(size: int, count: int, window: int, margin: int) -> Indices:
    """Return the first pixel and end (exclusive), (count, 2), of the windows along one image axis.

    They are as many as the grid's cells, around their centres, ``window`` wide, clipped to the
    ``size`` of the image less ``margin`` [px].
    """
    centres = (np.arange(count) + 0.5) * (size / count)
    first = np.floor(centres - 0.5 * window).astype(np.int64)
    return np.stack([first, first + window], axis=1).clip(margin, size - margin)


def register_windows(
    now: Image,
    past: Image,
    x_windows: Indices,
    y_windows: Indices,
    start: Array,
    active: Mask,
    visible: tuple[int, int, int, int],
    stride: int = 3,
    width: float = 0.6,
) -> Registration:
    """Refine displacements ``start`` (rows, cols, 2) [px] of the ``active`` windows.

    While the camera advances, surfaces expand and slant in the image, so that no single
    displacement fits a whole window. Here the displacement varies linearly over the window, and the
    one at its centre is reported. The method is Gauss-Newton on grey values; offset and gain
    (within a factor of 2) of the brightness are free. Windows are sampled at each ``stride``-th
    pixel of the smoothed images, with Gaussian weights of standard deviation ``width`` half
    windows. Columns [visible[0], visible[1]) and rows [visible[2], visible[3]) of ``past`` are
    valid.
    """
    vectors, gradients, score, variance, by_grey, share = register(
        _filtered(now, _BELL, _BELL),
        _filtered(past, _BELL, _BELL),
        _filtered(now, _SLOPE, _BELL),
        _filtered(now, _BELL, _SLOPE),
        x_windows,
        y_windows,
        start,
        active,
        visible,
        stride,
        width,
        _STIFFNESS**2,
        _ITERATIONS,
        _TOLERANCE,
        _REACH,
    )
    mixture = find_mixtures(
        vectors,
        gradients,
        score > _LIKELY,
        (x_windows[:, 0] + x_windows[:, 1]) / 2,
        (y_windows[:, 0] + y_windows[:, 1]) / 2,
    )
    return Registration(vectors, score, np.sqrt(variance), np.sqrt(by_grey), share, mixture)


def _filtered(image: Image, along_x: Array, along_y: Array) -> Floats:
    return np.asarray(cv2.sepFilter2D(image, cv2.CV_32F, along_x, along_y), dtype=np.float32)


#: ``shares`` of ``vector_sigma``, fitted to the logarithms of the errors of the odd recorded pairs
#: of ``navfw bench flow``, and of rendered ones of other seeds, forwards and backwards.
_SIGMA_SHARES = (0.84, 0.59, 0.26, 0.0074, 0.65, 0.22, 0.086, 630.0)  # measured
#: Least score and least share inside the past image of the vectors that are compared with others.
#: All others have confidence 0.
_LIKELY_CELL = 0.8, 0.6  # chosen
#: Sampling interval of registration [px], and sigma of its weights [half windows].
_STRIDE, _WEIGHT_WIDTH = 2, 0.8  # chosen
#: Largest sigma [px] of full confidence, and of a useful vector.
_FULL_SIGMA, _MAX_SIGMA = 0.154, 1.0  # chosen


class Registered(MatchedFlow):
    """Dense inverse search on a coarse scale, then affine registration of a window in each cell.

    OpenCV's dense inverse search finds large displacements at little cost. Around each cell's
    centre a window is registered from there (``register_windows``), which is more accurate than the
    finest scale of any of OpenCV's methods of equal cost, as it fits expansion and slant.

    A vector's sigma follows from the window's residual, gradients and contrast, from the
    disagreement with its neighbours, from its length, and from the sigmas of its neighbours. Errors
    are longer along an edge in the image than across: even if both were known exactly, one sigma
    for both would hold 42 to 47 % within one sigma when it holds 86 % within two. If the window
    matches, the confidence is that of a small sigma, and falls with its inverse square.

    Windows at the border are clipped to the image; the field's ``points`` are the centres of the
    clipped windows.
    """

    name: ClassVar[str] = "registered"

    class Params(MatchedFlow.Params):
        """Grid and windows."""

        window: int = Field(20, ge=6, le=128, description="side of a window [px]")

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
        self._dis.setFinestScale(START_LEVEL)

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        now, past = np.ascontiguousarray(now), np.ascontiguousarray(past)
        windows = register_windows(
            now,
            past,
            self._x_windows,
            self._y_windows,
            self._coarse(now, past),
            self._all,
            visible,
            _STRIDE,
            _WEIGHT_WIDTH,
        )
        likely = (windows.score > _LIKELY_CELL[0]) & (windows.share > _LIKELY_CELL[1])
        shown = (windows.sigma, windows.sensitivity, windows.score, windows.mixture)
        sigma = vector_sigma(windows.vectors, *shown, likely, _SIGMA_SHARES)
        confidence = ramp(windows.score, REGISTERED_LOW, REGISTERED_HIGH)
        confidence *= ramp(windows.share, 0.6, 0.9)
        confidence *= np.minimum((_FULL_SIGMA / sigma) ** 2, 1.0) * (sigma <= _MAX_SIGMA)
        return windows.vectors, confidence, sigma

    def _coarse(self, now: Image, past: Image) -> Array:
        """Displacements (rows, cols, 2) [px], now - past, of the windows by dense search."""
        start = np.zeros((*now.shape, 2), np.float32)
        dense = self._dis.calc(now, past, start)
        back = cv2.remap(dense, self._column, self._row, cv2.INTER_LINEAR)
        return -np.asarray(back, dtype=np.float64)
