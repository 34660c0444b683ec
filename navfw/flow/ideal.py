"""Flow from true depth and true motion: the paper's synthetic mode (paper sec 5), for evaluation.

Ground truth is not available on a robot. The plugin therefore declares ``oracle``: a stack file
that uses it must set ``oracle: true``, and only missions and benchmarks can provide a
``TruthSource``.
"""

from __future__ import annotations

import math
from typing import ClassVar, Protocol

import numba
import numpy as np
from pydantic import Field

from navfw.errors import PluginError
from navfw.flow.grid_flow import SIGMA_UNKNOWN, GridFlow, check_frame
from navfw.numerics.arrays import Array, Floats
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair

#: Standard deviation reported with ideal flow [px].
SIGMA = 0.02  # measured
_DENSITY = 0.78  # measured
"""Share of cells that block matching measures. This and the next from 841 rendered pairs of rooms,
clutter, corridors, poles; each cell of each pair is independent, which real flow is not."""
_LOG_SIGMA = (-1.66, 0.65)  # measured
"""Mean and standard deviation of the logarithm of block matching's sigma [px]."""
_ERROR = 0.72  # measured
"""Standard deviation of its errors, outliers left out, as a share of its sigma."""
_OUTLIERS, _OUTLIER = 0.02, 2.0  # measured
"""Share of its errors beyond four sigma, and their mean length [px]."""
_CONFIDENCE = (0.9, -0.58, 0.6)  # measured
"""Mean, spread, and correlation with the logarithm of sigma, of its confidence before clipping."""
#: Largest ratio of the nearness of neighbouring pixels of one surface.
_ONE_SURFACE = 1.15  # chosen


class TruthSource(Protocol):
    """Source of ground truth: the simulator, made accessible by a mission or a benchmark."""

    def depth(self, frame: Frame) -> Floats:
        """Return true depth (height, width) [m] along the optical axis; inf: no surface."""

    def motion(self, pair: FramePair) -> CameraMotion:
        """Return the true motion of the camera between the frames of ``pair``."""


class Ideal(GridFlow):
    """Flow from the simulator's depth and the true motion; for evaluation only.

    Without error, or, with ``noisy``, with density, sigma, confidence, errors and outliers as they
    were measured of block matching. A cell has confidence 1 if its surface point projects into the
    past image, whether occluded there or not. The field's ``motion`` is the measured one.
    """

    name: ClassVar[str] = "ideal"
    oracle: ClassVar[bool] = True

    class Params(GridFlow.Params):
        """The grid, and whether the flow has errors."""

        noisy: bool = Field(False, description="with the density and the errors of block matching")

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._truth: TruthSource | None = None

    def set_truth(self, truth: TruthSource, noise: np.random.Generator | None = None) -> None:
        """Set the source of ground truth, and the generator of the noise of ``noisy`` flow."""
        self._truth = truth
        self._noise = np.random.default_rng(0) if noise is None else noise

    def compute(self, pair: FramePair) -> FlowField:
        """Compute the true flow from ``pair.past`` to ``pair.now``.

        Raises:
            PluginError: no source of ground truth has been set.

        """
        camera = self.robot.camera
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        if self._truth is None:
            needs = (
                "needs the simulator's ground truth, which only a mission or a benchmark provides"
            )
            raise PluginError(f"ideal flow {needs}; choose another flow processor", key=self.name)
        motion = self._truth.motion(pair)
        nearness = nearness_at(self._points, self._truth.depth(pair.now), camera)
        vectors = true_vectors(self._points, nearness, motion, camera.focal)
        noise = np.empty((6, 0))
        if self.params.noisy:
            uniform = self._noise.random((2, nearness.size))
            noise = np.concatenate([uniform, self._noise.standard_normal((4, nearness.size))])
        half = 0.5 * camera.width, 0.5 * camera.height
        cells = self._points.reshape(-1, 2), vectors.reshape(-1, 2)
        confidence, sigma = _measured(*cells, half, noise).reshape(2, *nearness.shape)
        return FlowField(pair.now.time, self._points, vectors, confidence, sigma, pair.motion)


@numba.njit(cache=True)
def _measured(points: Array, vectors: Array, half: tuple[float, float], noise: Array) -> Array:
    """Confidence and sigma [px] (2, n) of ``vectors`` (n, 2), to which the errors are added.

    A past end beyond ``half`` the image's size is not seen. Of ``noise`` (6, n) the first two rows
    are uniform and four normal; (6, 0): no error.
    """
    measured = np.zeros((2, len(points)))
    (mean, deviation), (middle, width, shared) = _LOG_SIGMA, _CONFIDENCE
    for n in range(len(points)):
        seen = abs(points[n, 0] - vectors[n, 0]) <= half[0]
        seen = seen and abs(points[n, 1] - vectors[n, 1]) <= half[1]
        confidence, sigma = 1.0, SIGMA
        if noise.size:
            seen, spread = seen and noise[0, n] < _DENSITY, noise[2, n]
            sigma = math.exp(mean + deviation * spread)
            mixed = shared * spread + math.sqrt(1.0 - shared**2) * noise[3, n]
            confidence = min(max(middle + width * mixed, 0.02), 1.0)
            # a Gaussian in two dimensions has the mean length sqrt(pi / 2) standard deviations
            outlier = noise[1, n] < _OUTLIERS
            length = _OUTLIER / math.sqrt(0.5 * math.pi) if outlier else _ERROR * sigma
            for k in range(2):
                vectors[n, k] += length * noise[4 + k, n]
        measured[0, n], measured[1, n] = (confidence, sigma) if seen else (0.0, SIGMA_UNKNOWN)
        for k in range(2):
            vectors[n, k] = vectors[n, k] if math.isfinite(vectors[n, k]) else 0.0
    return measured


def nearness_at(points: Array, depth: Floats, camera: CameraModel) -> Array:
    """Interpolate nearness 1/Z [1/m] at image ``points`` (..., 2) [px] in ``depth`` [m].

    ``depth`` may have fewer pixels than the camera's image, of the same field of view. Nearness is
    affine over the image of a plane, so bilinear interpolation is exact on planes. If the four
    pixels around a point show more than one surface, the nearest pixel's value is taken.
    """
    height, width = depth.shape
    scale = width / camera.width, height / camera.height
    nearness = _interpolated(1.0 / depth.astype(np.float64), points.reshape(-1, 2), scale)
    return nearness.reshape(points.shape[:-1])


@numba.njit(cache=True)
def _interpolated(nearness: Array, points: Array, scale: tuple[float, float]) -> Array:
    """``nearness`` (height, width) at ``points`` (n, 2), times ``scale``, from its middle on."""
    height, width = nearness.shape
    values = np.empty(len(points))
    for n in range(len(points)):
        column = min(max(points[n, 0] * scale[0] + 0.5 * width - 0.5, 0.0), width - 1.0)
        row = min(max(points[n, 1] * scale[1] + 0.5 * height - 0.5, 0.0), height - 1.0)
        i, j = min(int(row), height - 2), min(int(column), width - 2)
        up, right = row - i, column - j
        weights = ((1 - right) * (1 - up), right * (1 - up), (1 - right) * up, right * up)
        corners = nearness[i, j], nearness[i, j + 1], nearness[i + 1, j], nearness[i + 1, j + 1]
        mixed, best = 0.0, 0
        for k in range(4):
            mixed += weights[k] * corners[k]
            best = k if weights[k] > weights[best] else best
        # of a hole, where nearness is not a number, the mean is none
        one = max(corners) <= _ONE_SURFACE * min(corners) and not math.isnan(mixed)
        values[n] = mixed if one else corners[best]
    return values


def true_vectors(points: Array, nearness: Array, motion: CameraMotion, focal: float) -> Array:
    """Compute flow (..., 2) [px] at current ``points`` of static surfaces at ``nearness`` [1/m].

    NaN where a surface was not in front of the past camera. Exact: the current point X is at R^T (X
    + t) in the past camera's axes. The equation is divided by the depth, so that it also holds for
    points at infinity.
    """
    flat, motions = points.reshape(-1, 2), (motion.rotation, motion.translation)
    return _true_vectors(flat, nearness.reshape(-1), *motions, focal).reshape(points.shape)


@numba.njit(cache=True)
def _true_vectors(points: Array, nearness: Array, turn: Array, shift: Array, focal: float) -> Array:
    vectors = np.empty_like(points)
    for n, q in enumerate(nearness):
        u, v = points[n, 0] / focal + q * shift[0], points[n, 1] / focal + q * shift[1]
        w = 1.0 + q * shift[2]
        ahead = u * turn[0, 2] + v * turn[1, 2] + w * turn[2, 2]
        for k in range(2):
            past = u * turn[0, k] + v * turn[1, k] + w * turn[2, k]
            vectors[n, k] = points[n, k] - focal * past / ahead if ahead > 1e-6 else np.nan
    return vectors
