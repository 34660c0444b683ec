"""Progress: how long the wheels have not followed, and no progress has been made."""

from __future__ import annotations

import math

from navfw.localmap import LocalGoal
from navfw.signals import Command, Odometry, Waypoint

MOVING = 0.08
"""Commanded speed [m/s] from which the wheels are expected to follow."""
_FOLLOWING = 0.15
"""Share of the commanded speed below which the wheels do not follow."""
STEP = 0.1
"""Decrease of the cost-to-go [m] that counts as progress."""


class ProgressMonitor:
    """Follows wheel speeds against commands, and the cost-to-go toward each waypoint."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Back to the start of a run."""
        self._stalled_since: float | None = None
        self._goal: tuple[float, float] | None = None
        self._best = math.inf
        self._progress_time = 0.0

    def update(
        self,
        odometry: Odometry,
        previous: Command | None,
        waypoint: Waypoint | None,
        local_goal: LocalGoal | None,
    ) -> tuple[float, float]:
        """(stalled, idle) [s]: since when wheels do not follow, and no progress was made."""
        time = odometry.time
        wanted = 0.0 if previous is None else previous.twist.v
        if abs(wanted) > MOVING and abs(odometry.twist.v) < _FOLLOWING * abs(wanted):
            self._stalled_since = time if self._stalled_since is None else self._stalled_since
        else:
            self._stalled_since = None
        stalled = 0.0 if self._stalled_since is None else time - self._stalled_since

        goal = None if waypoint is None else (waypoint.x, waypoint.y)
        cost = math.inf if local_goal is None else local_goal.cost
        if goal != self._goal or goal is None:
            self._goal, self._best, self._progress_time = goal, cost, time
        elif cost < self._best - STEP:
            self._best, self._progress_time = cost, time
        return stalled, time - self._progress_time
