"""The growing map: submaps at key poses, joined to one global grid of evidence.

A key pose is taken every 1.2 m or 45 degrees, with a submap of what was observed since the last
one. Submaps are merged in their order, so that what was seen later supersedes what was seen before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.localmap import LocalMap
from navfw.mapping.evidence_grid import EvidenceGrid, KeyPose
from navfw.mapping.submaps import SubmapCutter
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, OccupiedDisc, Odometry, Pose


class GrowingMapParams(StrictModel):
    """When a key pose is taken."""

    key_distance: Annotated[
        float, Field(gt=0.0, le=10.0, description="distance driven between key poses [m]")
    ] = 1.2
    key_turn: Annotated[
        float, Field(gt=0.0, le=10.0, description="turn between key poses [rad]")
    ] = 0.8


class GrowingMap:
    """Joins what one robot's local map observes to a grid in the frame ``map``.

    ``correction`` is the pose of ``odom`` in ``map``. ``keys`` are the key poses so far.
    """

    def __init__(self, robot: RobotModel, params: GrowingMapParams | None = None) -> None:
        self.robot = robot
        self.params = params or GrowingMapParams()
        self._cutter = SubmapCutter()
        self.reset()

    def reset(self, start: Pose | None = None) -> None:
        """Begin an empty map in whose frame the robot is at ``start``, by default the origin."""
        self._start = start or Pose(0.0, 0.0, 0.0)
        self._cutter.reset()
        self.keys: list[KeyPose] = []
        self.correction = self._start
        self._grid: EvidenceGrid | None = None
        self._odometry: Odometry | None = None
        self._local_map: LocalMap | None = None
        self._moving: Sequence[OccupiedDisc] = ()
        self._driven = self._turned = 0.0

    # --- writing ---------------------------------------------------------------------------------

    def update(
        self, odometry: Odometry, local_map: LocalMap, moving: Sequence[OccupiedDisc] = ()
    ) -> bool:
        """Take in a camera frame, after ``local_map`` has; return whether a key pose was added.

        What was observed under ``moving`` obstacles (odom) is left out.
        """
        last, self._odometry = self._odometry, odometry
        self._local_map, self._moving = local_map, moving
        if last is None:
            self.correction = self._start.frame_of(odometry.pose)
            self._grid = EvidenceGrid(local_map.occupancy.params.cell)
            return False
        step = last.pose.relative(odometry.pose)
        self._driven += math.hypot(step.x, step.y)
        self._turned += abs(step.yaw)
        if self._driven < self.params.key_distance and self._turned < self.params.key_turn:
            return False
        self.finish()
        return True

    def finish(self) -> None:
        """Add a key pose where the robot is, with what was observed since the last one."""
        if self._odometry is None or self._local_map is None or self._grid is None:
            return
        self._driven = self._turned = 0.0
        odom, time = self._odometry.pose, self._odometry.time
        submap = self._cutter.cut(self._local_map, odom, time, self._moving)
        key = KeyPose(submap, self.correction.compose(odom))
        self.keys.append(key)
        self._grid.merge(key)

    # --- reading ---------------------------------------------------------------------------------

    @property
    def pose(self) -> Pose:
        """Where the robot is in ``map``, by corrected odometry."""
        if self._odometry is None:
            return self._start
        return self.correction.compose(self._odometry.pose)

    @property
    def grid(self) -> GrownGrid:
        """What has been observed so far, with what was seen since the last key pose.

        Raises:
            RuntimeError: there was no ``update`` yet.

        """
        if self._odometry is None or self._local_map is None or self._grid is None:
            raise RuntimeError("the growing map has observed nothing yet; call update first")
        odom, time = self._odometry.pose, self._odometry.time
        newest = self._cutter.observed(self._local_map, odom, time, self._moving)
        canvas = self._grid.copy()
        canvas.merge(KeyPose(newest, self.pose))
        return GrownGrid(canvas.cells, canvas.origin, canvas.cell)

    @property
    def drops(self) -> Array:
        """Spots (n, 2) [m, map] whose floor is missing."""
        spots = [key.correction.points_to_parent(key.submap.drops) for key in self.keys]
        return np.concatenate(spots) if spots else np.empty((0, 2))
