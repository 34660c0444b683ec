"""What a stack may leave out: the memory, the plan through it; and the flow that it passes on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfw.context import Context
from navfw.interfaces import Behavior
from navfw.mofis.fusion.fuzzy import FuzzyFusion
from navfw.mofis.mofis import Mofis, MofisParams
from navfw.offis.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import Belief, Odometry, Pose, Proposal, Twist, Waypoint
from navfw.testing.behavior_scenes import wall_flow

ROBOT = RobotModel()
GOAL = Waypoint(3.0, 1.0, 0.3, "there", "goal", final=True)


class Idle(Behavior):
    """Wants nothing."""

    name = "idle"

    def propose(self, context: Context) -> Proposal:
        return Proposal(0.0, context.commands.zeros(), context.commands.zeros(), "nothing")


def mofis(**params: object) -> Mofis:
    chosen = MofisParams.model_validate({"ego_map": {"hit": 1.5, "free": 0.7}, **params})
    return Mofis(ROBOT, {"idle": Idle(ROBOT)}, FuzzyFusion(ROBOT), chosen)


def decide(room: Mofis, time: float, ahead: float | None) -> Context:
    """One decision of a robot at the origin that sees a wall ``ahead``, or nothing new."""
    twist = Twist(0.2, 0.0)
    odometry = Odometry(time, Pose(0.0, 0.0, 0.0), twist, 0.0, still=False)
    flows = [] if ahead is None else [wall_flow(ROBOT, time, ahead, 20.0, 20.0)]
    percepts = [Offis(ROBOT).perceive(flow, twist) for flow in flows]
    belief = Belief(time, odometry.pose, np.zeros((3, 3)))
    room.decide(odometry, belief, percepts, GOAL, flows)
    assert room.context is not None
    return room.context


def test_without_memory_what_is_not_seen_now_is_forgotten_at_once() -> None:
    remembers, forgets = mofis(), mofis(memory=False)
    for room in (remembers, forgets):
        assert decide(room, 1.0, 0.8).ranges.front < 0.8, "it sees the wall"
    assert decide(remembers, 1.1, None).ranges.front < 0.8
    assert decide(forgets, 1.1, None).ranges.front > 2.5
    assert decide(forgets, 1.2, 0.8).ranges.front < 0.8


def test_without_memory_the_safety_monitor_still_has_what_is_seen_now() -> None:
    room = mofis(memory=False)
    decide(room, 1.0, 0.8)
    free, _ = room.room(Pose(0.0, 0.0, 0.0), Twist(0.3, 0.0))
    assert free < 0.75
    decide(room, 1.1, None)
    free, known = room.room(Pose(0.0, 0.0, 0.0), Twist(0.3, 0.0))
    assert free == 1.0
    assert known < 0.3, "the unseen is not known to be free: the monitor lets it creep"


def test_without_a_local_plan_the_aim_is_the_waypoint_itself() -> None:
    straight = decide(mofis(local_plan=False), 1.0, 0.8).aim
    assert straight is not None
    assert straight.bearing == pytest.approx(math.atan2(1.0, 3.0))
    assert (straight.cost, straight.reachable) == (pytest.approx(math.hypot(3.0, 1.0)), True)
    planned = decide(mofis(), 1.0, 0.8).aim
    assert planned is not None
    assert planned.cost > straight.cost


def test_behaviours_are_shown_the_newest_flow() -> None:
    room = mofis()
    first = decide(room, 1.0, 2.0).flow
    assert first is not None
    assert (first.time, first.derotated) == (1.0, True)
    assert decide(room, 1.1, None).flow is first
    assert decide(room, 1.2, 2.0).flow is not first
    room.reset()
    assert decide(room, 1.3, None).flow is None
