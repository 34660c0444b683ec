"""Who walks is a thing like others, unless a behaviour heeds movers."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.context import Context
from navfw.fault_injection import inject_faults
from navfw.interfaces import Behavior
from navfw.mofis.fusion.fuzzy import FuzzyFusion
from navfw.mofis.mofis import Mofis
from navfw.robot import RobotModel
from navfw.signals import Belief, MovingObject, Odometry, Pose, Proposal, Twist, Waypoint

ROBOT = RobotModel()
GOAL = Waypoint(3.0, 0.0, 0.3, "there", "goal", final=True)


class Careless(Behavior):
    """Wants nothing, and leaves movers to others."""

    name = "careless"

    def propose(self, context: Context) -> Proposal:
        return Proposal(0.0, context.commands.zeros(), context.commands.zeros(), "nothing")


class Heedful(Careless):
    """Says that it minds movers."""

    name = "heedful"
    handles_moving_obstacles = True


class Failing(Heedful):
    """Says so, and then says nothing."""

    name = "failing"

    def propose(self, context: Context) -> Proposal:
        raise RuntimeError("no idea")


def context_beside_someone(*behaviors: type[Behavior], sabotaged: str | None = None) -> Context:
    """What behaviours know of somebody seen twice, 0.7 m ahead, before any percept."""
    room = Mofis(ROBOT, {b.name: b(ROBOT) for b in behaviors}, FuzzyFusion(ROBOT))
    if sabotaged is not None:
        inject_faults(room.behaviors, sabotaged)
    for time in (0.1, 0.2, 0.3):
        odometry = Odometry(time, Pose(0.0, 0.0, 0.0), Twist(0.2, 0.0), 0.0, still=False)
        someone = MovingObject(time, 0.0, 0.3, 0.7, np.zeros((2, 2)), np.zeros(2))
        belief = Belief(time, odometry.pose, np.zeros((3, 3)))
        room.decide(odometry, belief, [], GOAL, movers=[someone])
    assert room.context is not None
    return room.context


@pytest.mark.parametrize("behaviors", [(Careless,), (Careless, Heedful)])
def test_movers_bar_arcs_unless_a_behaviour_heeds_them(
    behaviors: tuple[type[Behavior], ...],
) -> None:
    context = context_beside_someone(*behaviors)
    straight = context.commands.nearest(Twist(0.3, 0.0))
    barred = context.arcs.free[straight] < 0.8
    assert bool(barred) == (Heedful not in behaviors)
    # all know of the meeting, and the way ahead leads past
    assert context.conflicts is not None
    assert context.local_goal is not None
    assert abs(context.local_goal.bearing) > 0.1


def test_one_that_fails_heeds_nobody() -> None:
    context = context_beside_someone(Careless, Failing)
    assert context.arcs.free[context.commands.nearest(Twist(0.3, 0.0))] < 0.8


def test_a_saboteur_that_waits_changes_nothing() -> None:
    context = context_beside_someone(Careless, Heedful, sabotaged="heedful")
    assert context.arcs.free[context.commands.nearest(Twist(0.3, 0.0))] > 0.8
