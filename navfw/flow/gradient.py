"""How much an image's grey changes, and in which direction least: what a match can be told by."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.signals import Image

__all__ = ["gradient_products", "weakest"]

Floats = npt.NDArray[np.float32]
Floating = npt.NDArray[np.floating[Any]]


def gradient_products(image: Image) -> tuple[Floats, Floats, Floats]:
    """The gradient's products xx, yy, xy [(grey levels/px)^2] at each pixel, to be averaged."""
    x: Floats = np.asarray(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=0.125), np.float32)
    y: Floats = np.asarray(cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=0.125), np.float32)
    return x * x, y * y, x * y


def weakest(xx: Floating, yy: Floating, xy: Floating) -> Floating:
    """Mean square of the gradient in its poorest direction: the lesser eigenvalue."""
    eigenvalue = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    return np.asarray(np.maximum(eigenvalue, 0.0))
