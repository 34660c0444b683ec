"""The outcome of a mission, its reason and cause; progress and goals visited by the true pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from navfw.signals import Pose, Waypoint


class Outcome(StrEnum):
    """How a mission ended."""

    REACHED = "reached"
    """the stack has finished, and the robot truly stands in the success zone"""
    COLLIDED = "collided"
    """the robot touched something other than the floor, or fell into a drop"""
    TIMEOUT = "timeout"
    """the mission's time limit was reached"""
    STUCK = "stuck"
    """the robot made no progress for too long, or the stack reported that it cannot go on"""
    LOST = "lost"
    """the stack has finished, but a goal was not reached; or the time limit was reached and the
    stack's belief is lost"""
    UNSURE = "unsure"
    """the robot is at its goal, but its position estimate stays too uncertain to finish"""
    FAULT = "fault"
    """the stack or the simulator failed"""
    CANCELLED = "cancelled"
    """stopped by the user"""

    @property
    def succeeded(self) -> bool:
        """Whether the mission was accomplished."""
        return self is Outcome.REACHED


class Cause(StrEnum):
    """The cause of a failure, with its ``sentence``; comments of members begin with outcomes."""

    sentence: str

    def __new__(cls, name: str, sentence: str = "") -> Self:
        """Make the member ``name``."""
        cause = str.__new__(cls, name)
        cause._value_, cause.sentence = name, sentence
        return cause

    MOVER = "mover", "{body} came into the robot"
    """collided: a mover ran into a robot that was not driving towards it"""
    REVERSED_INTO = "reversed_into", "the robot backed into {body}"
    """collided: driving backwards, with the object behind it"""
    TURNED_INTO = "turned_into", "the robot turned into {body}, which it had seen"
    """collided: with an object in the local map, beside the field of view"""
    DROVE_INTO = "drove_into", "the robot drove into {body}, which it had seen"
    """collided: with an object in the local map, ahead"""
    MAPPED_AS_FREE = "mapped_as_free", "{body} was taken for free floor"
    """collided: the local map had free floor where the object is"""
    UNSEEN = "unseen_obstacle", "{body} was never seen"
    """collided: the local map had unknown cells where the object is"""
    OBSTACLE = "obstacle", "the robot touched {body}"
    """collided: with an object; there is no local map to compare with"""
    PHANTOM_OBSTACLES = "phantom_obstacles", "the robot saw obstacles where there are none"
    """stuck, timeout: occupied cells far from any object block or lengthen the path"""
    BLURRED_MAP = "blurred_map", "the robot saw things wider than they are"
    """stuck, timeout: occupied cells beside the outlines of objects block or lengthen the path"""
    LOCAL_GOAL_UNREACHABLE = "local_goal_unreachable", "things close every way to {waypoint}"
    """stuck, timeout: correctly mapped objects block every path to the local goal"""
    ESTIMATE_UNCERTAIN = "estimate_uncertain"
    """the position estimate at the goal was too uncertain to say that it is reached"""
    ESTIMATE_ERROR = "estimate_error", "the robot was not where it believed to be"
    """lost, stuck, timeout: the position estimate is wrong"""
    GOAL_MISSED = "goal_missed"
    """lost: the position estimate is right, but a goal was not approached closely enough"""
    NOTHING_SEEN = "nothing_seen", "nothing of the way ahead was seen"
    """fault, stuck, timeout: next to nothing could be seen of the path ahead"""
    LITTLE_SEEN = "little_seen", "too little of the floor ahead was seen to drive on it"
    """stuck, timeout: the robot was not approaching the goal, and little could be seen of the path
    ahead, so that it drives only over floor observed as such"""
    OSCILLATING = "oscillating", "the robot went to and fro before {waypoint}"
    """stuck, timeout: the robot drives or turns without approaching the goal"""
    VETOED = "vetoed", "the robot was held back before {waypoint}"
    """stuck, timeout: the safety monitor held the robot, although the local map has a path"""
    STANDSTILL = "standstill", "the robot stood before {waypoint} although there was a way"
    """stuck, timeout: the robot stands still, although the local map has a path"""
    SLOW = "slow", "the robot was still on its way to {waypoint}"
    """timeout: the robot was approaching the goal"""
    EXCEPTION = "exception"
    """fault: an exception"""
    SENSOR_FAILED = "sensor_failed"
    """fault: the stack stopped, because a sensor had failed for good"""
    PLUGIN_FAILED = "plugin_failed"
    """fault: a plugin failed at the start of the run, or a stage failed for too long"""
    BAD_COMMAND = "bad_command"
    """fault: the stack commanded a value that is not finite"""
    BAD_INPUT = "bad_input"
    """fault: world, mission or stack was refused"""
    PROCESS_DIED = "process_died"
    """fault: the process of the run ended without a result"""
    TOO_LONG = "too_long"
    """fault: the run exceeded its wall-clock limit"""
    TOO_MUCH_MEMORY = "too_much_memory"
    """fault: the run exceeded its limit of memory, or the machine had none left"""
    UNKNOWN = "unknown"
    """the symptoms do not show the cause"""


@dataclass(frozen=True, slots=True)
class MissionVerdict:
    """The outcome with its ``reason``, the last leading behaviour, control tick and time [s].

    ``fault`` is the cause if the outcome is a fault, else None. ``trace`` is the Python traceback
    of an exception, else empty.
    """

    outcome: Outcome
    reason: str
    behavior: str
    tick: int
    time: float
    fault: Cause | None = None
    trace: str = ""

    def __str__(self) -> str:
        led = f" (leading behaviour: {self.behavior})" if self.behavior else ""
        return f"{self.outcome} after {self.time:.1f} s: {self.reason}{led}"


class GoalChecker:
    """Counts the goals that the robot has truly visited, in order: came within ``radius`` [m]."""

    def __init__(self, goals: Sequence[Waypoint], radius: float) -> None:
        self.goals = goals
        self.radius = radius
        self.next = 0
        self.nearest = math.inf

    @property
    def goal(self) -> Waypoint:
        """The first goal that was not visited yet, or the last one if all were."""
        return self.goals[min(self.next, len(self.goals) - 1)]

    def distance(self, pose: Pose) -> float:
        """Return the distance [m] from ``pose`` (``map``) to the current ``goal``."""
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
        """Why a stack that finished at the true ``pose`` has failed the mission; None if not."""
        last = self.goals[-1]
        if self.next < len(self.goals) - 1:
            nearest = f"{self.nearest:.2f} m from {goal_name(self.goal)} at the nearest"
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
        """Observe the true ``pose`` at ``now`` [s]; return whether the limit is reached."""
        anchor = self.anchor
        if anchor is None or math.hypot(pose.x - anchor.x, pose.y - anchor.y) > self.radius:
            self.anchor, self.since = pose, now
        return now - self.since >= self.limit


def goal_name(goal: Waypoint) -> str:
    """Return the quoted name of a goal that is a place, else its coordinates."""
    return repr(goal.place) if goal.place else f"({goal.x:g}, {goal.y:g})"
