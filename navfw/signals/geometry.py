"""Poses and velocities in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.numerics.arrays import Array
from navfw.numerics.products import product


def wrap_angle(angle: float) -> float:
    """Return the same angle [rad] in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def position_sigma(covariance: Array) -> float:
    """Return the largest standard deviation [m] of (x, y), given the (3, 3) of (x, y, yaw)."""
    (xx, xy), (_, yy) = covariance[:2, :2].tolist()
    largest = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)  # eigenvalue of the (2, 2)
    return math.sqrt(max(largest, 0.0))


@dataclass(frozen=True, slots=True)
class Pose:
    """A planar pose: x, y [m] and yaw [rad, counter-clockwise] in a named frame (REP-105)."""

    x: float
    y: float
    yaw: float

    def to_local(self, x: float, y: float) -> tuple[float, float]:
        """Convert point (x, y) from this pose's parent frame to its own (x ahead, y left)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = x - self.x, y - self.y
        return c * dx + s * dy, -s * dx + c * dy

    def to_parent(self, x: float, y: float) -> tuple[float, float]:
        """Convert point (x, y) from this pose's own frame (x ahead, y left) to its parent frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + c * x - s * y, self.y + s * x + c * y

    def points_to_parent(self, points: Array) -> Array:
        """Convert points (n, 2) from this pose's own frame to its parent frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turned = product(points, np.array([[c, s], [-s, c]]))
        return np.asarray(turned + np.array((self.x, self.y)))

    def points_to_local(self, points: Array) -> Array:
        """Convert points (n, 2) from this pose's parent frame to its own."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.asarray(product(points - (self.x, self.y), np.array([[c, -s], [s, c]])))

    def compose(self, other: Pose) -> Pose:
        """Convert the pose ``other`` from this pose's own frame to its parent frame."""
        x, y = self.to_parent(other.x, other.y)
        return Pose(x, y, wrap_angle(self.yaw + other.yaw))

    def relative(self, other: Pose) -> Pose:
        """Convert the pose ``other`` from this pose's parent frame to its own."""
        x, y = self.to_local(other.x, other.y)
        return Pose(x, y, wrap_angle(other.yaw - self.yaw))

    def frame_of(self, local: Pose) -> Pose:
        """Return the pose, in the parent frame, of the frame in which this pose is ``local``."""
        yaw = wrap_angle(self.yaw - local.yaw)
        turned = Pose(0.0, 0.0, yaw).compose(local)
        return Pose(self.x - turned.x, self.y - turned.y, yaw)


@dataclass(frozen=True, slots=True)
class Twist:
    """A unicycle velocity: v = linear.x [m/s] forward, w = angular.z [rad/s] counter-clockwise."""

    v: float
    w: float
