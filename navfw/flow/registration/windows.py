"""Registering the windows of two images below a pixel, each by a motion of its own."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navfw.flow.registration.affine_kernels import register
from navfw.flow.registration.mixtures import find_mixtures
from navfw.signals import Array, Image

__all__ = ["Registration", "register_windows"]

Integers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]

#: Standard deviation of the smoothing before; without it interpolation errs at every edge [px].
SMOOTHING = 0.8
#: Windows are not stretched further than textures of this mean gradient justify [grey/px].
STIFFNESS = 0.5
ITERATIONS = 6
#: Steps below this are not worth another iteration [px].
TOLERANCE = 0.05
#: A window that leaves the peak it started from by more is lost [px].
REACH = 3.0
#: Windows that score more are believed when they contradict or confirm their neighbours.
LIKELY = 0.8

_PLACES = np.arange(-3.0, 4.0)
_BELL = np.exp(-0.5 * (_PLACES / SMOOTHING) ** 2)
_BELL /= _BELL.sum()
# the derivative of the bell, scaled to give a slope of one its value
_SLOPE = _PLACES * _BELL
_SLOPE /= (_PLACES * _SLOPE).sum()


@dataclass(frozen=True, slots=True)
class Registration:
    """How every window of the current image registered with the past one; arrays (rows, cols).

    ``vectors`` (rows, cols, 2) [px] are the windows' centres' displacements, now - past; ``score``
    is the normalised correlation after registration, 0 for windows left out or lost; ``sigma`` [px]
    one standard deviation of a vector's worse component, were the windows' residuals independent
    from sample to sample; ``share`` the part of the samples that the past image had; ``mixture``
    [px] how much the neighbours contradict a window's motion, large where it spans two surfaces.
    """

    vectors: Array
    score: Array
    sigma: Array
    share: Array
    mixture: Array


def register_windows(
    now: Image,
    past: Image,
    x_windows: Integers,
    y_windows: Integers,
    start: Array,
    active: npt.NDArray[np.bool_],
    visible: tuple[int, int, int, int],
    stride: int = 3,
    width: float = 0.6,
) -> Registration:
    """Refine displacements ``start`` (rows, cols, 2) of the ``active`` windows.

    While a camera advances, surfaces grow and slant in its image: one displacement for a whole
    window fits no part of it well, and which part it fits depends on the texture. Here a window's
    displacement may change linearly over it, and the one at its centre is reported. Gauss-Newton
    on grey values, whatever the brightness's offset and (within 2) its gain. Windows are sampled at
    every ``stride``-th pixel of the smoothed images with a Gaussian weight of standard deviation
    ``width`` half windows; of ``past``, columns [visible[0], visible[1]) and rows [visible[2],
    visible[3]) are valid.
    """
    vectors, gradients, score, variance, share = register(
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
        STIFFNESS**2,
        ITERATIONS,
        TOLERANCE,
        REACH,
    )
    mixture = find_mixtures(
        vectors,
        gradients,
        score > LIKELY,
        (x_windows[:, 0] + x_windows[:, 1]) / 2,
        (y_windows[:, 0] + y_windows[:, 1]) / 2,
    )
    return Registration(vectors, score, np.sqrt(variance), share, mixture)


def _filtered(image: Image, along_x: Array, along_y: Array) -> Floats:
    return np.asarray(cv2.sepFilter2D(image, cv2.CV_32F, along_x, along_y), dtype=np.float32)
