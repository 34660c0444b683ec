"""True flow of a pair from depth and motion, except where unknown or hidden in the past frame.

The recorded poses of real cameras are less accurate than flow: those of motion capture are off by
tenths of a degree, and a rolling shutter exposes each row at another pose. ``with_recording_error``
estimates this part of the error, smooth over the image, by a flow processor that is none of those
compared: nine numbers of a pair, against two for each of its cells.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from navfw.bench.flow_pairs import TruePair
from navfw.flow.ideal import nearness_at, true_vectors
from navfw.robot import CameraModel
from navfw.signals import Array, FlowField

HIDDEN = 1.1
"""A surface is hidden in the past frame where another is nearer there by this factor."""
ITERATIONS = 20
"""Steps of the robust fit of the recording's error."""


def true_flow(
    points: Array, true: TruePair, camera: CameraModel
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """True vectors (rows, cols, 2) [px] at ``points``, and where there is a truth.

    There is none where one of the four pixels around a point has no depth, and where the point is
    hidden behind something nearer in the past frame.
    """
    nearness = _nearness(points, true, camera)
    vectors = true_vectors(points, nearness, true.motion, camera.focal)
    missing = cv2.dilate((true.depth <= 0.0).astype(np.uint8), np.ones((2, 2), np.uint8))
    known = (missing[_pixels(points, camera)] == 0) & np.isfinite(vectors).all(axis=-1)
    known &= ~_hidden(points, nearness, vectors, true, camera)
    if true.recording_error is not None:
        vectors = vectors + _slopes(points, nearness, camera) @ true.recording_error
    return vectors, known


def with_recording_error(true: TruePair, flow: FlowField, camera: CameraModel) -> TruePair:
    """``true`` with the error of its recorded motion, as far as ``flow`` shows it.

    The error is a small rotation (three numbers), a small translation (three), and a change of the
    rotation over the rows of the image (three, for a rolling shutter). The fit is iteratively
    reweighted least squares with Cauchy weights.
    """
    vectors, known = true_flow(flow.points, true, camera)
    slopes = _slopes(flow.points, _nearness(flow.points, true, camera), camera)[known]
    off = (flow.vectors - vectors)[known]
    weight = np.ones(len(off))
    error: Array = np.zeros(slopes.shape[-1])
    for _ in range(ITERATIONS):
        root = np.sqrt(weight)[:, None]
        system = (slopes * root[..., None]).reshape(-1, error.size)
        error = np.asarray(np.linalg.lstsq(system, (off * root).ravel(), rcond=None)[0])
        size = np.linalg.norm(off - slopes @ error, axis=1)
        weight = 1.0 / (1.0 + (size / (2.0 * max(float(np.median(size)), 1e-3))) ** 2)
    return replace(true, recording_error=error)


def _slopes(points: Array, nearness: Array, camera: CameraModel) -> Array:
    """Derivatives (rows, cols, 2, 9) of the flow by the nine numbers of the recording's error."""
    f, half = camera.focal, 0.5 * camera.height
    x, y = points[..., 0], points[..., 1]
    zero = np.zeros_like(x)
    turn = np.stack(
        [
            np.stack([x * y / f, -(f + x**2 / f), y], axis=-1),
            np.stack([f + y**2 / f, -x * y / f, -x], axis=-1),
        ],
        axis=-2,
    )
    way = np.stack(
        [
            np.stack([zero - f, zero, x], axis=-1),
            np.stack([zero, zero - f, y], axis=-1),
        ],
        axis=-2,
    )
    by_row = turn * (y / half)[..., None, None]
    return np.concatenate([turn, way * nearness[..., None, None], by_row], axis=-1)


def _nearness(points: Array, true: TruePair, camera: CameraModel) -> Array:
    """Nearness [1/m] at ``points``; 0 where a pixel has no depth."""
    holes = np.where(true.depth > 0.0, true.depth, np.inf).astype(np.float32)
    return nearness_at(points, holes, camera)


def _hidden(
    points: Array, nearness: Array, vectors: Array, true: TruePair, camera: CameraModel
) -> npt.NDArray[np.bool_]:
    """Where the surface at ``points`` lies behind another one in the past frame."""
    ray = np.concatenate([points / camera.focal, np.ones_like(points[..., :1])], axis=-1)
    past = (ray + nearness[..., None] * true.motion.translation) @ true.motion.rotation
    expected = nearness / np.where(past[..., 2] > 1e-6, past[..., 2], np.inf)
    depth = true.past_depth
    seen = np.where(depth > 0.0, 1.0 / np.where(depth > 0.0, depth, 1.0), 0.0)
    return np.asarray(seen[_pixels(points - np.nan_to_num(vectors), camera)] > HIDDEN * expected)


def _pixels(
    points: Array, camera: CameraModel
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Rows and columns of the pixels at ``points``, those outside moved to the border."""
    x = np.clip(points[..., 0] + 0.5 * camera.width, 0, camera.width - 1).astype(np.int64)
    y = np.clip(points[..., 1] + 0.5 * camera.height, 0, camera.height - 1).astype(np.int64)
    return y, x
