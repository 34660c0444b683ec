"""Subpixel registration of the windows of two images, each by its own affine motion.

After Lucas and Kanade (1981); Baker and Matthews (2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from navfw.flow.registration_kernels import find_mixtures, register
from navfw.numerics import Image
from navfw.numerics.arrays import Array, Floats, Indices, Mask
from navfw.numerics.functions import exp

#: Standard deviation of the smoothing before registration [px]: without it interpolation is wrong
#: at edges.
_SMOOTHING = 0.8
#: Regularisation of the affine part, as a mean gradient [grey/px]: less texture does not justify a
#: deformation of the window.
_STIFFNESS = 0.5
_ITERATIONS = 6
#: Step of the displacement [px] below which the iteration ends.
_TOLERANCE = 0.05
#: Largest distance from the starting displacement [px]; a window that moves further is lost.
_REACH = 3.0
#: Least score of the windows that are compared with their neighbours.
_LIKELY = 0.8

_PLACES = np.arange(-3.0, 4.0)
_BELL = exp(-0.5 * (_PLACES / _SMOOTHING) ** 2)
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
    """(count, 2) first pixel and end (exclusive) of the windows along one axis of an image.

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
