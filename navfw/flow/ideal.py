"""Flow from true depth and true motion: the paper's synthetic mode (paper sec 5), for evaluation.

Ground truth is not available on a robot. The plugin therefore declares ``oracle``: a stack file
that uses it must set ``oracle: true``, and only missions and benchmarks can provide a
``TruthSource``.
"""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np

from navfw.errors import PluginError
from navfw.flow.confidence import SIGMA_UNKNOWN
from navfw.flow.grid_flow import GridFlow, check_frame
from navfw.numerics import Array
from navfw.numerics.arrays import Floats
from navfw.numerics.products import product
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair

#: Standard deviation reported with ideal flow [px].
SIGMA = 0.02
#: Largest ratio of the nearness of neighbouring pixels of one surface.
_ONE_SURFACE = 1.15


class TruthSource(Protocol):
    """Source of ground truth: the simulator, made accessible by a mission or a benchmark."""

    def depth(self, frame: Frame) -> Floats:
        """True depth (height, width) [m] along the optical axis of ``frame``; inf: no surface."""
        ...

    def motion(self, pair: FramePair) -> CameraMotion:
        """True motion of the camera between the frames of ``pair``."""
        ...


class Ideal(GridFlow):
    """Flow without error, from the simulator's depth and the true motion; for evaluation only.

    A cell has confidence 1 if its surface point projects into the past image, whether occluded
    there or not. The field's ``motion`` is the measured one: gyro and odometry stay realistic.
    """

    name: ClassVar[str] = "ideal"
    oracle: ClassVar[bool] = True

    def __init__(self, robot: RobotModel, params: GridFlow.Params | None = None) -> None:
        super().__init__(robot, params)
        self._truth: TruthSource | None = None

    def set_truth(self, truth: TruthSource) -> None:
        """Set the source of ground truth."""
        self._truth = truth

    def compute(self, pair: FramePair) -> FlowField:
        """True flow of ``pair.now`` against ``pair.past``.

        Raises:
            PluginError: no source of ground truth has been set.

        """
        camera = self.robot.camera
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        if self._truth is None:
            raise PluginError(
                "ideal flow needs the simulator's ground truth, which only a mission or a "
                "benchmark provides; choose another flow processor",
                key=self.name,
            )
        motion = self._truth.motion(pair)
        nearness = nearness_at(self._points, self._truth.depth(pair.now), camera)
        vectors = true_vectors(self._points, nearness, motion, camera.focal)
        x, y = np.moveaxis(self._points - vectors, -1, 0)
        seen = (np.abs(x) <= 0.5 * camera.width) & (np.abs(y) <= 0.5 * camera.height)
        return FlowField(
            time=pair.now.time,
            points=self._points,
            vectors=np.where(np.isfinite(vectors), vectors, 0.0),
            confidence=np.where(seen, 1.0, 0.0),
            sigma=np.where(seen, SIGMA, SIGMA_UNKNOWN),
            motion=pair.motion,
        )


def nearness_at(points: Array, depth: Floats, camera: CameraModel) -> Array:
    """Nearness 1/Z [1/m] at image ``points`` (..., 2) [px], interpolated in ``depth``.

    Nearness is affine over the image of a plane, so bilinear interpolation is exact on planes.
    Where the four pixels around a point show more than one surface, the nearest pixel's value is
    taken.
    """
    column = np.clip(points[..., 0] + 0.5 * camera.width - 0.5, 0.0, camera.width - 1.0)
    row = np.clip(points[..., 1] + 0.5 * camera.height - 0.5, 0.0, camera.height - 1.0)
    x0 = np.minimum(np.floor(column).astype(np.int64), camera.width - 2)
    y0 = np.minimum(np.floor(row).astype(np.int64), camera.height - 2)
    fx, fy = column - x0, row - y0
    nearness: Array = 1.0 / depth.astype(np.float64)
    corners = np.stack(
        [nearness[y0 + j, x0 + i] for j in (0, 1) for i in (0, 1)],
        axis=-1,
    )
    weights = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], axis=-1)
    mixed = np.sum(weights * corners, axis=-1)
    one = corners.max(axis=-1) <= _ONE_SURFACE * corners.min(axis=-1)
    chosen = np.take_along_axis(corners, weights.argmax(axis=-1)[..., None], axis=-1)[..., 0]
    return np.asarray(np.where(one, mixed, chosen))


def true_vectors(points: Array, nearness: Array, motion: CameraMotion, focal: float) -> Array:
    """Flow (..., 2) [px] at current ``points`` of static surfaces at ``nearness`` [1/m].

    NaN where a surface was not in front of the past camera. Exact: the current point X is at
    R^T (X + t) in the past camera's axes. The equation is divided by the depth, so that it also
    holds for points at infinity.
    """
    ray = np.concatenate([points / focal, np.ones_like(points[..., :1])], axis=-1)
    past = product(ray + nearness[..., None] * motion.translation, motion.rotation)
    ahead = np.where(past[..., 2:] > 1e-6, past[..., 2:], np.nan)
    return np.asarray(points - focal * past[..., :2] / ahead)
