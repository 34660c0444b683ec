"""Each cause of failure from the symptoms that show it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from navfw.missions import FaultKind, Outcome
from navfw.signals import Sight
from navfw.suite import (
    Cause,
    CollisionSymptoms,
    FailureSymptoms,
    MotionSymptoms,
    PathSymptoms,
    classify,
)


def collision(**values: Any) -> CollisionSymptoms:
    usual: dict[str, Any] = {"by_mover": False, "bearing": 0.1, "speed": 0.3, "mapped": "unknown"}
    return CollisionSymptoms(**{**usual, **values})


@pytest.mark.parametrize(
    ("symptoms", "cause"),
    [
        (collision(), Cause.UNSEEN),
        (collision(mapped="free"), Cause.MAPPED_AS_FREE),
        (collision(mapped="occupied"), Cause.DROVE_INTO),
        (collision(mapped="occupied", bearing=-1.4), Cause.TURNED_INTO),
        (collision(mapped="occupied", bearing=3.0, speed=-0.1), Cause.REVERSED_INTO),
        (collision(mapped="unknown", bearing=0.2, speed=-0.1), Cause.UNSEEN),
        (collision(mapped=""), Cause.OBSTACLE),
        (collision(by_mover=True, mapped="occupied"), Cause.MOVER),
    ],
)
def test_collisions(symptoms: CollisionSymptoms, cause: Cause) -> None:
    assert classify(FailureSymptoms(Outcome.COLLIDED, collision=symptoms)) is cause


def test_lost_is_an_estimate_error_or_a_missed_goal() -> None:
    off = FailureSymptoms(Outcome.LOST, estimate_error_max=0.4, slack=0.1)
    assert classify(off) is Cause.ESTIMATE_ERROR
    known = FailureSymptoms(Outcome.LOST, estimate_error_max=0.02, slack=0.1)
    assert classify(known) is Cause.GOAL_MISSED


DRIVES = MotionSymptoms(driven=20.0, gained=18.0, recent=30.0, recent_driven=9.0, recent_turned=2.0)
CIRCLES = MotionSymptoms(
    driven=20.0, gained=4.0, recent=30.0, recent_driven=9.0, recent_turned=30.0
)
TURNS = MotionSymptoms(driven=6.0, gained=5.0, recent=30.0, recent_driven=0.1, recent_turned=40.0)
STANDS = MotionSymptoms(driven=6.0, gained=5.0, recent=30.0, recent_driven=0.1, recent_turned=0.3)
PATH = PathSymptoms(cost=5.0, without_phantoms=4.5, sharpened=4.0)


@pytest.mark.parametrize("outcome", [Outcome.STUCK, Outcome.TIMEOUT])
@pytest.mark.parametrize(
    ("symptoms", "cause"),
    [
        ({"estimate_error": 0.8, "motion": STANDS}, Cause.ESTIMATE_ERROR),
        ({"path": PathSymptoms(math.inf, 4.0, 4.0), "motion": STANDS}, Cause.PHANTOM_OBSTACLES),
        ({"path": PathSymptoms(9.0, 4.0, 4.0), "motion": CIRCLES}, Cause.PHANTOM_OBSTACLES),
        ({"path": PathSymptoms(math.inf, math.inf, 5.0), "motion": STANDS}, Cause.BLURRED_MAP),
        ({"path": PathSymptoms(9.0, 8.0, 5.0), "motion": CIRCLES}, Cause.BLURRED_MAP),
        ({"path": PathSymptoms(math.inf, math.inf, math.inf)}, Cause.LOCAL_GOAL_UNREACHABLE),
        ({"path": PATH, "motion": STANDS}, Cause.STANDSTILL),
        ({"path": PATH, "motion": CIRCLES}, Cause.OSCILLATING),
        ({"path": PATH, "motion": TURNS}, Cause.OSCILLATING),
        ({"motion": STANDS}, Cause.STANDSTILL),
        ({}, Cause.UNKNOWN),
    ],
)
def test_stuck_and_timeout(outcome: Outcome, symptoms: dict[str, Any], cause: Cause) -> None:
    assert classify(FailureSymptoms(outcome, **symptoms)) is cause


@pytest.mark.parametrize("outcome", [Outcome.STUCK, Outcome.TIMEOUT])
@pytest.mark.parametrize(
    ("symptoms", "nothing", "little"),
    [
        ({"path": PATH, "motion": TURNS}, Cause.NOTHING_SEEN, Cause.LITTLE_SEEN),
        ({"path": PATH, "motion": STANDS}, Cause.NOTHING_SEEN, Cause.LITTLE_SEEN),
        (
            {"path": PathSymptoms(math.inf, 4.0, 4.0), "motion": TURNS},
            Cause.NOTHING_SEEN,
            Cause.PHANTOM_OBSTACLES,
        ),
        ({"estimate_error": 0.8, "motion": TURNS}, Cause.ESTIMATE_ERROR, Cause.ESTIMATE_ERROR),
    ],
)
def test_a_robot_that_sees_too_little_to_go_on(
    outcome: Outcome, symptoms: dict[str, Any], nothing: Cause, little: Cause
) -> None:
    assert classify(FailureSymptoms(outcome, sight=Sight.NOTHING, **symptoms)) is nothing
    assert classify(FailureSymptoms(outcome, sight=Sight.LITTLE, **symptoms)) is little


def test_a_timeout_of_an_approaching_robot_that_sees_little_is_slow() -> None:
    symptoms = FailureSymptoms(Outcome.TIMEOUT, motion=DRIVES, sight=Sight.LITTLE)
    assert classify(symptoms) is Cause.SLOW


def test_slow_is_a_cause_of_timeouts_only() -> None:
    assert classify(FailureSymptoms(Outcome.TIMEOUT, motion=DRIVES)) is Cause.SLOW
    assert classify(FailureSymptoms(Outcome.STUCK, motion=DRIVES)) is Cause.OSCILLATING


@pytest.mark.parametrize("kind", list(FaultKind))
def test_every_kind_of_fault_is_a_cause_of_that_name(kind: FaultKind) -> None:
    cause = classify(FailureSymptoms(Outcome.FAULT, fault=kind))
    assert cause is not None
    assert cause.value == kind.value


def test_a_fault_of_no_kind_is_of_unknown_cause() -> None:
    assert classify(FailureSymptoms(Outcome.FAULT)) is Cause.UNKNOWN


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_failure_has_a_cause_and_nothing_else_has(outcome: Outcome) -> None:
    failed = outcome not in {Outcome.REACHED, Outcome.CANCELLED}
    assert (classify(FailureSymptoms(outcome)) is not None) == failed
