"""The pose graph: key poses with odometry between them, and matches that close loops.

A match with a large residual counts less, and one that the others contradict is dropped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.mapping import pose_graph_kernels
from navfw.numerics import Array
from navfw.numerics.arrays import Indices
from navfw.signals import Pose, wrap_angle

_STEP, _STEP_SHARE = 0.003, 0.003  # measured
"""Standard deviation of an odometry step's x and y [m]: a floor, and a share of its length. In four
tours its errors were 1 to 2 mm per 1.2 m."""

_TURN, _TURN_SHARE = 0.0015, 0.0015  # measured
"""Standard deviation of its turn [rad]: a floor, and a share of the length [m] and turn [rad]. In
four tours the heading was off by 0.02 rad after 50 m, an error that lasts."""

UNKNOWN: Array = np.diag([1e-4, 1e-4, 1e-4])  # chosen
"""Information of a step that is unknown: the matches decide."""

_HUBER = 2.0  # chosen
"""Residual of a match [sigma] above which it counts less."""

_CONTRADICTED = 6.0  # chosen
"""Residual of a match [sigma] above which it is dropped."""

_ITERATIONS, _SETTLED = 10, 1e-4  # chosen
"""Largest number of iterations, and the step [m, rad] below which they end."""


@dataclass(frozen=True, slots=True)
class Relation:
    """The pose ``second`` as measured in the frame of pose ``first``; information (3, 3)."""

    first: int
    second: int
    measured: Pose
    information: Array


def odometry_information(step: Pose) -> Array:
    """Compute the information (3, 3) of an odometry step between two key poses."""
    length = math.hypot(step.x, step.y)
    along = _STEP + _STEP_SHARE * length
    turn = _TURN + _TURN_SHARE * (length + abs(step.yaw))
    return np.diag([along**-2, along**-2, turn**-2])


class KeyPoseGraph:
    """Poses in ``map``, of which the first is fixed; odometry and ``matches`` between them."""

    def __init__(self) -> None:
        self.poses: list[Pose] = []
        self._chain: list[Relation] = []
        self.matches: list[Relation] = []

    def add(self, pose: Pose, step: Pose | None = None, information: Array | None = None) -> None:
        """Add a pose, ``step`` after the last one; the first has no step.

        Without ``information`` (3, 3) the step is by odometry.
        """
        if step is not None:
            n = len(self.poses)
            known = odometry_information(step) if information is None else information
            self._chain.append(Relation(n - 1, n, step, known))
        self.poses.append(pose)

    def optimize(self) -> list[Relation]:
        """Fit all poses to odometry and matches; return the matches that had to be dropped."""
        dropped: list[Relation] = []
        while True:
            self._fit()
            if not self.matches:
                return dropped
            lengths = self._lengths(self._table())
            worst = int(np.argmax(lengths[len(self._chain) :]))
            if lengths[len(self._chain) + worst] < _CONTRADICTED:
                return dropped
            dropped.append(self.matches.pop(worst))

    def covariance(self, index: int) -> Array:
        """Compute the covariance (3, 3) of x, y [m] and yaw [rad] of the fitted pose ``index``."""
        equations = self._equations(self._table())
        right, columns = equations[-1], list[Array]()
        for axis in range(3):
            right[:] = 0.0
            right[index, axis] = 1.0
            columns.append(pose_graph_kernels.solved(*equations)[index])
        return np.stack(columns, axis=1)

    def _fit(self) -> None:
        poses = self._table()
        for _ in range(_ITERATIONS):
            step = pose_graph_kernels.solved(*self._equations(poses))
            poses += step
            if float(np.abs(step).max()) < _SETTLED:
                break
        self.poses = [Pose(x, y, wrap_angle(yaw)) for x, y, yaw in poses.tolist()]

    def _table(self) -> Array:
        return np.array([(pose.x, pose.y, pose.yaw) for pose in self.poses])

    def _equations(self, poses: Array) -> tuple[Array, Array, Indices, Indices, Array]:
        """Return the arguments of ``solved`` for a step from ``poses`` (n, 3)."""
        first, second, measured, information = self._arrays()
        weights = np.ones(len(first))
        closing = np.s_[len(self._chain) :]
        weights[closing] = _HUBER / np.maximum(self._lengths(poses)[closing], _HUBER)
        weighted = weights[:, None, None] * information
        diagonal, across, right = pose_graph_kernels.normal_equations(
            poses, first, second, measured, weighted
        )
        return diagonal, across, first, second, right

    def _arrays(self) -> tuple[Indices, Indices, Array, Array]:
        relations = [*self._chain, *self.matches]
        return (
            np.array([relation.first for relation in relations], dtype=np.int64),
            np.array([relation.second for relation in relations], dtype=np.int64),
            np.array([(r.measured.x, r.measured.y, r.measured.yaw) for r in relations]).reshape(
                -1, 3
            ),
            np.array([relation.information for relation in relations]).reshape(-1, 3, 3),
        )

    def _lengths(self, poses: Array) -> Array:
        """Compute the residuals (m,) of all relations [sigma]."""
        first, second, measured, information = self._arrays()
        off = pose_graph_kernels.residuals(poses, first, second, measured)
        squared: Array = np.einsum("ea,eab,eb->e", off, information, off)
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))
