"""When to believe a flow vector, and how far it may be off (METHOD 2.9)."""

from __future__ import annotations

import numpy as np

from navfw.signals import Array

__all__ = ["SIGMA_UNKNOWN", "match_sigma", "ramp"]

#: Written where nothing is known [px].
SIGMA_UNKNOWN = 10.0


def ramp(value: Array, low: float, high: float) -> Array:
    """0 below ``low``, 1 above ``high``, straight between."""
    return np.clip((value - low) / (high - low), 0.0, 1.0)


def match_sigma(score: Array, curvature: Array, pixels: Array | float) -> Array:
    """Standard deviation [px] of a correlation peak's place, in its least certain direction.

    Of two images with independent noise, the maximum of their normalised correlation, of height
    ``score``, varies by 2 (1 - score) / (pixels * curvature) [px^2], where ``curvature`` [1/px^2]
    is the second derivative of the correlation in its flattest direction. Real residuals are not
    independent from pixel to pixel: callers scale the result by what they measure.
    """
    noise = 2.0 * np.clip(1.0 - score, 0.0, 1.0) / pixels
    return np.sqrt(noise / np.maximum(curvature, 1e-6))
