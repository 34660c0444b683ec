"""Structure tensor of an image: strength of the texture in its weakest direction."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.numerics.arrays import Floats
from navfw.signals import Image

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
