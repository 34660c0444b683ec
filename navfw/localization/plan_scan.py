"""What a percept shows of walls: points on upright surfaces, in base_link, with their sigmas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Array, Label, Percept

_MIN_HEIGHT, MAX_HEIGHT = 0.12, 2.0
"""Heights [m above the floor] between which seen points count: below is the floor with its error,
above may be the ceiling."""

MAX_DEPTH = 4.0
"""Largest depth [m] of a point."""

MIN_CONFIDENCE = 0.3
"""Least confidence of a cell."""

MIN_SIGMA = 0.03
"""Least standard deviation of a depth, as a part of it: what the cells of a percept share."""


@dataclass(frozen=True, slots=True)
class PlanScan:
    """Points (n, 2) [m] in base_link, and their standard deviations (n,) [m] along the rays.

    ``origins`` (n, 2) [m, base_link] is where the camera was when it saw each point.
    """

    points: Array
    sigma: Array
    origins: Array

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.sigma)


def scan_of(percept: Percept, robot: RobotModel) -> PlanScan:
    """The points of obstacles and of what stands higher, seen in ``percept``."""
    camera = robot.camera
    nearness = percept.nearness
    upright = (percept.label == Label.OBSTACLE) | (percept.label == Label.ABOVE)
    used = (
        upright
        & (percept.confidence >= MIN_CONFIDENCE)
        & (nearness > 1.0 / MAX_DEPTH)
        & (percept.height > _MIN_HEIGHT)
        & (percept.height < MAX_HEIGHT)
    )
    depth = 1.0 / nearness[used]
    image = percept.points[used] / camera.focal
    rays = product(np.column_stack([image, np.ones(len(image))]), camera.base_from_camera.T)
    lens = np.array([camera.mount_forward, 0.0])
    points = np.ascontiguousarray(depth[:, None] * rays[:, :2] + lens)
    relative = np.maximum(percept.sigma[used] * depth, MIN_SIGMA)
    sigma = relative * depth * np.hypot(rays[:, 0], rays[:, 1])
    return PlanScan(points, np.ascontiguousarray(sigma), np.tile(lens, (len(points), 1)))
