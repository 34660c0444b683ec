"""The scans of the last metres, as one cloud of points: odometry is exact enough over them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from navfw.localization.plan_scan import PlanScan
from navfw.signals import Pose


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
        while driven - self._scans[0][0] > self._length:
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

    def cloud(self, here: Pose, count: int) -> PlanScan:
        """About ``count`` points of all scans, evenly picked, seen from odom pose ``here``."""
        points, sigma, origins = [], [], []
        for _, odom, scan in self._scans:
            pose = here.relative(odom)
            points.append(pose.points_to_parent(scan.points))
            origins.append(pose.points_to_parent(scan.origins))
            sigma.append(scan.sigma)
        step = max(1, sum(map(len, sigma)) // count)
        picked = (np.concatenate(part)[::step] for part in (points, sigma, origins))
        return PlanScan(*map(np.ascontiguousarray, picked))
