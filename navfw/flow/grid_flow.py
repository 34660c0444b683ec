"""The regular sparse grid of image points at which flow is measured, and bases of processors.

They compare with the past image as if the camera had turned before it: what is left of the flow is
translation. Also the confidence and the standard deviation of flow vectors (METHOD 2.9).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from abc import abstractmethod
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw import interfaces
from navfw.camera_geometry.rotations import rotate_points, turn_point
from navfw.errors import ConfigError
from navfw.numerics import Array, Image, Mask
from navfw.numerics.arrays import Floats
from navfw.numerics.linear_systems import inverse
from navfw.numerics.products import product
from navfw.robot import CameraEffects, CameraModel, RobotModel
from navfw.signals import FlowField, Frame, FramePair
from navfw.signals.immutability import read_only

Pixels = npt.NDArray[Any]

#: Largest rotational flow in the image [px] that is not compensated before matching.
_NEGLIGIBLE = 0.05  # chosen


def rotation_matters(rotation: Array, camera: CameraModel) -> bool:
    """Check whether ``rotation`` moves a corner or the middle of the image by over 0.05 px."""
    back = np.ascontiguousarray(rotation.T)
    x, y = 0.5 * camera.width, 0.5 * camera.height
    for px, py in ((-x, -y), (x, -y), (-x, y), (x, y), (0.0, 0.0)):
        qx, qy = turn_point(px, py, back, camera.focal)
        # NaN (a corner that leaves the field of view) must compare as large
        if not (abs(qx - px) <= _NEGLIGIBLE and abs(qy - py) <= _NEGLIGIBLE):
            return True
    return False


def align_past(past: Image, rotation: Array, camera: CameraModel) -> Image:
    """Warp the image ``past`` (height, width) as if the camera had rotated by ``rotation``.

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
    """Compute columns [left, right) and rows [top, bottom) of ``align_past`` inside the past image.

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
    """Check whether pixels ``x``, ``y`` lie within the limits of ``visible_in_past``."""
    left, right, top, bottom = visible
    return (x >= left) & (x <= right - 1) & (y >= top) & (y <= bottom - 1)


def _within(low: float, high: float, size: int) -> tuple[int, int]:
    """Whole pixels of [low, high) inside [0, size); (0, 0) if the interval is not finite."""
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0, 0
    return max(0, int(np.ceil(low - 1e-6))), min(size, int(np.floor(high + 1e-6)))


Floating = npt.NDArray[np.floating[Any]]


def gradient_products(image: Image) -> tuple[Floats, Floats, Floats]:
    """Compute products xx, yy, xy of the gradient's components [(grey/px)^2] at each pixel.

    Their means over a window are the elements of its structure tensor.
    """
    x: Floats = np.asarray(cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=0.125), np.float32)
    y: Floats = np.asarray(cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=0.125), np.float32)
    return x * x, y * y, x * y


def smaller_eigenvalue(xx: Floating, yy: Floating, xy: Floating) -> Floating:
    """Compute the tensor's smaller eigenvalue: mean square gradient in the weakest direction."""
    eigenvalue = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    return np.asarray(np.maximum(eigenvalue, 0.0))


#: Standard deviation of vectors of confidence 0, and upper limit of all others [px].
SIGMA_UNKNOWN = 10.0  # chosen
#: Baseline [m] beyond which two images of a working camera are never identical.
_SURELY_MOVED = 0.005  # chosen


def ramp(value: Array, low: float, high: float) -> Array:
    """Return 0 below ``low``, 1 above ``high``, linear between."""
    # equal to np.clip, at a third of its cost on arrays of the size of a grid
    return np.minimum(np.maximum((value - low) / (high - low), 0.0), 1.0)


def is_frozen(pair: FramePair, camera: CameraModel) -> bool:
    """Check whether the camera moved but both images are identical: it or its driver hangs.

    Such a pair would match perfectly and show zero flow.
    """
    motion = pair.motion
    moved = motion.baseline > _SURELY_MOVED or rotation_matters(motion.rotation, camera)
    return moved and bool(np.array_equal(pair.past.image, pair.now.image))


def match_sigma(score: Array, curvature: Array, pixels: Array | float) -> Array:
    """Estimate the sigma [px] of a correlation peak's position, in its worst direction.

    For two images with independent noise, the position of the maximum of their normalised
    correlation, of height ``score``, has the variance 2 (1 - score) / (pixels * curvature) [px^2],
    where ``curvature`` [1/px^2] is the negative second derivative in the flattest direction. Real
    residuals of neighbouring pixels are correlated: callers scale the result by measured factors.
    """
    noise = 2.0 * np.clip(1.0 - score, 0.0, 1.0) / pixels
    return np.sqrt(noise / np.maximum(curvature, 1e-6))


def local_spread(vectors: Array, confidence: Array) -> Array:
    """Compute the standard deviation (rows, cols) [px] of vectors in each 3 x 3 neighbourhood.

    Both components together; vectors of confidence 0 are left out. Where neighbouring windows
    overlap, it measures how much the flow varies within a window: expansion, slanted surfaces,
    edges in depth.
    """
    weight = np.where(confidence > 0.0, 1.0, 1e-9)
    total = _sum_around(weight)
    variance = np.zeros_like(weight)
    for k in range(2):
        component = vectors[..., k]
        mean = _sum_around(weight * component) / total
        variance += _sum_around(weight * component**2) / total - mean**2
    return np.sqrt(np.maximum(variance, 0.0))


def _sum_around(values: Array) -> Array:
    border = cv2.BORDER_ISOLATED | cv2.BORDER_CONSTANT
    return np.asarray(cv2.boxFilter(values, -1, (3, 3), normalize=False, borderType=border))


def with_shutter_sigma(flow: FlowField, effects: CameraEffects, height: int) -> FlowField:
    """Widen the sigma of ``flow``, of images ``height`` px high, by blur and a rolling shutter.

    A vector u over the time dt is an image motion of |u| / dt. While a row is exposed, for e, a
    point draws a trail of b = e |u| / dt; where in it the match lies is uniform, which has the
    standard deviation b / sqrt(12). Rows are exposed one after the other over the readout time r: a
    point that moved by u_y rows was seen r u_y / height later than dt says, so that the vector is
    wrong by s = |u| / dt times that. Both are independent of the sigma of the match: sqrt(sigma^2 +
    b^2 / 12 + s^2).
    """
    x, y = flow.vectors[..., 0], flow.vectors[..., 1]
    speed = np.hypot(x, y) / flow.motion.dt
    blur = effects.exposure_time / math.sqrt(12.0)
    skew = effects.readout_time * y / height
    sigma = np.sqrt(flow.sigma**2 + speed**2 * (blur**2 + skew**2))
    return replace(flow, sigma=np.minimum(sigma, SIGMA_UNKNOWN))


def above_horizon(flow: FlowField, camera: CameraModel) -> FlowField:
    """Set the confidence of ``flow`` to 0 below the horizon, where rays may meet the floor."""
    falls = flow.points[..., 1] * math.cos(camera.pitch) + camera.focal * math.sin(camera.pitch)
    return dataclasses.replace(flow, confidence=np.where(falls > 0.0, 0.0, flow.confidence))


def _check_grid(camera: CameraModel, rows: int, cols: int, owner: str) -> None:
    """Check that ``rows`` x ``cols`` equal cells fill the camera's image.

    Raises:
        ConfigError: the image's height or width is not a multiple. The key in the message starts
            with ``owner``, the plugin's name.

    """
    for key, count, side, size in (
        ("rows", rows, "height", camera.height),
        ("cols", cols, "width", camera.width),
    ):
        if size % count:
            divisors = [n for n in range(4, size // 4 + 1) if size % n == 0]
            nearest = sorted(sorted(divisors, key=lambda n: abs(n - count))[:4])
            possible = ", ".join(map(str, nearest)) or "none"
            raise ConfigError(
                f"{count} cells cannot divide the image {side} of {size} px equally; "
                f"possible nearby: {possible}",
                key=f"{owner}.{key}",
            )


def grid_points(camera: CameraModel, rows: int, cols: int) -> Array:
    """Return the centres (rows, cols, 2) of the grid's cells [px, from the principal point]."""
    x = (np.arange(cols) + 0.5) * (camera.width / cols) - 0.5 * camera.width
    y = (np.arange(rows) + 0.5) * (camera.height / rows) - 0.5 * camera.height
    return read_only(np.stack(np.meshgrid(x, y), axis=-1))


def check_frame(frame: Frame, camera: CameraModel) -> None:
    """Check that ``frame`` has the camera's size and is uint8 luminance.

    Raises:
        ConfigError: size or type differ.

    """
    image = frame.image
    if image.shape != (camera.height, camera.width) or image.dtype != np.uint8:
        size = " x ".join(map(str, image.shape[::-1]))
        raise ConfigError(
            f"the frame at {frame.time:.3f} s is {size} {image.dtype}, but the camera model "
            f"specifies {camera.width} x {camera.height} uint8 luminance",
            key="camera",
        )


class GridFlow(interfaces.FlowProcessor):
    """Base class of processors whose field has one vector per cell of a regular grid."""

    class Params(interfaces.FlowProcessor.Params):
        """The size of the grid."""

        rows: int = Field(12, ge=2, le=120, description="rows of the grid")
        cols: int = Field(16, ge=2, le=160, description="columns of the grid")

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        p, camera = self.params, robot.camera
        _check_grid(camera, p.rows, p.cols, self.name)
        self._points = grid_points(camera, p.rows, p.cols)


class MatchedFlow(GridFlow):
    """Base class of processors that match two images.

    The past image is first warped by the camera's known rotation, so that the method has to match
    only the translational part. The resulting field contains the whole motion again.
    """

    @abstractmethod
    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        """Match ``now`` with ``past``, which is already warped into the current axes.

        ``visible`` (left, right, top, bottom) limits the pixels of ``past`` that come from the past
        image. Returns vectors (rows, cols, 2) [px], now - past; confidence (rows, cols); and sigma
        (rows, cols) [px].
        """

    def compute(self, pair: FramePair) -> FlowField:
        """Measure the flow from ``pair.past`` to ``pair.now``, with confidence and sigma per cell.

        Raises:
            ConfigError: size or type of a frame is not the camera's.

        """
        camera, rotation = self.robot.camera, pair.motion.rotation
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        past = align_past(pair.past.image, rotation, camera)
        visible = visible_in_past(rotation, camera)
        vectors, confidence, sigma = self._match(pair.now.image, past, visible)
        if is_frozen(pair, camera):
            confidence[:] = 0.0
        origins = rotate_points(self._points - vectors, rotation.T, camera.focal)
        return FlowField(
            time=pair.now.time,
            points=self._points,
            vectors=self._points - origins,
            confidence=confidence,
            sigma=np.where(confidence > 0.0, np.minimum(sigma, SIGMA_UNKNOWN), SIGMA_UNKNOWN),
            motion=pair.motion,
        )
