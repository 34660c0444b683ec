"""What the runner watches, in truth: which goals were visited, and whether all stands still."""

from __future__ import annotations

import math
from collections.abc import Sequence

from navfw.signals import Pose, Waypoint

__all__ = ["GoalChecker", "ProgressChecker", "goal_name"]


class GoalChecker:
    """Which goals the robot has truly visited, in order."""

    def __init__(self, goals: Sequence[Waypoint], radius: float) -> None:
        self.goals = goals
        self.radius = radius
        self.next = 0
        self.nearest = math.inf

    @property
    def goal(self) -> Waypoint:
        """The first goal that has not been visited, or the last one."""
        return self.goals[min(self.next, len(self.goals) - 1)]

    @property
    def next_name(self) -> str:
        """What ``goal`` is called."""
        return goal_name(self.goal)

    def distance(self, pose: Pose) -> float:
        """How far [m] ``goal`` is."""
        goal = self.goal
        return math.hypot(goal.x - pose.x, goal.y - pose.y)

    def see(self, pose: Pose) -> None:
        """The robot truly is at ``pose`` now."""
        distance = self.distance(pose)
        self.nearest = min(self.nearest, distance)
        if self.next < len(self.goals) and distance <= self.radius:
            self.next += 1
            self.nearest = math.inf

    def missed(self, pose: Pose) -> str | None:
        """What is missing for success when the stack has finished at the true ``pose``."""
        last = self.goals[-1]
        if self.next < len(self.goals) - 1:
            came = f"came no nearer to {self.next_name} than {self.nearest:.2f} m"
            return f"the stack believes it has visited all goals, but {came}"
        off = math.hypot(last.x - pose.x, last.y - pose.y)
        if off <= self.radius:
            return None
        return f"the stack believes it is at {goal_name(last)}, but is {off:.2f} m away from it"


class ProgressChecker:
    """Notices when a robot stays in one place, turning or twitching perhaps."""

    def __init__(self, limit: float, radius: float) -> None:
        self.limit = limit
        self.radius = radius
        self.since = 0.0
        self.anchor: Pose | None = None

    def see(self, now: float, pose: Pose) -> bool:
        """Whether the robot, at ``pose`` now, has been within the radius [m] for the limit [s]."""
        anchor = self.anchor
        if anchor is None or math.hypot(pose.x - anchor.x, pose.y - anchor.y) > self.radius:
            self.anchor, self.since = pose, now
        return now - self.since >= self.limit


def goal_name(goal: Waypoint) -> str:
    """A place by its name, or by where it is."""
    return repr(goal.place) if goal.place else f"({goal.x:g}, {goal.y:g})"
