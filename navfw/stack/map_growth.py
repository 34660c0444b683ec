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

_JUMP = 1.0  # measured
"""Distance [m] by which localisers jump only to a wrong pose or back: in 12 drives by 4 to 32 m,
else by up to 0.4 m. After 75 s one came back to within 0.3 m of odometry."""


class MapGrowth:
    """Grows the map of one robot: ``growing_map`` has what was observed in this run.

    With ``corrects`` loops are closed, and the belief is corrected by it, for stacks whose only map
    it is. Otherwise the localiser says where the robot is in the map that was given. Where that
    jumps away from a start that was known, nothing is placed until it comes back; from one that was
    not, the map begins anew.
    """

    def __init__(self, robot: RobotModel, corrects: bool) -> None:
        self._corrects = corrects
        self.growing_map = GrowingMap(robot, close_loops=corrects)
        self.reset(None)

    def reset(self, pose: Pose | None) -> None:
        """Begin an empty map in whose frame the robot is at ``pose``, by default the origin."""
        self.growing_map.reset(pose)
        self._start_known = pose is not None
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
        elif not belief.lost and belief.sigma <= _SURE and self._follows(belief.pose, odometry):
            self.growing_map.update(odometry, local_map, moving, placed=belief.pose)

    def _follows(self, pose: Pose, odometry: Odometry) -> bool:
        """Return whether ``pose`` follows from the last one; see the class."""
        growing = self.growing_map
        expected = growing.correction.compose(odometry.pose)
        jumps = growing.begun and math.dist((expected.x, expected.y), (pose.x, pose.y)) > _JUMP
        if jumps and not self._start_known:
            growing.reset(pose)
        return not (jumps and self._start_known)

    def hand_over(self, planner: GuardedPlanner, time: float) -> None:
        """Give ``planner`` the grid of the frame before at ``time`` [s], if one is due."""
        due = self.growing_map.begun and time - self._handed_over >= _INTERVAL - 1e-6
        if due and planner.wants_grid:
            self._handed_over = time
            planner.observe_grid(self.growing_map.grid)
