"""The growing map as a part of the stack: it takes in each frame; the planner gets its grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from navfw.guard.guarded_stages import GuardedPlanner
from navfw.localmap import LocalMap
from navfw.mapping import GrowingMap
from navfw.robot import RobotModel
from navfw.signals import Belief, OccupiedDisc, Odometry, Percept, Pose

_INTERVAL = 0.5  # chosen
"""Time [s] between two grids for the planner."""


class MapGrowth:
    """Grows the map of one robot, if ``wanted``; ``growing_map`` is None if not."""

    def __init__(self, robot: RobotModel, wanted: bool) -> None:
        self.growing_map = GrowingMap(robot) if wanted else None
        self.reset(None)

    def reset(self, pose: Pose | None) -> None:
        """Begin an empty map in whose frame the robot is at ``pose``, by default the origin."""
        if self.growing_map is not None:
            self.growing_map.reset(pose)
        self._due_since = -math.inf
        self._due = False

    def corrected(self, belief: Belief, odometry: Odometry) -> Belief:
        """Return ``belief`` with its pose corrected as the map was, up to the last frame."""
        growing = self.growing_map
        if growing is None or belief.lost or self._due_since == -math.inf:
            return belief
        return replace(belief, pose=growing.correction.compose(odometry.pose))

    def update(
        self,
        odometry: Odometry,
        local_map: LocalMap,
        moving: Sequence[OccupiedDisc],
        percept: Percept | None,
        seen_from: Pose,
    ) -> None:
        """Take in a frame, after ``local_map`` has; leave out what ``moving`` obstacles cover.

        ``percept``, seen from odom pose ``seen_from``, is what the frame shows, if anything.
        """
        if self.growing_map is None:
            return
        self.growing_map.update(odometry, local_map, moving, percept, seen_from)
        if odometry.time - self._due_since >= _INTERVAL - 1e-6:
            self._due_since, self._due = odometry.time, True

    def hand_over(self, planner: GuardedPlanner) -> None:
        """Give ``planner`` the grid of the frame before, if one is due."""
        if self.growing_map is not None and self._due:
            self._due = False
            planner.observe_grid(self.growing_map.grid)
