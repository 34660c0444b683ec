"""Checks of a run against the true pose: goals visited, and progress made."""

from __future__ import annotations

import math
from collections.abc import Sequence

from navfw.signals import Pose, Waypoint


class GoalChecker:
    """Counts the goals that the robot has truly visited, in order, within ``radius`` [m]."""

    def __init__(self, goals: Sequence[Waypoint], radius: float) -> None:
        self.goals = goals
        self.radius = radius
        self.next = 0
        self.nearest = math.inf

    @property
    def goal(self) -> Waypoint:
        """The first goal not visited yet, or the last one."""
        return self.goals[min(self.next, len(self.goals) - 1)]

    @property
    def next_name(self) -> str:
        """The name of ``goal``."""
        return goal_name(self.goal)

    def distance(self, pose: Pose) -> float:
        """Distance [m] from ``pose`` to ``goal``."""
        goal = self.goal
        return math.hypot(goal.x - pose.x, goal.y - pose.y)

    def update(self, pose: Pose) -> None:
        """Count ``goal`` as visited if the true ``pose`` is within the radius."""
        distance = self.distance(pose)
        self.nearest = min(self.nearest, distance)
        if self.next < len(self.goals) and distance <= self.radius:
            self.next += 1
            self.nearest = math.inf

    def missed(self, pose: Pose) -> str | None:
        """Why the mission is not accomplished, for a stack that finished at the true ``pose``.

        None if it is accomplished.
        """
        last = self.goals[-1]
        if self.next < len(self.goals) - 1:
            nearest = f"{self.nearest:.2f} m from {self.next_name} at the nearest"
            return f"the stack reports all goals visited, but it was {nearest}"
        off = math.hypot(last.x - pose.x, last.y - pose.y)
        if off <= self.radius:
            return None
        return f"the stack reports reaching {goal_name(last)}, but is {off:.2f} m away from it"


class ProgressChecker:
    """Detects that the robot stays within ``radius`` [m] of one position for ``limit`` [s]."""

    def __init__(self, limit: float, radius: float) -> None:
        self.limit = limit
        self.radius = radius
        self.since = 0.0
        self.anchor: Pose | None = None

    def update(self, now: float, pose: Pose) -> bool:
        """Take in the true ``pose`` at ``now`` [s]; whether the limit is reached."""
        anchor = self.anchor
        if anchor is None or math.hypot(pose.x - anchor.x, pose.y - anchor.y) > self.radius:
            self.anchor, self.since = pose, now
        return now - self.since >= self.limit


def goal_name(goal: Waypoint) -> str:
    """The quoted name of a goal that is a place; else its coordinates."""
    return repr(goal.place) if goal.place else f"({goal.x:g}, {goal.y:g})"
