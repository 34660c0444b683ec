"""When to believe a flow vector, and how far it may be off (METHOD 2.9)."""

from __future__ import annotations

import cv2
import numpy as np

from navfw.flow.derotation import rotation_matters
from navfw.interfaces import Params
from navfw.robot import CameraModel
from navfw.signals import Array, FramePair

__all__ = [
    "SIGMA_UNKNOWN",
    "check_ramps",
    "is_frozen",
    "local_spread",
    "match_sigma",
    "ramp",
]

#: Written where nothing is known [px].
SIGMA_UNKNOWN = 10.0
#: A camera that moved further than this cannot see exactly the same image again [m].
SURELY_MOVED = 0.005


def ramp(value: Array, low: float, high: float) -> Array:
    """0 below ``low``, 1 above ``high``, straight between."""
    # what np.clip does, at a third of its cost on arrays as small as a grid
    return np.minimum(np.maximum((value - low) / (high - low), 0.0), 1.0)


def check_ramps(params: Params) -> None:
    """Make sure that every pair of fields ``..._low`` and ``..._high`` is in that order.

    Raises:
        ValueError: when one is not (pydantic makes it a validation error).

    """
    for low in type(params).model_fields:
        if low.endswith("_low"):
            high = low.removesuffix("_low") + "_high"
            if getattr(params, low) >= getattr(params, high):
                raise ValueError(
                    f"{low} {getattr(params, low)} is not below {high} {getattr(params, high)}"
                )


def is_frozen(pair: FramePair, camera: CameraModel) -> bool:
    """Whether the camera moved but delivered the same image again, byte for byte.

    Such a pair matches perfectly and says nothing: the camera, or its driver, hangs.
    """
    motion = pair.motion
    moved = motion.baseline > SURELY_MOVED or rotation_matters(motion.rotation, camera)
    return moved and bool(np.array_equal(pair.past.image, pair.now.image))


def match_sigma(score: Array, curvature: Array, pixels: Array | float) -> Array:
    """Standard deviation [px] of a correlation peak's place, in its least certain direction.

    Of two images with independent noise, the maximum of their normalised correlation, of height
    ``score``, varies by 2 (1 - score) / (pixels * curvature) [px^2], where ``curvature`` [1/px^2]
    is the second derivative of the correlation in its flattest direction. Real residuals are not
    independent from pixel to pixel: callers scale the result by what they measure.
    """
    noise = 2.0 * np.clip(1.0 - score, 0.0, 1.0) / pixels
    return np.sqrt(noise / np.maximum(curvature, 1e-6))


def local_spread(vectors: Array, confidence: Array) -> Array:
    """Standard deviation (rows, cols) [px] of the trusted ``vectors`` among each one's neighbours.

    Over the 3 x 3 neighbourhood, both components together. Where windows overlap their neighbours,
    this is how much the flow varies within one: expansion, slanted surfaces, edges in depth.
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
