"""Why a run failed, in a word: the classification alone, from numbers gathered elsewhere.

``navfw.suite.failure_symptoms`` gathers the numbers from a run's log, the true geometry and the
stack's own local map. Where they show nothing, the cause is ``unknown``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from navfw.missions.outcome import Outcome

__all__ = [
    "Cause",
    "CollisionSymptoms",
    "FailureSymptoms",
    "MotionSymptoms",
    "PathSymptoms",
    "classify",
]

CREEP = 0.05
"""Speed [m/s] below which a robot counts as standing."""

PACE, TURNING = 0.02, 0.1
"""Mean speeds [m/s], [rad/s] below which a robot has neither driven nor turned to speak of."""

DETOUR = 1.5
"""A remembered way this much dearer than without errors of the memory is so because of them."""


class Cause(StrEnum):
    """Why a run failed."""

    MOVER = "mover"
    """collided: something that moves came into a robot that stood or gave way"""
    REVERSED_INTO = "reversed_into"
    """collided: driving backwards, with a thing behind it"""
    TURNED_INTO = "turned_into"
    """collided: with a thing it remembered, beside the field of view"""
    DROVE_INTO = "drove_into"
    """collided: with a thing it remembered, in front"""
    TAKEN_FOR_FREE = "taken_for_free"
    """collided: where the thing stands, the memory says free"""
    UNSEEN = "unseen_obstacle"
    """collided: where the thing stands, the memory knows nothing"""
    OBSTACLE = "obstacle"
    """collided: with a thing; the stack has no memory to ask"""
    GHOSTS = "ghosts"
    """stuck, timeout: remembered things that are not there bar or lengthen the way"""
    BLURRED = "blurred_memory"
    """stuck, timeout: things remembered thicker than they are bar or lengthen the way"""
    AIM_UNREACHABLE = "aim_unreachable"
    """stuck, timeout: all that is remembered bars the way, and it is there"""
    ESTIMATE_ERROR = "estimate_error"
    """lost, stuck, timeout: it is not where it believes to be"""
    GOAL_MISSED = "goal_missed"
    """lost: it knew where it was, but did not come near enough to a goal"""
    OSCILLATING = "oscillating"
    """stuck, timeout: it drives or turns, and gains no ground"""
    STANDING = "standing"
    """stuck, timeout: it stands, although it has a way"""
    SLOW = "slow"
    """timeout: it was on its way"""
    EXCEPTION = "exception"
    """fault: an exception"""
    SENSOR_FAILED = "sensor_failed"
    """fault: the stack gave up, since a sensor had failed for good"""
    BAD_COMMAND = "bad_command"
    """fault: the stack commanded no number"""
    BAD_INPUT = "bad_input"
    """fault: world, mission or stack was refused"""
    PROCESS_DIED = "process_died"
    """fault: the process of the run ended without a word"""
    TOO_LONG = "too_long"
    """fault: the run took more time on the clock on the wall than it was given"""
    UNKNOWN = "unknown"
    """nothing recorded tells"""


@dataclass(frozen=True, slots=True)
class CollisionSymptoms:
    """How the robot met the thing it touched.

    ``by_mover``: something that moves came into a robot that was not driving towards it.
    ``bearing`` [rad, left positive] is of the nearest point of the thing, ``speed`` [m/s] the
    robot's forward speed, negative backwards. ``memory`` is what the stack remembered at that
    point, "" when it has no memory.
    """

    by_mover: bool
    bearing: float
    speed: float
    memory: Literal["occupied", "free", "unknown", ""] = ""


@dataclass(frozen=True, slots=True)
class PathSymptoms:
    """What the stack's remembered way to its waypoint costs at the end; infinite: there is none.

    ``without_ghosts`` is the same with everything forgotten that is far from all there is, and
    ``sharp`` with what is remembered beside the outlines of things forgotten too.
    """

    cost: float
    without_ghosts: float
    sharp: float


@dataclass(frozen=True, slots=True)
class MotionSymptoms:
    """How it drove: ``driven`` [m] and the ground ``gained`` [m] on the shortest way.

    ``recent_driven`` [m] and ``recent_turned`` [rad] are of the last ``recent`` [s].
    """

    driven: float
    gained: float
    recent: float
    recent_driven: float
    recent_turned: float


@dataclass(frozen=True, slots=True)
class FailureSymptoms:
    """What a failed run's record shows. ``slack`` [m] is how far the estimate may be off."""

    outcome: Outcome
    estimate_error: float = 0.0
    estimate_error_max: float = 0.0
    slack: float = 0.1
    touch: CollisionSymptoms | None = None
    aiming: PathSymptoms | None = None
    driving: MotionSymptoms | None = None
    exception: bool = False
    sensor_failed: bool = False


def classify(evidence: FailureSymptoms) -> Cause | None:
    """The cause of a failure; None when the run did not fail, or a person stopped it."""
    match evidence.outcome:
        case Outcome.COLLIDED:
            return _of_collision(evidence.touch)
        case Outcome.LOST:
            off = evidence.estimate_error_max >= 0.9 * evidence.slack
            return Cause.ESTIMATE_ERROR if off else Cause.GOAL_MISSED
        case Outcome.STUCK | Outcome.TIMEOUT:
            return _of_delay(evidence)
        case Outcome.FAULT:
            gave_up = Cause.SENSOR_FAILED if evidence.sensor_failed else Cause.BAD_COMMAND
            return Cause.EXCEPTION if evidence.exception else gave_up
        case _:
            return None


def _of_collision(touch: CollisionSymptoms | None) -> Cause:
    if touch is None:
        return Cause.UNKNOWN
    if touch.by_mover:
        return Cause.MOVER
    aside = abs(touch.bearing)
    if touch.speed < -CREEP and aside > 0.5 * math.pi:
        return Cause.REVERSED_INTO
    if touch.memory == "occupied" and aside > 0.25 * math.pi:
        return Cause.TURNED_INTO
    return _BY_MEMORY[touch.memory]


_BY_MEMORY = {
    "occupied": Cause.DROVE_INTO,
    "free": Cause.TAKEN_FOR_FREE,
    "unknown": Cause.UNSEEN,
    "": Cause.OBSTACLE,
}


def _of_delay(evidence: FailureSymptoms) -> Cause:
    """Of a robot that is stuck or out of time: what it believes first, then how it drove."""
    if evidence.estimate_error > max(0.5, evidence.slack):
        return Cause.ESTIMATE_ERROR
    return _of_aiming(evidence.aiming) or _of_driving(evidence)


def _of_aiming(aiming: PathSymptoms | None) -> Cause | None:
    if aiming is None:
        return None
    if aiming.cost > DETOUR * aiming.without_ghosts:
        return Cause.GHOSTS
    if aiming.cost > DETOUR * aiming.sharp:
        return Cause.BLURRED
    return Cause.AIM_UNREACHABLE if math.isinf(aiming.cost) else None


def _of_driving(evidence: FailureSymptoms) -> Cause:
    driving = evidence.driving
    if driving is None:
        return Cause.UNKNOWN
    moved = driving.recent_driven >= PACE * driving.recent
    if not moved and driving.recent_turned < TURNING * driving.recent:
        return Cause.STANDING
    on_its_way = moved and driving.gained > 0.5 * driving.driven
    late = evidence.outcome is Outcome.TIMEOUT
    return Cause.SLOW if late and on_its_way else Cause.OSCILLATING
