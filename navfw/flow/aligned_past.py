"""The past image as if the camera had turned before it: what is left of the flow is translation."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.camera_geometry.rotations import turn_point
from navfw.numerics import Array, Image, Mask
from navfw.numerics.linear_systems import inverse
from navfw.numerics.products import product
from navfw.robot import CameraModel

Pixels = npt.NDArray[Any]

#: Largest rotational flow in the image [px] that is not compensated before matching.
_NEGLIGIBLE = 0.05


def rotation_matters(rotation: Array, camera: CameraModel) -> bool:
    """Whether ``rotation`` moves a point of the image by more than ``_NEGLIGIBLE``."""
    back = np.ascontiguousarray(rotation.T)
    x, y = 0.5 * camera.width, 0.5 * camera.height
    for px, py in ((-x, -y), (x, -y), (-x, y), (x, y), (0.0, 0.0)):
        qx, qy = turn_point(px, py, back, camera.focal)
        # NaN (a corner that leaves the field of view) must compare as large
        if not (abs(qx - px) <= _NEGLIGIBLE and abs(qy - py) <= _NEGLIGIBLE):
            return True
    return False


def align_past(past: Image, rotation: Array, camera: CameraModel) -> Image:
    """The image ``past`` (height, width) warped as if the camera had rotated by ``rotation``.

    This applies the rotational prediction to all pixels at once: a search in the result starts at
    the prediction, and its windows are not distorted by the rotation. Pixels outside the past image
    repeat its border; ``visible_in_past`` gives the others.
    """
    if not rotation_matters(rotation, camera):
        return past
    intrinsics, inverse = _intrinsics(camera.focal, camera.width, camera.height)
    past_from_now = product(intrinsics, rotation.T, inverse)
    warped = cv2.warpPerspective(
        past,
        past_from_now,
        (camera.width, camera.height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(warped, dtype=np.uint8)


@functools.lru_cache(maxsize=8)
def _intrinsics(focal: float, width: int, height: int) -> tuple[Array, Array]:
    """Intrinsic matrix (3, 3), from rays to pixels from the top left, and its inverse."""
    matrix = np.array(
        [[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]]
    )
    return matrix, inverse(matrix)


def visible_in_past(rotation: Array, camera: CameraModel) -> tuple[int, int, int, int]:
    """Columns [left, right) and rows [top, bottom) of ``align_past`` inside the past image.

    The limits are those of the middle row and the middle column. For a rotation about the camera's
    y axis the column limits are exact, and the row limits include a few invisible pixels in the
    corners only.
    """
    w, h = camera.width, camera.height
    if not rotation_matters(rotation, camera):
        return 0, w, 0, h
    turn, f, x, y = np.ascontiguousarray(rotation), camera.focal, 0.5 * w, 0.5 * h
    left, right = (turn_point(side, 0.0, turn, f)[0] + x for side in (-x, x))
    top, bottom = (turn_point(0.0, side, turn, f)[1] + y for side in (-y, y))
    return *_within(left, right, w), *_within(top, bottom, h)


def is_visible(x: Pixels, y: Pixels, visible: tuple[int, int, int, int]) -> Mask:
    """Whether pixels ``x``, ``y`` lie within the limits of ``visible_in_past``."""
    left, right, top, bottom = visible
    return (x >= left) & (x <= right - 1) & (y >= top) & (y <= bottom - 1)


def _within(low: float, high: float, size: int) -> tuple[int, int]:
    """Whole pixels of [low, high) inside [0, size); (0, 0) if the interval is not finite."""
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0, 0
    return max(0, int(np.ceil(low - 1e-6))), min(size, int(np.floor(high + 1e-6)))
