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

_SURE = 0.25  # chosen
"""Standard deviation [m] of the position up to which the localiser places what is seen."""


class MapGrowth:
    """Grows the map of one robot: ``growing_map`` has what was observed in this run.

    With ``corrects`` loops are closed, and the belief is corrected by it, for stacks whose only map
    it is. Otherwise the localiser says where the robot is in the map that was given.
    """

    def __init__(self, robot: RobotModel, corrects: bool) -> None:
        self._corrects = corrects
        self.growing_map = GrowingMap(robot, close_loops=corrects)
        self.reset(None)

    def reset(self, pose: Pose | None) -> None:
        """Begin an empty map in whose frame the robot is at ``pose``, by default the origin."""
        self.growing_map.reset(pose)
        self._handed_over = -math.inf

    def corrected(self, belief: Belief, odometry: Odometry) -> Belief:
        """Return ``belief`` with its pose corrected as the map was, up to the last frame."""
        growing = self.growing_map
        if not self._corrects or belief.lost or not growing.begun:
            return belief
        return replace(belief, pose=growing.correction.compose(odometry.pose))

    def update(
        self,
        odometry: Odometry,
        local_map: LocalMap,
        moving: Sequence[OccupiedDisc],
        percept: Percept | None,
        seen_from: Pose,
        belief: Belief | None = None,
    ) -> None:
        """Take in a frame, after ``local_map`` has; leave out what ``moving`` obstacles cover.

        ``percept``, seen from odom pose ``seen_from``, is what the frame shows, if anything;
        ``belief`` that of the localiser, if there is one.
        """
        if self._corrects or belief is None:
            self.growing_map.update(odometry, local_map, moving, percept, seen_from)
        elif not belief.lost and belief.sigma <= _SURE:
            self.growing_map.update(odometry, local_map, moving, placed=belief.pose)

    def hand_over(self, planner: GuardedPlanner, time: float) -> None:
        """Give ``planner`` the grid of the frame before at ``time`` [s], if one is due."""
        due = self.growing_map.begun and time - self._handed_over >= _INTERVAL - 1e-6
        if due and planner.wants_grid:
            self._handed_over = time
            planner.observe_grid(self.growing_map.grid)
