"""How well a plane explains two images: the past one is warped by it, and compared."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navfw.numerics.arrays import Floats
from navfw.signals import Array, CameraMotion, Image

NOISE = 3.0
"""Standard deviation of the difference of two images of one surface [grey levels]."""

SMOOTHING = 1.0
"""Standard deviation of the smoothing before images are compared [px]."""

OUTSIDE = -1000.0
"""Value of pixels that the past image does not contain."""

HIDDEN = 0.2
"""Share of such pixels from which on a cell counts as not seen."""

UNSEEN = 4.0
"""Variance [NOISE^2] of a cell that is not seen: as of one that differs by twice the noise."""


@dataclass(frozen=True, slots=True)
class PlaneWarp:
    """Two smoothed images (height, width), the camera's ``motion`` between them, and a grid.

    ``focal`` [px] is the focal length, ``grid`` the (rows, columns) by which they are compared.
    """

    now: Floats
    past: Floats
    motion: CameraMotion
    focal: float
    grid: tuple[int, int]

    @classmethod
    def of(
        cls, now: Image, past: Image, motion: CameraMotion, focal: float, grid: tuple[int, int]
    ) -> PlaneWarp:
        """The comparison of two working images."""
        return cls(_smooth(now), _smooth(past), motion, focal, grid)

    def difference(self, normal: Array, ratio: float) -> Array:
        """Variance (rows, cols) [NOISE^2] of what a plane leaves unexplained in each cell.

        ``normal`` (3,) is the plane's unit normal, away from the camera; ``ratio`` is the baseline
        over the distance of the plane. A difference in brightness of a whole cell does not count.
        """
        height, width = self.now.shape
        direction = self.motion.translation / max(self.motion.baseline, 1e-12)
        plane = self.motion.rotation.T @ (np.eye(3) + ratio * np.outer(direction, normal))
        camera = np.array(
            [
                [self.focal, 0.0, 0.5 * (width - 1)],
                [0.0, self.focal, 0.5 * (height - 1)],
                [0.0, 0.0, 1.0],
            ]
        )
        warped = cv2.warpPerspective(
            self.past,
            camera @ plane @ np.linalg.inv(camera),
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(OUTSIDE,),
        )
        outside = np.asarray(warped < 0.5 * OUTSIDE)
        off = _cells_of(np.where(outside, 0.0, self.now - warped), self.grid)
        variance = (off * off).mean(axis=(1, 3)) - off.mean(axis=(1, 3)) ** 2
        unseen = _cells_of(outside, self.grid).mean(axis=(1, 3)) > HIDDEN
        return np.where(unseen, UNSEEN, variance / NOISE**2)

    def mean(self) -> Array:
        """Mean grey level (rows, cols) of each cell of the current image."""
        mean: Array = _cells_of(self.now, self.grid).mean(axis=(1, 3))
        return mean


def _cells_of(image: npt.NDArray[np.generic], grid: tuple[int, int]) -> Array:
    """``image`` as cells of a grid: (rows, height of a cell, cols, width of a cell)."""
    rows, cols = grid
    height, width = image.shape
    cells: Array = image.astype(np.float64)
    return cells.reshape(rows, height // rows, cols, width // cols)


def _smooth(image: Image) -> Floats:
    blurred = cv2.GaussianBlur(image.astype(np.float32), (0, 0), SMOOTHING)
    return np.asarray(blurred, dtype=np.float32)
