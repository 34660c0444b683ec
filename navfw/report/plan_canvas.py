"""Drawing in top view into an image: places are in metres, in ``map``."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from navfw.recording.palette import bgr
from navfw.recording.top_view import Point
from navfw.signals import Array, Image

_SHIFT = 4
"""Bits of a pixel's fraction in OpenCV's drawing."""


class PlanCanvas:
    """Draws into ``image``; ``corner`` (2,) [m] is at its lower left, ``scale`` is in px/m.

    Colours are ``#RRGGBB``, thicknesses in pixels.
    """

    def __init__(self, image: Image, corner: Array, scale: float) -> None:
        self.image = image
        self._corner = corner
        self._scale = scale

    def pixels(self, points: Array) -> Array:
        """Points (n, 2) [m] as pixels (n, 2)."""
        x, y = ((np.reshape(points, (-1, 2)) - self._corner) * self._scale).T
        return np.column_stack([x, self.image.shape[0] - y])

    def polygon(self, corners: Array, color: str) -> None:
        """Fill the polygon with ``corners`` (n, 2) [m]."""
        cv2.fillPoly(self.image, [self._fixed(corners)], bgr(color), cv2.LINE_AA, _SHIFT)

    def line(self, points: Array, color: str, thickness: int) -> None:
        """Draw the line through ``points`` (n, 2) [m]."""
        curve = [self._fixed(points)]
        cv2.polylines(self.image, curve, False, bgr(color), thickness, cv2.LINE_AA, _SHIFT)

    def disc(self, at: Point, radius: float, color: str, thickness: int = cv2.FILLED) -> None:
        """Draw a disc of ``radius`` [m], filled unless a ``thickness`` is given."""
        (middle,) = self._fixed(np.array(at)).tolist()
        wide = round(radius * self._scale * (1 << _SHIFT))
        cv2.circle(self.image, middle, wide, bgr(color), thickness, cv2.LINE_AA, _SHIFT)

    def mark(self, at: Point, color: str, kind: int, size: int) -> None:
        """Draw one of OpenCV's markers of ``size`` [px]."""
        (middle,) = np.rint(self.pixels(np.array(at))).astype(int).tolist()
        cv2.drawMarker(self.image, middle, bgr(color), kind, size, 2, cv2.LINE_AA)

    def tint(self, opacity: Array, corners: Array, color: str) -> None:
        """Blend a grid of opacities (rows, columns) in [0, 1] over the image.

        ``corners`` (3, 2) [m] are the middles of its cells [0, 0], [0, columns - 1], [rows - 1, 0].
        """
        rows, columns = opacity.shape
        cells = np.array([[0, 0], [columns - 1, 0], [0, rows - 1]], dtype=np.float32)
        seen = self.pixels(corners).astype(np.float32)
        size = (self.image.shape[1], self.image.shape[0])
        turn = cv2.getAffineTransform(cells, seen)
        shown = cv2.warpAffine(
            opacity.astype(np.float32), turn, size, flags=cv2.INTER_NEAREST, borderValue=0.0
        )
        at = np.nonzero(shown)
        share = np.asarray(shown)[at][:, None]
        mixed = (1.0 - share) * self.image[at] + share * np.array(bgr(color))
        self.image[at] = np.rint(mixed).astype(np.uint8)

    def _fixed(self, points: Array) -> Any:
        """Points (n, 2) [m] as OpenCV's fixed-point coordinates."""
        return np.rint(self.pixels(points) * (1 << _SHIFT)).astype(np.int32)
