"""Giving up: without progress, without a route, and at a goal by an uncertain estimate."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.signals import Belief, Pose, Waypoint
from navfw.stack import NO_ROUTE_AFTER, STUCK_AFTER, ProgressWatch

GOAL = Waypoint(2.0, 1.0, 0.15, "lab", "goal", final=True)
PASSING = Waypoint(2.0, 1.0, 0.15, "hall", "room", final=False)


def belief(x: float, y: float) -> Belief:
    return Belief(0.0, Pose(x, y, 0.0), np.diag([0.49, 0.04, 0.01]), {}, 0.5)


def watched(
    place: tuple[float, float], waypoint: Waypoint | None, idle: float, no_route: str | None = None
) -> ProgressWatch:
    watch = ProgressWatch()
    for now in (0.0, NO_ROUTE_AFTER):
        watch.update(now, belief(*place), waypoint, idle, no_route)
    return watch


@pytest.mark.parametrize(
    ("place", "waypoint", "unsure"),
    [
        ((2.1, 1.05), GOAL, True),
        ((2.1, 1.05), PASSING, False),
        ((2.3, 1.0), GOAL, False),
        ((2.0, 1.0), None, False),
    ],
)
def test_a_goal_that_is_near_but_not_reached_leaves_the_robot_unsure(
    place: tuple[float, float], waypoint: Waypoint | None, unsure: bool
) -> None:
    watch = watched(place, waypoint, idle=0.0)
    assert watch.unsure is unsure
    assert watch.give_up_reason is None


def test_it_stays_unsure_while_it_looks_around_and_not_at_the_next_goal() -> None:
    watch = watched((2.0, 1.0), GOAL, idle=0.0)
    watch.update(30.0, belief(4.0, 1.0), GOAL, 30.0, None)
    assert watch.unsure
    watch.update(
        31.0, belief(4.0, 1.0), Waypoint(9.0, 9.0, 0.15, "", "goal", final=True), 0.0, None
    )
    assert not watch.unsure


def test_it_gives_up_and_says_why() -> None:
    late = STUCK_AFTER + 1.0
    assert watched((0.0, 0.0), GOAL, late).give_up_reason == "no progress toward lab for 61 s"
    doubt = watched((2.0, 1.0), GOAL, late).give_up_reason
    assert doubt == "perhaps at lab: the position estimate has a sigma of 0.70 m"
    assert watched((0.0, 0.0), GOAL, 0.0, "the door is closed").give_up_reason == (
        "the door is closed"
    )
    assert watched((0.0, 0.0), None, late, "the door is closed").give_up_reason is None
