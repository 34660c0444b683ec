"""Egomotion from the flow: rotation and direction of translation, with their covariance.

Five degrees of freedom are fitted to the epipolar residuals of all vectors by robust least squares
(METHOD 2.6). Gyro and wheels enter as priors; without them nothing is assumed. The global search
over directions comes first, since the residuals have several minima.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache

import numpy as np
import numpy.typing as npt

from navfw.camera_geometry.rotations import rotate_points, rotation_matrix, rotation_vector
from navfw.egomotion.epipolar_kernels import fit_motion, fit_rotation, rate_directions, tangents
from navfw.numerics import Array
from navfw.numerics.linear_systems import inverse, solve
from navfw.numerics.products import product

_DIRECTIONS = 128  # chosen
"""Number of directions of the global search, on a hemisphere: 13 deg apart."""

_STARTS = 5  # chosen
"""Number of minima of the search that are refined."""

_APART = math.cos(math.radians(25.0))  # chosen
"""Cosine of the least angle between two of them."""

_MODEL_SIGMA = 0.1  # chosen
"""Standard deviation [px] of residuals beside the flow's own: distortion, rolling shutter."""

FREE_TURN = 0.15  # chosen
"""Standard deviation [rad] of a rotation about which nothing is known."""

_BOUND = 3.5  # chosen
"""Residual [sigma] above which a point counts as an outlier when minima are compared."""

_DECISIVE = 3.0  # chosen
"""Least difference of log likelihoods between two directions for the better one to be known."""

_MIN_PARALLAX = 0.3  # chosen
"""Least 90th percentile [px] of the flow that a pure rotation leaves, for a translation."""

_MIN_FLOW = 0.25  # chosen
"""Least 90th percentile [px] of the flow, for a motion."""

MIN_VECTORS = 12  # chosen
"""Least number of vectors with confidence."""

_BLOCKS = 4, 2  # chosen
"""Columns and rows of the blocks of an image; each is left out once: the errors of points
that are near to each other are alike (rolling shutter, distortion, things that move)."""

_FEW_BLOCKS = 1.16  # derived
"""Factor of standard deviations from so few blocks: by Student's t, 97 % are then within 2.15."""

_CENTRE_SIGMA = math.radians(0.7)  # chosen
"""Standard deviation [rad] of the heading by a principal point off the centre of the image."""

_MIN_EVIDENCE = 2.0  # chosen
"""Least 90th percentile of the vectors' parts along the lines through the focus of expansion, over
that of the parts across, for a translation."""

_SIGN_SHARE = 0.6  # chosen
"""Least share of the vectors that point away from, or towards, the focus of expansion."""


class MotionKind(StrEnum):
    """Kind of the camera's motion between two images."""

    FORWARD = "forward"
    BACKWARD = "backward"
    SIDEWAYS = "sideways"
    ROTATION = "rotation"
    STILL = "still"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class EgomotionPrior:
    """Prior knowledge of the motion, without the flow, in current camera axes.

    ``rotation`` (3, 3), past to current axes, with ``rotation_covariance`` (3, 3) [rad^2] of a
    small rotation about the camera's axes; ``direction`` (3,) of the translation with
    ``direction_sigma`` [rad], infinite if nothing is known.
    """

    rotation: Array = field(default_factory=lambda: np.eye(3))
    rotation_covariance: Array = field(default_factory=lambda: np.eye(3) * FREE_TURN**2)
    direction: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    direction_sigma: float = math.inf

    @property
    def information(self) -> Array:
        """Inverse (3, 3) [1/rad^2] of ``rotation_covariance``."""
        return np.asarray(inverse(self.rotation_covariance), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class PointMotion:
    """Points in two images: flat float64 arrays.

    ``points`` (n, 2) [px from the principal point] in the current image, ``past`` (n, 2) the same
    points in the past image, ``sigma`` (n,) [px] one standard deviation of their difference, and
    ``weight`` (n,) in [0, 1], 0 for points to leave out.
    """

    points: Array
    past: Array
    sigma: Array
    weight: Array

    @property
    def used(self) -> npt.NDArray[np.bool_]:
        """Mask (n,) of the points with a weight above 0."""
        return np.asarray(self.weight > 0.0)

    def median(self, residual: Array) -> float:
        """Compute the median of absolute ``residual`` (n,) over sigma; 1 if no point is used."""
        off = np.abs(residual / self.sigma)[self.used & np.isfinite(residual)]
        return float(np.median(off)) if off.size else 1.0

    def percentile(self, vectors: Array) -> float:
        """Compute the 90th percentile of the lengths of ``vectors`` (n, 2) of the used points.

        Those that are not finite are left out; infinite if all are.
        """
        length = np.hypot(vectors[:, 0], vectors[:, 1])[self.used]
        length = length[np.isfinite(length)]
        return float(np.quantile(length, 0.9)) if length.size else math.inf


@dataclass(frozen=True, slots=True)
class Egomotion:
    """The motion between two images, in current camera axes.

    ``rotation`` (3, 3) turns past into current axes; ``direction`` (3,) is the unit vector of the
    camera's translation. ``covariance`` (5, 5) [rad^2] is that of a small rotation about the
    camera's axes, and of bearing and elevation of the direction. ``heading_sigma`` [rad] is the
    largest standard deviation of the direction, infinite unless ``kind`` is a translation.
    """

    kind: MotionKind
    rotation: Array
    direction: Array
    covariance: Array
    heading_sigma: float

    def deviations(self, sigmas: float) -> Iterator[tuple[Array, Array]]:
        """Yield motions that are ``sigmas`` standard deviations off, both ways on principal axes.

        Each is a small rotation (3, 3), to be done after ``rotation``, and the unit vector (3,) of
        the translation. Nothing if the direction is unknown.
        """
        if not np.isfinite(self.covariance).all():
            return
        variances, axes = np.linalg.eigh(self.covariance)
        basis = tangents(self.direction)
        for variance, axis in zip(variances.tolist(), axes.T, strict=True):
            for signed in (-sigmas, sigmas):
                off = signed * math.sqrt(max(variance, 0.0)) * axis
                direction = self.direction + product(off[3:], basis)
                yield (
                    rotation_matrix(np.ascontiguousarray(off[:3])),
                    direction / math.hypot(*direction),
                )


def estimate_egomotion(
    motion: PointMotion, focal: float, prior: EgomotionPrior | None = None
) -> Egomotion:
    """Estimate the camera's motion from ``motion`` of image points, and a ``prior`` if known."""
    prior = prior or EgomotionPrior()
    if int(motion.used.sum()) < MIN_VECTORS:
        return without_direction(MotionKind.UNKNOWN, prior)
    motion = replace(motion, sigma=np.hypot(motion.sigma, _MODEL_SIGMA))
    arrays = (motion.points, motion.past, motion.sigma, motion.weight, focal)
    rotation = fit_rotation(*arrays, prior.rotation, prior.information, 8)
    left = motion.points - rotate_points(motion.past, rotation, focal)
    if motion.percentile(left) < _MIN_PARALLAX:
        still = motion.percentile(motion.points - motion.past) < _MIN_FLOW
        kind = MotionKind.STILL if still else MotionKind.ROTATION
        return without_direction(kind, prior, rotation)
    return _translation(motion, focal, prior)


def _translation(motion: PointMotion, focal: float, prior: EgomotionPrior) -> Egomotion:
    """Return the motion with a translation."""
    information = prior.information
    pull = np.zeros((3, 3))
    if math.isfinite(prior.direction_sigma):
        pull = np.eye(3) / prior.direction_sigma**2
    arrays = (motion.points, motion.past, motion.sigma, motion.weight, focal)
    if prior.direction[2] < 0.0:  # residuals do not distinguish a direction from its opposite
        prior = replace(prior, direction=-prior.direction)
    starts = _starts(motion, focal, prior, information, pull)
    fits = [
        fit_motion(
            *arrays,
            (rotation, direction),
            (prior.rotation, information),
            (prior.direction, pull),
            12,
        )
        for rotation, direction in starts
    ]
    scale = min(max(1.0, motion.median(fit[3]) / 0.674) for fit in fits)
    costs = [
        _bounded_cost(motion, fit[3], scale) + _surprise(prior, fit[0], fit[1]) for fit in fits
    ]
    best = int(np.argmin(costs))
    rotation, direction, matrix, _ = fits[best]
    share, evidence = _along_lines(motion, focal, rotation, direction)
    if evidence < _MIN_EVIDENCE:
        return without_direction(MotionKind.ROTATION, prior, rotation)

    def refit(weight: Array) -> tuple[Array, Array]:
        start, known = (rotation, direction), (prior.rotation, information)
        fitted = fit_motion(*arrays[:3], weight, focal, start, known, (prior.direction, pull), 5)
        return fitted[0], fitted[1]

    # errors that are alike widen the one, a plane that leaves the motion open the other
    least_squares = np.asarray(inverse(matrix + 1e-9 * np.eye(5)) * scale**2)
    without_blocks = _jackknife(motion, rotation, direction, refit)
    covariance = max(least_squares, without_blocks, key=lambda c: float(np.trace(c[3:, 3:])))
    covariance[3:, 3:] += np.eye(2) * _CENTRE_SIGMA**2
    sigma = math.sqrt(max(float(np.linalg.eigvalsh(covariance[3:, 3:])[-1]), 0.0))
    if share < 0.5:
        direction, share = -direction, 1.0 - share
    rivals = [
        cost - costs[best]
        for cost, other in zip(costs, fits, strict=True)
        if abs(float(product(other[1], direction))) < math.cos(min(max(3.0 * sigma, 0.15), 1.5))
    ]
    decided = share >= _SIGN_SHARE and all(gap > _DECISIVE for gap in rivals)
    return Egomotion(
        kind=_kind(direction) if decided else MotionKind.UNKNOWN,
        rotation=rotation,
        direction=direction,
        covariance=covariance,
        heading_sigma=sigma if decided else math.inf,
    )


def _jackknife(
    motion: PointMotion,
    rotation: Array,
    direction: Array,
    refit: Callable[[Array], tuple[Array, Array]],
) -> Array:
    """Covariance (5, 5) of a fit, from the motions by ``refit`` without each block of the image."""
    number = np.zeros(len(motion.points), dtype=np.int64)
    for axis, count in enumerate(_BLOCKS):
        places = motion.points[:, axis]
        edges = np.quantile(places[motion.used], np.arange(1, count) / count)
        number = number * count + np.searchsorted(edges, places)
    basis, count = tangents(direction), math.prod(_BLOCKS)
    off = np.zeros((count, 5))
    for block in range(count):
        other, heading = refit(np.where(number == block, 0.0, motion.weight))
        off[block, :3] = rotation_vector(product(other, rotation.T))
        off[block, 3:] = product(basis, heading - direction)
    off -= off.mean(axis=0)
    return np.asarray(product(off.T, off) * _FEW_BLOCKS**2 * (count - 1) / count)


def _bounded_cost(motion: PointMotion, residual: Array, scale: float) -> float:
    """Negative log likelihood of a fit with outliers: none costs more than _BOUND^2 / 2.

    Which of several minima is right is decided by the points that it explains, however far off the
    others are. ``scale`` is the ratio of residuals to their standard deviations.
    """
    use = motion.used & np.isfinite(residual)
    off = (residual[use] / (scale * motion.sigma[use])) ** 2
    return float((0.5 * motion.weight[use] * off / (1.0 + off / _BOUND**2)).sum())


def _surprise(prior: EgomotionPrior, rotation: Array, direction: Array) -> float:
    """Negative log likelihood of a motion by ``prior``; the sign of ``direction`` is open."""
    turn = rotation_vector(product(rotation, prior.rotation.T))
    cost = 0.5 * float(product(turn, solve(prior.rotation_covariance, turn)))
    if math.isfinite(prior.direction_sigma):
        gap = 2.0 - 2.0 * abs(float(product(direction, prior.direction)))
        cost += 0.5 * gap / prior.direction_sigma**2
    return cost


def _starts(
    motion: PointMotion, focal: float, prior: EgomotionPrior, information: Array, pull: Array
) -> list[tuple[Array, Array]]:
    """The best directions of the search with their rotations, at least _APART from each other."""
    past = rotate_points(motion.past, prior.rotation, focal)
    directions = _hemisphere()
    cost, turns = rate_directions(
        motion.points, past, motion.sigma, motion.weight, focal, directions, information
    )
    gap = directions - prior.direction
    cost = cost + 0.5 * ((product(gap, pull)) * gap).sum(axis=1)
    starts: list[tuple[Array, Array]] = []
    for k in np.argsort(cost, kind="stable").tolist():
        if all(abs(float(product(directions[k], other))) < _APART for _, other in starts):
            starts.append((product(rotation_matrix(turns[k]), prior.rotation), directions[k]))
        if len(starts) == _STARTS:
            break
    return starts


@cache
def _hemisphere() -> Array:
    """Return ``_DIRECTIONS`` unit vectors (n, 3) spread evenly over the half space z >= 0."""
    k = np.arange(_DIRECTIONS) + 0.5
    z = 1.0 - k / _DIRECTIONS
    angle = k * math.pi * (3.0 - math.sqrt(5.0))
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)


def _along_lines(
    motion: PointMotion, focal: float, rotation: Array, direction: Array
) -> tuple[float, float]:
    """Share of the significant vectors that point away from the focus of expansion; the evidence.

    That is how much longer vectors are along the lines through the focus than across them: errors
    alone, beside a rotation, are as long across.
    """
    off = motion.points - rotate_points(motion.past, rotation, focal)
    lines = motion.points * direction[2] - focal * direction[:2]
    lengths = np.maximum(np.hypot(*lines.T), 1e-12)
    along = (off * lines).sum(axis=1) / lengths
    across = (off[:, 0] * lines[:, 1] - off[:, 1] * lines[:, 0]) / lengths
    parts = np.abs(np.stack([along, across], axis=1)[motion.used & np.isfinite(along)])
    evidence = math.inf
    if len(parts):  # without what moves by itself
        parts = parts[parts[:, 1] <= _BOUND / 0.674 * np.median(parts[:, 1])]
        radial, rest = np.quantile(parts, 0.9, axis=0).tolist()
        evidence = radial / max(rest, 1e-9)
    significant = motion.used & (np.abs(along) > 2.0 * motion.sigma)
    total = float(motion.weight[significant].sum())
    forward = float(motion.weight[significant & (along > 0.0)].sum())
    return (forward / total if total > 0.0 else 0.5), evidence


def _kind(direction: Array) -> MotionKind:
    """Forward and backward within 60 deg of the optical axis, else sideways."""
    if abs(direction[2]) < 0.5:
        return MotionKind.SIDEWAYS
    return MotionKind.FORWARD if direction[2] > 0.0 else MotionKind.BACKWARD


def without_direction(
    kind: MotionKind,
    prior: EgomotionPrior,
    rotation: Array | None = None,
    direction: Array | None = None,
) -> Egomotion:
    """Make an egomotion with unknown direction of translation; ``direction`` is a guess."""
    guess = prior.direction if direction is None else direction
    return Egomotion(
        kind=kind,
        rotation=prior.rotation if rotation is None else rotation,
        direction=guess / math.hypot(*guess),
        covariance=np.diag([*prior.rotation_covariance.diagonal(), math.inf, math.inf]),
        heading_sigma=math.inf,
    )
