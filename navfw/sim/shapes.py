"""Plane geometry of solids: rectangles and circles, signed distances, overlaps and gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.signals import Pose

OVERLAP_TOLERANCE = 0.002
"""Depth by which two solids of a world file may overlap [m]: coordinates are rounded."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle around (x, y) [m] with half sizes (half_x, half_y) [m], turned by yaw [rad]."""

    x: float
    y: float
    half_x: float
    half_y: float
    yaw: float = 0.0

    @property
    def corners(self) -> Array:
        """Corners (4, 2) [m], counter-clockwise."""
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return Pose(self.x, self.y, self.yaw).points_to_parent(signs * (self.half_x, self.half_y))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounding box (min x, min y, max x, max y) [m]."""
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @property
    def reach(self) -> float:
        """Radius [m] of the circumscribed circle."""
        return math.hypot(self.half_x, self.half_y)

    def distance(self, points: Array) -> Array:
        """Signed distance [m] of points (N, 2) to the outline; negative inside."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = points[:, 0] - self.x, points[:, 1] - self.y
        qx = np.abs(c * dx + s * dy) - self.half_x
        qy = np.abs(-s * dx + c * dy) - self.half_y
        outside = np.hypot(np.maximum(qx, 0.0), np.maximum(qy, 0.0))
        inside = np.minimum(np.maximum(qx, qy), 0.0)
        return outside + inside


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle around (x, y) [m]."""

    x: float
    y: float
    radius: float

    @property
    def yaw(self) -> float:
        """0: a circle looks the same from all sides."""
        return 0.0

    @property
    def reach(self) -> float:
        """The radius [m], as for ``Rectangle``."""
        return self.radius

    @property
    def corners(self) -> Array:
        """Corners (4, 2) [m] of the circumscribed square, counter-clockwise."""
        return Rectangle(self.x, self.y, self.radius, self.radius).corners

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounding box (min x, min y, max x, max y) [m]."""
        r = self.radius
        return self.x - r, self.y - r, self.x + r, self.y + r

    def distance(self, points: Array) -> Array:
        """Signed distance [m] of points (N, 2) to the outline; negative inside."""
        return np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) - self.radius


Shape = Rectangle | Circle


def overlap_depth(a: Shape, b: Shape) -> float:
    """Penetration depth [m] of two shapes; not positive when they do not overlap."""
    if isinstance(a, Circle):
        return a.radius - float(b.distance(np.array([[a.x, a.y]]))[0])
    if isinstance(b, Circle):
        return overlap_depth(b, a)
    # separating axis theorem: the edge normals of both polygons
    depth = math.inf
    corners_a, corners_b = a.corners, b.corners
    for yaw in (a.yaw, a.yaw + math.pi / 2.0, b.yaw, b.yaw + math.pi / 2.0):
        axis = np.array([math.cos(yaw), math.sin(yaw)])
        along_a, along_b = product(corners_a, axis), product(corners_b, axis)
        depth = min(depth, float(min(along_a.max() - along_b.min(), along_b.max() - along_a.min())))
    return depth


def gap_between(a: Shape, b: Shape) -> float:
    """Return the distance [m] between two shapes; not positive when they touch or overlap."""
    if isinstance(a, Circle):
        return float(b.distance(np.array([[a.x, a.y]]))[0]) - a.radius
    if isinstance(b, Circle):
        return gap_between(b, a)
    # the circumscribed circles decide most cases
    apart = math.hypot(a.x - b.x, a.y - b.y) - (a.reach + b.reach)
    if apart <= 0.0 and (depth := overlap_depth(a, b)) >= 0.0:
        return -depth
    # two convex shapes are nearest at a corner of one of them
    return float(min(a.distance(b.corners).min(), b.distance(a.corners).min()))
