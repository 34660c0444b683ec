"""The context's distance to doors, bearing and way to the waypoint; the sigma of a belief."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.signals import Belief, Pose, Twist, Waypoint
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene

OPEN = contexts_of(BehaviorScene("open", Twist(0.3, 0.0), ticks=8))[-1]


def test_only_a_door_that_is_the_waypoint_has_a_distance() -> None:
    there = {"x": OPEN.pose.x + 0.6, "y": 0.8, "tolerance": 0.3, "place": "there", "final": False}
    door = replace(OPEN, waypoint=Waypoint(**there, kind="door"))  # type: ignore[arg-type]
    assert door.door_distance == pytest.approx(1.0)
    room = replace(OPEN, waypoint=Waypoint(**there, kind="room"))  # type: ignore[arg-type]
    assert room.waypoint_distance == pytest.approx(1.0)
    assert room.door_distance == math.inf
    assert replace(OPEN, waypoint=None).door_distance == math.inf


def test_the_way_is_barred_if_the_local_goal_is_not_reachable() -> None:
    assert OPEN.local_goal is not None
    assert not replace(OPEN, local_goal=replace(OPEN.local_goal, reachable=True)).barred
    assert replace(OPEN, local_goal=replace(OPEN.local_goal, reachable=False)).barred
    assert not replace(OPEN, local_goal=None).barred


@given(st.floats(-math.pi, math.pi), st.floats(-3.1, 3.1))
def test_turns_are_the_shorter_way_round(heading: float, turn: float) -> None:
    context = replace(OPEN, pose=Pose(1.0, 2.0, heading))
    assert context.turn_to(heading + turn) == pytest.approx(turn)
    assert context.turn_to(heading + turn + 2.0 * math.pi) == pytest.approx(turn)


@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(-math.pi, math.pi))
def test_sigma_is_the_longer_axis_of_the_ellipse_however_it_lies(
    first: float, second: float, turn: float
) -> None:
    c, s = math.cos(turn), math.sin(turn)
    axes = np.array([[c, -s], [s, c]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = axes @ np.diag([first**2, second**2]) @ axes.T
    covariance[2, 2] = 100.0
    belief = Belief(0.0, Pose(0.0, 0.0, 0.0), covariance)
    assert belief.sigma == pytest.approx(max(first, second), abs=1e-7)
