"""Exact removal of the rotational part of the flow (paper sec 3, METHOD 2.4)."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.flow.rotation_kernels import turn_points, undo_turn
from navfw.robot import CameraModel
from navfw.signals import Array, FlowField, Image, Mask

__all__ = [
    "align_past",
    "derotate",
    "derotated_vectors",
    "is_visible",
    "rotate_points",
    "rotation_matters",
    "rotational_flow",
    "visible_in_past",
]

Pixels = npt.NDArray[Any]

#: Largest rotational flow in the image [px] that is not compensated before matching.
NEGLIGIBLE = 0.05


def rotate_points(points: Array, rotation: Array, focal: float) -> Array:
    """Image positions of ``points`` (..., 2) [px] after their rays are rotated by ``rotation``.

    NaN where a rotated ray points behind the camera.
    """
    flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
    turned: Array = turn_points(flat, np.ascontiguousarray(rotation, dtype=np.float64), focal)
    return turned.reshape(points.shape)


def rotational_flow(points: Array, rotation: Array, focal: float) -> Array:
    """Flow (..., 2) [px] at current ``points`` of a camera that only rotates by ``rotation``.

    It is independent of depth. The exact form of METHOD 2.3; ``rotation`` maps past to current
    axes, as in CameraMotion.
    """
    return points - rotate_points(points, rotation.T, focal)


def derotate(flow: FlowField, camera: CameraModel) -> FlowField:
    """``flow`` of a camera with the same translation but without rotation.

    The past end of each vector is rotated into the current camera's axes; the result obeys the
    equations of pure translation exactly, for rotations of any size. A field that is already
    derotated is returned unchanged.
    """
    if flow.derotated:
        return flow
    vectors = derotated_vectors(flow, flow.motion.rotation, camera)
    return dataclasses.replace(flow, vectors=vectors, derotated=True)


def derotated_vectors(flow: FlowField, rotation: Array, camera: CameraModel) -> Array:
    """The vectors (rows, cols, 2) [px] of ``derotate`` for a given ``rotation``."""
    if flow.derotated:
        return flow.vectors
    vectors: Array = undo_turn(
        np.ascontiguousarray(flow.points, dtype=np.float64).reshape(-1, 2),
        np.ascontiguousarray(flow.vectors, dtype=np.float64).reshape(-1, 2),
        np.ascontiguousarray(rotation, dtype=np.float64),
        camera.focal,
    )
    return vectors.reshape(flow.vectors.shape)


def rotation_matters(rotation: Array, camera: CameraModel) -> bool:
    """Whether ``rotation`` moves a point of the image by more than ``NEGLIGIBLE``."""
    back = rotation.T.tolist()
    x, y = 0.5 * camera.width, 0.5 * camera.height
    for px, py in ((-x, -y), (x, -y), (-x, y), (x, y), (0.0, 0.0)):
        qx, qy = _turned(px, py, back, camera.focal)
        # NaN (a corner that leaves the field of view) must compare as large
        if not (abs(qx - px) <= NEGLIGIBLE and abs(qy - py) <= NEGLIGIBLE):
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
    past_from_now = intrinsics @ rotation.T @ inverse
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
    return matrix, np.linalg.inv(matrix)


def visible_in_past(rotation: Array, camera: CameraModel) -> tuple[int, int, int, int]:
    """Columns [left, right) and rows [top, bottom) of ``align_past`` inside the past image.

    The limits are those of the middle row and the middle column. For a rotation about the camera's
    y axis the column limits are exact, and the row limits include a few invisible pixels in the
    corners only.
    """
    w, h = camera.width, camera.height
    if not rotation_matters(rotation, camera):
        return 0, w, 0, h
    turn, f = rotation.tolist(), camera.focal
    left, right = _within(
        _turned(-0.5 * w, 0.0, turn, f)[0] + 0.5 * w, _turned(0.5 * w, 0.0, turn, f)[0] + 0.5 * w, w
    )
    top, bottom = _within(
        _turned(0.0, -0.5 * h, turn, f)[1] + 0.5 * h, _turned(0.0, 0.5 * h, turn, f)[1] + 0.5 * h, h
    )
    return left, right, top, bottom


def is_visible(x: Pixels, y: Pixels, visible: tuple[int, int, int, int]) -> Mask:
    """Whether pixels ``x``, ``y`` lie within the limits of ``visible_in_past``."""
    left, right, top, bottom = visible
    return (x >= left) & (x <= right - 1) & (y >= top) & (y <= bottom - 1)


def _within(low: float, high: float, size: int) -> tuple[int, int]:
    """Whole pixels of [low, high) inside [0, size); (0, 0) if the interval is not finite."""
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0, 0
    return max(0, int(np.ceil(low - 1e-6))), min(size, int(np.floor(high + 1e-6)))


def _turned(x: float, y: float, rotation: list[list[float]], focal: float) -> tuple[float, float]:
    """``rotate_points`` of a single point, without the overhead of arrays."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    depth = (g * x + h * y) / focal + i
    if depth <= 1e-9:
        return math.nan, math.nan
    return (a * x + b * y + c * focal) / depth, (d * x + e * y + f * focal) / depth
