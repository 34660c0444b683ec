"""Images of more than 8 bits as images of 8 bits, by the range that their camera uses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from navfw.signals import Image

_BITS = (8, 10, 12, 14, 16)
"""Numbers of bits of cameras' converters; files keep all beyond 8 in 16 bits."""

DeepImage: TypeAlias = npt.NDArray[np.uint8 | np.uint16]
"""An image (height, width, 3) of 8 or 16 bits."""


class PixelRange:
    """Scales the images of a sequence alike; ``bits`` is the number of bits in use.

    It is the least that holds the brightest pixel of the given ``samples`` of the sequence. Pixels
    of other images that are brighter are cut off, and ``brighter`` counts these images.
    """

    def __init__(self, samples: Iterable[DeepImage]) -> None:
        self.brightest = max(int(sample.max()) for sample in samples)
        self.bits = next(bits for bits in _BITS if self.brightest < 1 << bits)
        self.brighter = 0

    def to_8_bits(self, image: DeepImage) -> Image:
        """``image`` (height, width, 3) with the range in use scaled to 0 to 255."""
        white = (1 << self.bits) - 1
        self.brighter += int(image.max()) > white
        return np.asarray(cv2.convertScaleAbs(image, alpha=255.0 / white), dtype=np.uint8)
