"""Causes of failed runs, classified from the symptoms of a run.

``navfw.suite.failure_symptoms`` computes the symptoms from a run's log, the true geometry and the
stack's own local map. Where they show nothing, the cause is ``unknown``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from navfw.missions.outcome import FaultKind, Outcome
from navfw.signals import Sight

_REVERSING = 0.05
"""Backward speed [m/s] above which a robot counts as reversing at a collision."""

_MEAN_SPEED, _MEAN_RATE = 0.02, 0.1
"""Mean speed [m/s] and turning rate [rad/s] below which a robot counts as standing still."""

_DETOUR = 1.5
"""Ratio of path costs, with and without errors of the local map, above which they are the cause."""


class Cause(StrEnum):
    """Why a run failed."""

    MOVER = "mover"
    """collided: a mover ran into a robot that was not driving towards it"""
    REVERSED_INTO = "reversed_into"
    """collided: driving backwards, with the object behind it"""
    TURNED_INTO = "turned_into"
    """collided: with an object in the local map, beside the field of view"""
    DROVE_INTO = "drove_into"
    """collided: with an object in the local map, ahead"""
    MAPPED_AS_FREE = "mapped_as_free"
    """collided: the local map has the object's place as free"""
    UNSEEN = "unseen_obstacle"
    """collided: the local map has the object's place as unknown"""
    OBSTACLE = "obstacle"
    """collided: with an object; there is no local map to compare with"""
    PHANTOM_OBSTACLES = "phantom_obstacles"
    """stuck, timeout: occupied cells far from any object block or lengthen the path"""
    BLURRED_MAP = "blurred_map"
    """stuck, timeout: occupied cells beside the outlines of objects block or lengthen the path"""
    LOCAL_GOAL_UNREACHABLE = "local_goal_unreachable"
    """stuck, timeout: correctly mapped objects block every path to the local goal"""
    ESTIMATE_UNCERTAIN = "estimate_uncertain"
    """the position estimate at the goal was too uncertain to say that it is reached"""
    ESTIMATE_ERROR = "estimate_error"
    """lost, stuck, timeout: the position estimate is wrong"""
    GOAL_MISSED = "goal_missed"
    """lost: the position estimate is right, but a goal was not approached closely enough"""
    NOTHING_SEEN = "nothing_seen"
    """fault, stuck, timeout: next to nothing could be seen of the path ahead"""
    LITTLE_SEEN = "little_seen"
    """stuck, timeout: the robot was not approaching the goal, and little could be seen of the path
    ahead, so that it drives only over floor observed as such"""
    OSCILLATING = "oscillating"
    """stuck, timeout: the robot drives or turns without approaching the goal"""
    VETOED = "vetoed"
    """stuck, timeout: the safety monitor held the robot, although the local map has a path"""
    STANDSTILL = "standstill"
    """stuck, timeout: the robot stands still, although the local map has a path"""
    SLOW = "slow"
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
class CollisionSymptoms:
    """Circumstances of a collision.

    ``by_mover``: a mover ran into a robot that was not driving towards it. ``bearing`` [rad, left
    positive] is that of the object's nearest point, ``speed`` [m/s] the robot's forward speed,
    negative backwards. ``mapped`` is the state of the local map at that point, "" without a map.
    """

    by_mover: bool
    bearing: float
    speed: float
    mapped: Literal["occupied", "free", "unknown", ""] = ""


@dataclass(frozen=True, slots=True)
class PathSymptoms:
    """Cost of the local path to the waypoint at the end of a run; infinite without a path.

    ``without_phantoms`` is the cost once occupied cells far from any object are cleared,
    ``sharpened`` the cost once those beside the outlines of objects are cleared too.
    """

    cost: float
    without_phantoms: float
    sharpened: float


@dataclass(frozen=True, slots=True)
class MotionSymptoms:
    """Distance ``driven`` [m], and decrease ``gained`` [m] of the shortest path to the last goal.

    ``recent_driven`` [m] and ``recent_turned`` [rad] are over the last ``recent`` [s], and
    ``vetoed`` the share of it in which the safety monitor held the robot.
    """

    driven: float
    gained: float
    recent: float
    recent_driven: float
    recent_turned: float
    vetoed: float = 0.0


@dataclass(frozen=True, slots=True)
class FailureSymptoms:
    """Symptoms of a failed run; estimate errors in metres.

    ``slack`` [m] is the largest position error with which the mission can still succeed. ``sight``
    of the path ahead is the median over the end of the run.
    """

    outcome: Outcome
    estimate_error: float = 0.0
    estimate_error_max: float = 0.0
    slack: float = 0.1
    collision: CollisionSymptoms | None = None
    path: PathSymptoms | None = None
    motion: MotionSymptoms | None = None
    sight: Sight = Sight.ENOUGH
    fault: FaultKind | None = None


def classify(symptoms: FailureSymptoms) -> Cause | None:
    """The cause of a failure; None for a run that succeeded or was stopped by the user."""
    match symptoms.outcome:
        case Outcome.COLLIDED:
            return _of_collision(symptoms.collision)
        case Outcome.LOST:
            off = symptoms.estimate_error_max >= 0.9 * symptoms.slack
            return Cause.ESTIMATE_ERROR if off else Cause.GOAL_MISSED
        case Outcome.STUCK | Outcome.TIMEOUT:
            return _of_delay(symptoms)
        case Outcome.UNSURE:
            return Cause.ESTIMATE_UNCERTAIN
        case Outcome.FAULT:
            return Cause.UNKNOWN if symptoms.fault is None else Cause(symptoms.fault)
        case _:
            return None


def _of_collision(collision: CollisionSymptoms | None) -> Cause:
    if collision is None:
        return Cause.UNKNOWN
    if collision.by_mover:
        return Cause.MOVER
    aside = abs(collision.bearing)
    if collision.speed < -_REVERSING and aside > 0.5 * math.pi:
        return Cause.REVERSED_INTO
    if collision.mapped == "occupied" and aside > 0.25 * math.pi:
        return Cause.TURNED_INTO
    return _BY_MAP[collision.mapped]


_BY_MAP = {
    "occupied": Cause.DROVE_INTO,
    "free": Cause.MAPPED_AS_FREE,
    "unknown": Cause.UNSEEN,
    "": Cause.OBSTACLE,
}


def _of_delay(symptoms: FailureSymptoms) -> Cause:
    """The cause of outcome stuck or timeout: from estimate and map first, then from the motion.

    A robot that sees nothing may not go on whatever its map has; one that sees little still can.
    """
    if symptoms.estimate_error > max(0.5, symptoms.slack):
        return Cause.ESTIMATE_ERROR
    if symptoms.sight is Sight.NOTHING:
        return Cause.NOTHING_SEEN
    return _of_path(symptoms.path) or _of_motion(symptoms)


def _of_path(path: PathSymptoms | None) -> Cause | None:
    if path is None:
        return None
    if path.cost > _DETOUR * path.without_phantoms:
        return Cause.PHANTOM_OBSTACLES
    if path.cost > _DETOUR * path.sharpened:
        return Cause.BLURRED_MAP
    return Cause.LOCAL_GOAL_UNREACHABLE if math.isinf(path.cost) else None


def _of_motion(symptoms: FailureSymptoms) -> Cause:
    motion = symptoms.motion
    if motion is None:
        return Cause.UNKNOWN
    moved = motion.recent_driven >= _MEAN_SPEED * motion.recent
    approaching = moved and motion.gained > 0.5 * motion.driven
    if symptoms.outcome is Outcome.TIMEOUT and approaching:
        return Cause.SLOW
    if motion.vetoed > 0.5:
        return Cause.VETOED
    if symptoms.sight is Sight.LITTLE:
        return Cause.LITTLE_SEEN
    turned = motion.recent_turned >= _MEAN_RATE * motion.recent
    return Cause.OSCILLATING if moved or turned else Cause.STANDSTILL
