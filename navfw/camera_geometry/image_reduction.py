"""Images reduced by a whole factor, to the size for which flow and perception are made."""

from __future__ import annotations

import cv2
import numpy as np

from navfw.numerics import Image
from navfw.signals import Frame


def reduce_frame(frame: Frame, factor: int) -> Frame:
    """Reduce the images of ``frame``, each to its size divided by ``factor``, by area averages.

    Sizes are rounded; a factor of 1 returns ``frame`` itself.
    """
    if factor == 1:
        return frame
    sides = tuple(_reduced(side, factor) for side in frame.sides)
    return Frame(frame.time, _reduced(frame.image, factor), sides)


def _reduced(image: Image, factor: int) -> Image:
    height, width = image.shape
    size = round(width / factor), round(height / factor)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
