"""Confidence and standard deviation of flow vectors (METHOD 2.9)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.flow.aligned_past import rotation_matters
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats
from navfw.robot import CameraEffects, CameraModel
from navfw.signals import FlowField, FramePair

Floating = npt.NDArray[np.floating[Any]]


def gradient_products(image: Image) -> tuple[Floats, Floats, Floats]:
    """Products xx, yy, xy of the gradient's components [(grey levels/px)^2] at each pixel.

    Their means over a window are the elements of its structure tensor.
    """
    x: Floats = np.asarray(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=0.125), np.float32)
    y: Floats = np.asarray(cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=0.125), np.float32)
    return x * x, y * y, x * y


def smaller_eigenvalue(xx: Floating, yy: Floating, xy: Floating) -> Floating:
    """Mean square of the gradient in its weakest direction: smaller eigenvalue of the tensor."""
    eigenvalue = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    return np.asarray(np.maximum(eigenvalue, 0.0))


#: Standard deviation of vectors of confidence 0, and upper limit of all others [px].
SIGMA_UNKNOWN = 10.0
#: Baseline [m] beyond which two images of a working camera are never identical.
_SURELY_MOVED = 0.005


def ramp(value: Array, low: float, high: float) -> Array:
    """0 below ``low``, 1 above ``high``, linear between."""
    # equal to np.clip, at a third of its cost on arrays of the size of a grid
    return np.minimum(np.maximum((value - low) / (high - low), 0.0), 1.0)


def is_frozen(pair: FramePair, camera: CameraModel) -> bool:
    """Whether the camera moved but both images are identical: the camera or its driver hangs.

    Such a pair would match perfectly and show zero flow.
    """
    motion = pair.motion
    moved = motion.baseline > _SURELY_MOVED or rotation_matters(motion.rotation, camera)
    return moved and bool(np.array_equal(pair.past.image, pair.now.image))


def match_sigma(score: Array, curvature: Array, pixels: Array | float) -> Array:
    """Standard deviation [px] of the position of a correlation peak, in its worst direction.

    For two images with independent noise, the position of the maximum of their normalised
    correlation, of height ``score``, has the variance 2 (1 - score) / (pixels * curvature) [px^2],
    where ``curvature`` [1/px^2] is the negative second derivative in the flattest direction. Real
    residuals of neighbouring pixels are correlated: callers scale the result by measured factors.
    """
    noise = 2.0 * np.clip(1.0 - score, 0.0, 1.0) / pixels
    return np.sqrt(noise / np.maximum(curvature, 1e-6))


def local_spread(vectors: Array, confidence: Array) -> Array:
    """Standard deviation (rows, cols) [px] of the vectors in each 3 x 3 neighbourhood.

    Both components together; vectors of confidence 0 are left out. Where neighbouring windows
    overlap, it measures how much the flow varies within a window: expansion, slanted surfaces,
    edges in depth.
    """
    weight = np.where(confidence > 0.0, 1.0, 1e-9)
    total = _sum_around(weight)
    variance = np.zeros_like(weight)
    for k in range(2):
        component = vectors[..., k]
        mean = _sum_around(weight * component) / total
        variance += _sum_around(weight * component**2) / total - mean**2
    return np.sqrt(np.maximum(variance, 0.0))


def _sum_around(values: Array) -> Array:
    border = cv2.BORDER_ISOLATED | cv2.BORDER_CONSTANT
    return np.asarray(cv2.boxFilter(values, -1, (3, 3), normalize=False, borderType=border))


def with_shutter_sigma(flow: FlowField, effects: CameraEffects, height: int) -> FlowField:
    """``flow`` of images ``height`` px high, its sigma widened by blur and a rolling shutter.

    A vector u over the time dt is an image motion of |u| / dt. While a row is exposed, for e, a
    point draws a trail of b = e |u| / dt; where in it the match lies is uniform, which has the
    standard deviation b / sqrt(12). Rows are exposed one after the other over the readout time r:
    a point that moved by u_y rows was seen r u_y / height later than dt says, so that the vector
    is wrong by s = |u| / dt times that. Both are independent of the sigma of the match:
    sqrt(sigma^2 + b^2 / 12 + s^2).
    """
    x, y = flow.vectors[..., 0], flow.vectors[..., 1]
    speed = np.hypot(x, y) / flow.motion.dt
    blur = effects.exposure_time / math.sqrt(12.0)
    skew = effects.readout_time * y / height
    sigma = np.sqrt(flow.sigma**2 + speed**2 * (blur**2 + skew**2))
    return replace(flow, sigma=np.minimum(sigma, SIGMA_UNKNOWN))
