"""Every cause of failure from the numbers that show it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from navfw.missions.outcome import Outcome
from navfw.suite.failure_causes import (
    Cause,
    CollisionSymptoms,
    FailureSymptoms,
    MotionSymptoms,
    PathSymptoms,
    classify,
)


def touch(**values: Any) -> CollisionSymptoms:
    usual: dict[str, Any] = {"by_mover": False, "bearing": 0.1, "speed": 0.3, "memory": "unknown"}
    return CollisionSymptoms(**{**usual, **values})


@pytest.mark.parametrize(
    ("met", "cause"),
    [
        (touch(), Cause.UNSEEN),
        (touch(memory="free"), Cause.TAKEN_FOR_FREE),
        (touch(memory="occupied"), Cause.DROVE_INTO),
        (touch(memory="occupied", bearing=-1.4), Cause.TURNED_INTO),
        (touch(memory="occupied", bearing=3.0, speed=-0.1), Cause.REVERSED_INTO),
        (touch(memory="unknown", bearing=0.2, speed=-0.1), Cause.UNSEEN),
        (touch(memory=""), Cause.OBSTACLE),
        (touch(by_mover=True, memory="occupied"), Cause.MOVER),
    ],
)
def test_collisions(met: CollisionSymptoms, cause: Cause) -> None:
    assert classify(FailureSymptoms(Outcome.COLLIDED, touch=met)) is cause


def test_lost_is_an_error_of_the_estimate_or_a_goal_not_come_near_to() -> None:
    off = FailureSymptoms(Outcome.LOST, estimate_error_max=0.4, slack=0.1)
    assert classify(off) is Cause.ESTIMATE_ERROR
    knew = FailureSymptoms(Outcome.LOST, estimate_error_max=0.02, slack=0.1)
    assert classify(knew) is Cause.GOAL_MISSED


DRIVES = MotionSymptoms(driven=20.0, gained=18.0, recent=30.0, recent_driven=9.0, recent_turned=2.0)
CIRCLES = MotionSymptoms(
    driven=20.0, gained=4.0, recent=30.0, recent_driven=9.0, recent_turned=30.0
)
TURNS = MotionSymptoms(driven=6.0, gained=5.0, recent=30.0, recent_driven=0.1, recent_turned=40.0)
STANDS = MotionSymptoms(driven=6.0, gained=5.0, recent=30.0, recent_driven=0.1, recent_turned=0.3)
WAY = PathSymptoms(cost=5.0, without_ghosts=4.5, sharp=4.0)


@pytest.mark.parametrize("outcome", [Outcome.STUCK, Outcome.TIMEOUT])
@pytest.mark.parametrize(
    ("shown", "cause"),
    [
        ({"estimate_error": 0.8, "driving": STANDS}, Cause.ESTIMATE_ERROR),
        ({"aiming": PathSymptoms(math.inf, 4.0, 4.0), "driving": STANDS}, Cause.GHOSTS),
        ({"aiming": PathSymptoms(9.0, 4.0, 4.0), "driving": CIRCLES}, Cause.GHOSTS),
        ({"aiming": PathSymptoms(math.inf, math.inf, 5.0), "driving": STANDS}, Cause.BLURRED),
        ({"aiming": PathSymptoms(9.0, 8.0, 5.0), "driving": CIRCLES}, Cause.BLURRED),
        ({"aiming": PathSymptoms(math.inf, math.inf, math.inf)}, Cause.AIM_UNREACHABLE),
        ({"aiming": WAY, "driving": STANDS}, Cause.STANDING),
        ({"aiming": WAY, "driving": CIRCLES}, Cause.OSCILLATING),
        ({"aiming": WAY, "driving": TURNS}, Cause.OSCILLATING),
        ({"driving": STANDS}, Cause.STANDING),
        ({}, Cause.UNKNOWN),
    ],
)
def test_stuck_and_late(outcome: Outcome, shown: dict[str, Any], cause: Cause) -> None:
    assert classify(FailureSymptoms(outcome, **shown)) is cause


def test_only_who_is_late_was_slow() -> None:
    assert classify(FailureSymptoms(Outcome.TIMEOUT, driving=DRIVES)) is Cause.SLOW
    assert classify(FailureSymptoms(Outcome.STUCK, driving=DRIVES)) is Cause.OSCILLATING


def test_faults() -> None:
    assert classify(FailureSymptoms(Outcome.FAULT, exception=True)) is Cause.EXCEPTION
    assert classify(FailureSymptoms(Outcome.FAULT)) is Cause.BAD_COMMAND


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_failure_has_a_cause_and_nothing_else_has(outcome: Outcome) -> None:
    failed = outcome not in {Outcome.REACHED, Outcome.CANCELLED}
    assert (classify(FailureSymptoms(outcome)) is not None) == failed
