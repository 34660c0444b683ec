"""Fit focal length and distortion so that tracked points obey one motion in each pair.

With a wrong lens the epipolar residuals of turning pairs grow: their flow is not that of a
rotation. The parameters are fitted to the residuals of all pairs by robust least squares; each
pair's motion is fitted anew for every trial (variable projection). Residuals are in pixels of the
original image, so that stretching it costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from scipy.optimize import least_squares

from navfw.camera_geometry.rotations import rotation_vector
from navfw.egomotion.epipolar_kernels import fit_motion
from navfw.egomotion.flow_egomotion import FREE_TURN, PointMotion, estimate_egomotion
from navfw.lenses import CURVATURES, LensShape, focal_for
from navfw.numerics import Array

SIGMA = 0.18
"""Standard deviation of a track [px of the image in which it was tracked]."""

CAUCHY = 2.385
"""Width of the robust cost [sigma]."""

VIEWS = (55.0, 75.0, 95.0, 120.0)
"""Horizontal fields of view [deg] with which the search begins."""

_BENDS = (0.0, 0.5, 1.0)
"""Curvatures with which it begins."""

_SEARCHED = 16
"""Number of pairs of the first search."""

_MIN_FOCAL, _MAX_FOCAL = 0.3, 20.0
"""Least and largest focal length, relative to half of the width."""

_STEPS = np.array([0.004, 0.01])
"""Steps of the numerical derivatives by the logarithm of the focal length and the curvature."""

_MIN_STRETCH = 0.3
"""Least factor by which straightening changes a standard deviation."""

BEHIND = 10.0
"""Residual [sigma] given to a point that a motion moves behind the camera."""

_FREE = np.eye(3) / FREE_TURN**2
_ANYWHERE = np.array([0.0, 0.0, 1.0]), np.zeros((3, 3))


Motion: TypeAlias = tuple[Array, Array]
"""Rotation (3, 3), past to current camera axes, and direction (3,) of the translation."""


class LensFit:
    """The fit to tracks of ``pairs`` of images that are twice ``half`` [px] wide.

    ``view`` [rad] is the horizontal field of view if it is known: the focal length then follows
    from the curvature. ``curvature`` is that of the lens if it is known.
    """

    def __init__(
        self,
        pairs: Sequence[PointMotion],
        half: float,
        view: float | None = None,
        curvature: float | None = None,
    ) -> None:
        self._pairs = pairs
        self._half = half
        self._view = view
        self._curvature = curvature
        self._free = np.array([view is None, curvature is None])
        self._motions: list[Motion] = []

    def start(self) -> LensShape:
        """Return the lens of least cost among those of the first search."""
        few = self._pairs[:: max(len(self._pairs) // _SEARCHED, 1)]
        views = VIEWS if self._view is None else (math.degrees(self._view),)
        bends = _BENDS if self._curvature is None else (self._curvature,)
        shapes = [
            LensShape(focal_for(self._half, math.radians(0.5 * view), bend), bend)
            for view in views
            for bend in bends
        ]
        off = [_residuals(few, shape, _first_motions(few, shape)) / CAUCHY for shape in shapes]
        return shapes[int(np.argmin([np.log1p(ratio * ratio).sum() for ratio in off]))]

    def refined(self, start: LensShape, left_out: slice | None = None) -> LensShape:
        """Return the lens of least cost near ``start``, without the pairs of ``left_out``.

        The motions are searched for anew unless pairs are left out: the lens is then near to that
        of all pairs, which was refined before.
        """
        pairs = list(self._pairs)
        if left_out is None:
            self._motions = _first_motions(pairs, start)
        motions = list(self._motions)
        if left_out is not None:
            del pairs[left_out], motions[left_out]
        values = np.array([math.log(start.focal), start.curvature])[self._free]
        steps = _STEPS[self._free]

        def residuals(trial: Array) -> Array:
            return _residuals(pairs, self._shape(trial), motions)

        def slopes(trial: Array) -> Array:
            columns = [
                (residuals(trial + move) - residuals(trial - move)) / (2.0 * step)
                for step, move in zip(steps, np.diag(steps), strict=True)
            ]
            return np.asarray(np.stack(columns, axis=1))

        low = np.array([math.log(_MIN_FOCAL * self._half), CURVATURES[0]])
        high = np.array([math.log(_MAX_FOCAL * self._half), CURVATURES[1]])
        solution = least_squares(
            residuals,
            values,
            jac=slopes,
            bounds=(low[self._free], high[self._free]),
            loss="cauchy",
            f_scale=CAUCHY,
            x_scale=10.0 * steps,
            xtol=1e-3,
            ftol=1e-5,
            max_nfev=12,
        )
        return self._shape(np.asarray(solution.x))

    def bend(self, shape: LensShape) -> float:
        """Return how much rotational flow is bent at the left and right border [px].

        This determines the focal length: the root mean square of the difference between the
        rotational flow there and in the middle of the image.
        """
        turns = np.array([rotation_vector(rotation)[:2] for rotation, _ in self._motions])
        turn = math.sqrt(float((turns**2).sum(axis=1).mean()))
        return turn * self._half**2 / shape.focal

    def _shape(self, values: Array) -> LensShape:
        """Return the lens with the ``values`` of the free parameters."""
        curvature = float(values[-1]) if self._curvature is None else self._curvature
        if self._view is not None:
            return LensShape(focal_for(self._half, 0.5 * self._view, curvature), curvature)
        return LensShape(math.exp(float(values[0])), curvature)


def _first_motions(pairs: Sequence[PointMotion], shape: LensShape) -> list[Motion]:
    motions = []
    for pair in pairs:
        area = np.maximum(np.linalg.det(shape.slopes(pair.past)), _MIN_STRETCH**2)
        points, past = shape.straight(pair.points), shape.straight(pair.past)
        tracks = PointMotion(points, past, SIGMA * np.sqrt(area), np.ones(len(points)))
        motion = estimate_egomotion(tracks, shape.focal)
        motions.append((motion.rotation, motion.direction))
    return motions


def _residuals(pairs: Sequence[PointMotion], shape: LensShape, motions: Sequence[Motion]) -> Array:
    """Return the epipolar residuals [sigma] of the points of all pairs, each at its best motion."""
    return np.concatenate(
        [_pair_residuals(pair, shape, motion) for pair, motion in zip(pairs, motions, strict=True)]
    )


def _pair_residuals(pair: PointMotion, shape: LensShape, motion: Motion) -> Array:
    points, past = shape.straight(pair.points), shape.straight(pair.past)
    slopes = shape.slopes(pair.past)
    weight = np.ones(len(points))
    residual = sigma = weight
    for _ in range(2):
        lines = points * motion[1][2] - shape.focal * motion[1][:2]
        across = np.stack([-lines[:, 1], lines[:, 0]], axis=1)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        # a pixel of the image along the normal of the epipolar line
        sigma = SIGMA * np.linalg.norm(np.einsum("nij,ni->nj", slopes, across), axis=1)
        sigma = np.maximum(sigma, _MIN_STRETCH * SIGMA)
        rotation, direction, _, residual = fit_motion(
            points, past, sigma, weight, shape.focal, motion, (np.eye(3), _FREE), _ANYWHERE, 4
        )
        motion = rotation, direction
    return np.asarray(np.nan_to_num(residual / sigma, nan=BEHIND))
