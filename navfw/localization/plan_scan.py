"""What a percept shows of walls: points on upright surfaces, in base_link, with their sigmas.

The memory keeps scans in the odom frame while the robot moves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Label, Percept, Pose

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


class ScanMemory:
    """Scans with their poses in ``odom``, over the last ``length`` [m] of the way."""

    def __init__(self, length: float) -> None:
        self._length = length
        self._scans: deque[tuple[float, Pose, PlanScan]] = deque()

    def __len__(self) -> int:
        return len(self._scans)

    def add(self, driven: float, odom: Pose, scan: PlanScan) -> None:
        """Add a scan that was seen from ``odom`` after ``driven`` [m]."""
        self._scans.append((driven, odom, scan))
        self.forget(driven - self._length)

    def forget(self, before: float) -> None:
        """Drop the scans from before that way [m]; the newest one is kept."""
        while len(self._scans) > 1 and self._scans[0][0] < before:
            self._scans.popleft()

    @property
    def newest(self) -> tuple[float, Pose]:
        """Way [m] and pose in ``odom`` of the newest scan."""
        driven, odom, _ = self._scans[-1]
        return driven, odom

    @property
    def poses(self) -> Iterator[Pose]:
        """The poses in ``odom``, oldest first."""
        return (odom for _, odom, _ in self._scans)

    def cloud(self, viewpoint: Pose, count: int) -> PlanScan:
        """About ``count`` points of all scans, evenly picked, seen from odom pose ``viewpoint``."""
        points, sigma, origins = [], [], []
        for _, odom, scan in self._scans:
            pose = viewpoint.relative(odom)
            points.append(pose.points_to_parent(scan.points))
            origins.append(pose.points_to_parent(scan.origins))
            sigma.append(scan.sigma)
        step = max(1, sum(map(len, sigma)) // count)
        picked = (np.concatenate(arrays)[::step] for arrays in (points, sigma, origins))
        return PlanScan(*map(np.ascontiguousarray, picked))
