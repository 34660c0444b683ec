"""Command fusion: desires are blended, prohibitions hold, two ways round are not averaged."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from navfw.context import CommandGrid, Context
from navfw.interfaces import Behavior, Composite, Fusion
from navfw.localmap.free_distance import look_around, sweep
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.mofis.explanation import explain_command
from navfw.mofis.fusion.blend import BlendFusion
from navfw.mofis.fusion.damn import DamnFusion
from navfw.mofis.fusion.fuzzy import FuzzyFusion
from navfw.mofis.fusion.pareto import ParetoFusion, pareto_front
from navfw.mofis.fusion.priority import PriorityFusion
from navfw.mofis.mofis import Mofis
from navfw.robot import RobotModel
from navfw.signals import Array, Belief, Command, Odometry, Pose, Proposal, Twist, Waypoint

ROBOT = RobotModel()
GRID = CommandGrid(ROBOT)
LAYER = hnp.arrays(np.float64, GRID.shape, elements=st.floats(0, 1, width=32))


def context(previous: Command | None = None) -> Context:
    occupancy = OccupancyGrid(ROBOT)
    pose = Pose(0, 0, 0)
    occupancy.move(pose, 0.0)
    return Context(
        time=1.0,
        robot=ROBOT,
        commands=GRID,
        twist=Twist(0, 0),
        pose=pose,
        belief=Belief(1.0, pose, np.eye(3)),
        percept=None,
        arcs=sweep(occupancy, pose, GRID, 0.04),
        ranges=look_around(occupancy, pose),
        waypoint=None,
        local_goal=None,
        previous=previous,
        stalled=0.0,
        idle=0.0,
    )


def wish(applicability: float, desire: Array, forbid: Array | None = None) -> Proposal:
    return Proposal(applicability, desire, GRID.zeros() if forbid is None else forbid, "wish")


def bump(v: float, w: float, width: float = 0.15) -> Array:
    speed = np.exp(-(((GRID.relative_v - v) / width) ** 2))
    turn = np.exp(-(((GRID.relative_w - w) / width) ** 2))
    return GRID.product(speed, turn)


@pytest.mark.parametrize("blend", ["sum", "max"])
@settings(max_examples=40, deadline=None)
@given(desire=LAYER, forbid=LAYER, other=LAYER)
def test_a_forbidden_command_is_never_chosen(
    blend: str, desire: Array, forbid: Array, other: Array
) -> None:
    fusion = FuzzyFusion(ROBOT, FuzzyFusion.Params(blend=blend))
    command = fusion.fuse(context(), {"a": wish(0.7, desire, forbid), "b": wish(0.5, other)})
    if command.leader != "none":
        row, column = GRID.nearest(command.twist)
        assert forbid[row, column] <= fusion.params.cut


def test_everything_forbidden_means_standing_still() -> None:
    forbid = np.ones(GRID.shape)
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": wish(1.0, bump(1, 0), forbid)})
    assert command.twist == Twist(0.0, 0.0)
    assert command.leader == "none"
    assert command.emergency


def test_only_forward_forbidden_is_an_emergency_with_a_way_out() -> None:
    forbid = GRID.zeros()
    forbid[GRID.v > 0.0] = 1.0
    desire = np.maximum(bump(1, 0), bump(0, 0.5))
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": wish(1.0, desire, forbid)})
    assert command.emergency
    assert command.twist.v <= 0.0
    assert command.twist.w > 0.1


def test_two_ways_round_are_not_averaged_into_the_obstacle() -> None:
    desire = np.maximum(bump(0.6, -0.6), 1.05 * bump(0.6, 0.6)).clip(0, 1)
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": wish(1.0, desire)})
    assert abs(command.twist.w) > 0.4 * GRID.max_w


def test_it_stays_with_the_side_once_chosen() -> None:
    desire = np.maximum(bump(0.6, -0.6), bump(0.6, 0.6))
    before = Command(0.9, Twist(0.6 * GRID.max_v, -0.6 * GRID.max_w), "a", "")
    command = FuzzyFusion(ROBOT).fuse(context(before), {"a": wish(1.0, desire)})
    assert command.twist.w < 0.0


def test_the_more_applicable_behavior_leads() -> None:
    proposals = {"strong": wish(0.9, bump(0.5, 0.8)), "weak": wish(0.2, bump(0.5, -0.8))}
    command = FuzzyFusion(ROBOT).fuse(context(), proposals)
    assert command.leader == "strong"
    assert command.twist.w > 0.0
    assert command.weights["strong"] == pytest.approx(0.9 / 1.1)


@settings(max_examples=20, deadline=None)
@given(LAYER, st.floats(0.1, 1.0))
def test_scaling_all_applicabilities_changes_nothing(desire: Array, factor: float) -> None:
    fusion = FuzzyFusion(ROBOT)
    one = fusion.fuse(context(), {"a": wish(1.0, desire), "b": wish(0.5, bump(0.4, 0))})
    two = fusion.fuse(context(), {"a": wish(factor, desire), "b": wish(0.5 * factor, bump(0.4, 0))})
    assert one.twist.v == pytest.approx(two.twist.v, abs=1e-6)
    assert one.twist.w == pytest.approx(two.twist.w, abs=1e-6)


class Broken(Behavior):
    """Does one thing wrong, as told."""

    name = "broken"
    deed = "raise"

    def propose(self, context: Context) -> Proposal:
        good = bump(0.5, 0.0)
        match self.deed:
            case "raise":
                raise ZeroDivisionError("no reason")
            case "nan":
                return wish(1.0, good * np.nan)
            case "shape":
                return wish(1.0, good[:-1])
            case "range":
                return wish(1.0, good * 3.0)
            case "applicability":
                return wish(float("nan"), good)
            case _:
                return "go"  # type: ignore[return-value]


class Steady(Behavior):
    """Drives straight on."""

    name = "steady"

    def propose(self, context: Context) -> Proposal:
        return Proposal(1.0, bump(0.5, 0.0), GRID.zeros(), "straight on")


@pytest.mark.parametrize("deed", ["raise", "nan", "shape", "range", "applicability", "type"])
def test_a_broken_behavior_costs_itself_the_tick_and_nobody_else(deed: str) -> None:
    broken = Broken(ROBOT)
    broken.deed = deed
    mofis = Mofis(ROBOT, {"broken": broken, "steady": Steady(ROBOT)}, FuzzyFusion(ROBOT))
    odometry = Odometry(1.0, Pose(0, 0, 0), Twist(0, 0), 0.0, still=False)
    waypoint = Waypoint(3.0, 0.0, 0.3, "there", "goal", final=True)
    command = mofis.decide(odometry, Belief(1.0, Pose(0, 0, 0), np.eye(3)), (), waypoint)
    assert command.leader == "steady"
    assert command.twist.v > 0.1
    mofis.decide(odometry, Belief(1.0, Pose(0, 0, 0), np.eye(3)), (), waypoint)
    assert [(fault.behavior, fault.count) for fault in mofis.faults] == [("broken", 2)]
    explanation = explain_command(command, mofis.proposals, mofis.commands)
    assert explanation["behaviors"]["steady"]["desirability"] > 0.5
    assert "broken" not in explanation["behaviors"]


ALL = [FuzzyFusion, PriorityFusion, DamnFusion, BlendFusion, ParetoFusion]


@pytest.mark.parametrize("fusion", ALL)
def test_every_fusion_follows_the_only_wish(fusion: type[Fusion]) -> None:
    command = fusion(ROBOT).fuse(context(), {"a": wish(1.0, bump(0.6, 0.4))})
    assert command.leader == "a"
    assert command.twist.v == pytest.approx(0.6 * GRID.max_v, abs=0.1 * GRID.max_v)
    assert command.twist.w == pytest.approx(0.4 * GRID.max_w, abs=0.1 * GRID.max_w)


@pytest.mark.parametrize("fusion", ALL)
def test_every_fusion_stands_still_without_a_wish(fusion: type[Fusion]) -> None:
    command = fusion(ROBOT).fuse(context(), {"a": wish(0.0, GRID.zeros())})
    assert command.twist == Twist(0.0, 0.0)
    assert command.leader == "none"


@pytest.mark.parametrize("fusion", ALL)
@settings(max_examples=15, deadline=None)
@given(desire=LAYER, forbid=LAYER, other=LAYER, share=st.floats(0, 1))
def test_every_fusion_stays_on_the_grid(
    fusion: type[Fusion], desire: Array, forbid: Array, other: Array, share: float
) -> None:
    proposals = {"a": wish(0.8, desire, forbid), "b": wish(share, other)}
    command = fusion(ROBOT).fuse(context(), proposals)
    assert GRID.v[0] - 1e-9 <= command.twist.v <= GRID.v[-1] + 1e-9
    assert abs(command.twist.w) <= GRID.max_w + 1e-9


def test_pareto_never_takes_what_is_forbidden_or_dominated() -> None:
    forbid = GRID.zeros()
    forbid[:, GRID.w > 0] = 1.0
    command = ParetoFusion(ROBOT).fuse(
        context(), {"a": wish(0.9, bump(0.5, 0.5), forbid), "b": wish(0.9, bump(0.5, -0.5))}
    )
    assert command.twist.w <= 0.0


@given(hnp.arrays(np.float64, (3, 12), elements=st.floats(0, 1, width=16)))
def test_the_pareto_front_is_what_nobody_dominates(objectives: Array) -> None:
    front = set(pareto_front(objectives).tolist())
    for j in range(objectives.shape[1]):
        dominated = any(
            np.all(objectives[:, i] >= objectives[:, j])
            and np.any(objectives[:, i] > objectives[:, j])
            for i in range(objectives.shape[1])
        )
        assert (j in front) != dominated


def test_damn_counts_votes_against_as_much_as_they_apply() -> None:
    ahead = bump(0.8, 0.0)
    forbid = np.where(GRID.v[:, None] > 0.3, 1.0, 0.0) + GRID.zeros()
    # hardly applicable, it is outvoted; fully applicable, it is not
    for applicability, fast in ((0.1, True), (1.0, False)):
        against = wish(applicability, GRID.zeros(), forbid)
        command = DamnFusion(ROBOT).fuse(context(), {"go": wish(0.9, ahead), "no": against})
        assert (command.twist.v > 0.3) == fast


def test_priority_lets_the_first_in_order_have_it_all() -> None:
    proposals = {"go_to_xy": wish(0.9, bump(0.8, 0.0)), "avoid": wish(0.9, bump(0.2, 0.9))}
    fusion = PriorityFusion(ROBOT)
    assert fusion.fuse(context(), proposals).leader == "avoid"
    calm = {"go_to_xy": wish(0.9, bump(0.8, 0.0)), "avoid": wish(0.1, bump(0.2, 0.9))}
    assert fusion.fuse(context(), calm).leader == "go_to_xy"


class Loud(Composite):
    """Gives `steady` a third, and fails when told to."""

    name = "loud"
    weights: ClassVar[dict[str, float]] = {"steady": 0.3}

    def weigh(self, context: Context) -> dict[str, float]:
        return self.weights


def test_a_composite_weighs_its_primitives_and_may_fail_alone() -> None:
    composite = Loud(ROBOT)
    mofis = Mofis(ROBOT, {"steady": Steady(ROBOT)}, FuzzyFusion(ROBOT), composite=composite)
    odometry = Odometry(1.0, Pose(0, 0, 0), Twist(0, 0), 0.0, still=False)
    waypoint = Waypoint(3.0, 0.0, 0.3, "there", "goal", final=True)
    belief = Belief(1.0, Pose(0, 0, 0), np.eye(3))
    mofis.decide(odometry, belief, (), waypoint)
    assert mofis.proposals["steady"].applicability == pytest.approx(0.3)
    composite.weights = {"steady": 7.0}  # type: ignore[misc]
    mofis.decide(odometry, belief, (), waypoint)
    assert mofis.proposals["steady"].applicability == 1.0
    assert "loud" in str(mofis.faults[0])
