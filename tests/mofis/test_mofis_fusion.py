"""Command fusion: desires are blended, prohibitions hold, alternatives are not averaged."""

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from navfw_benchmarks.plugins.fusions import (
    BlendFusion,
    DamnFusion,
    ParetoFusion,
    PriorityFusion,
    pareto_front,
)

from navfw.context import CommandGrid, Context
from navfw.interfaces import Behavior, Composite, Fusion
from navfw.localmap import LocalMap
from navfw.mofis.fusion import CUT, FuzzyFusion
from navfw.mofis.mofis import DecisionInputs, Mofis, explain_command
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, Odometry, Pose, Proposal, Twist, Waypoint
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene

ROBOT = RobotModel()
GRID = CommandGrid(ROBOT)
LAYER = hnp.arrays(np.float64, GRID.shape, elements=st.floats(0, 1, width=32))


START = contexts_of(BehaviorScene("start", Twist(0.0, 0.0), waypoint=None, perceives=False))[0]


def context(previous: Command | None = None) -> Context:
    return replace(START, commands=GRID, previous=previous)


def proposal(applicability: float, desire: Array, prohibit: Array | None = None) -> Proposal:
    return Proposal(applicability, desire, GRID.zeros() if prohibit is None else prohibit, "test")


def bump(v: float, w: float, width: float = 0.15) -> Array:
    """Desirability around the command (v, w), relative to the top speeds."""
    speed = np.exp(-(((GRID.relative_v - v) / width) ** 2))
    turn = np.exp(-(((GRID.relative_w - w) / width) ** 2))
    return GRID.product(speed, turn)


@pytest.mark.parametrize(("wanted", "v"), [(1.0, 0.5), (1.4, 0.5), (0.5, 0.25)])
def test_who_desires_the_top_speed_or_more_gets_the_top_speed(wanted: float, v: float) -> None:
    desire = bump(wanted, 0.0, 0.4)
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": proposal(0.8, desire)})
    assert command.twist.v == pytest.approx(v, abs=1e-9 if wanted >= 1.0 else 0.02)


def test_the_speed_changes_little_with_little_change_of_the_desire() -> None:
    speeds = [
        FuzzyFusion(ROBOT).fuse(context(), {"a": proposal(1.0, bump(v, 0.0, 0.4))}).twist.v
        for v in np.linspace(0.5, 1.2, 141)
    ]
    assert np.abs(np.diff(speeds)).max() < 0.03
    assert (np.diff(speeds) > -0.01).all()


@pytest.mark.parametrize("blend", ["sum", "max"])
@settings(max_examples=40, deadline=None)
@given(desire=LAYER, prohibit=LAYER, other=LAYER)
def test_a_prohibited_command_is_never_chosen(
    blend: Literal["sum", "max"], desire: Array, prohibit: Array, other: Array
) -> None:
    fusion = FuzzyFusion(ROBOT, FuzzyFusion.Params(blend=blend))
    proposals = {"a": proposal(0.7, desire, prohibit), "b": proposal(0.5, other)}
    command = fusion.fuse(context(), proposals)
    if command.leader != "none":
        row, column = GRID.nearest(command.twist)
        assert prohibit[row, column] <= CUT


def test_if_forward_commands_are_prohibited_it_is_an_emergency_with_a_way_out() -> None:
    prohibit = np.ones(GRID.shape)
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": proposal(1.0, bump(1, 0), prohibit)})
    assert (command.twist, command.leader) == (Twist(0.0, 0.0), "none")
    assert command.emergency
    prohibit = GRID.forward()
    desire = np.maximum(bump(1, 0), bump(0, 0.5))
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": proposal(1.0, desire, prohibit)})
    assert command.emergency
    assert command.twist.v <= 0.0
    assert command.twist.w > 0.1


def test_two_ways_round_an_obstacle_are_not_averaged() -> None:
    desire = np.maximum(bump(0.6, -0.6), 1.05 * bump(0.6, 0.6)).clip(0, 1)
    command = FuzzyFusion(ROBOT).fuse(context(), {"a": proposal(1.0, desire)})
    assert abs(command.twist.w) > 0.4 * GRID.max_w


def test_the_side_once_chosen_is_kept() -> None:
    desire = np.maximum(bump(0.6, -0.6), bump(0.6, 0.6))
    before = Command(0.9, Twist(0.6 * GRID.max_v, -0.6 * GRID.max_w), "a", "")
    command = FuzzyFusion(ROBOT).fuse(context(before), {"a": proposal(1.0, desire)})
    assert command.twist.w < 0.0


def test_the_more_applicable_behavior_leads() -> None:
    proposals = {"strong": proposal(0.9, bump(0.5, 0.8)), "weak": proposal(0.2, bump(0.5, -0.8))}
    command = FuzzyFusion(ROBOT).fuse(context(), proposals)
    assert command.leader == "strong"
    assert command.twist.w > 0.0
    assert command.weights["strong"] == pytest.approx(0.9 / 1.1)


@settings(max_examples=20, deadline=None)
@given(LAYER, st.floats(0.1, 1.0))
def test_scaling_all_applicabilities_changes_nothing(desire: Array, factor: float) -> None:
    fusion = FuzzyFusion(ROBOT)
    one = fusion.fuse(context(), {"a": proposal(1.0, desire), "b": proposal(0.5, bump(0.4, 0))})
    scaled = {"a": proposal(factor, desire), "b": proposal(0.5 * factor, bump(0.4, 0))}
    two = fusion.fuse(context(), scaled)
    assert one.twist.v == pytest.approx(two.twist.v, abs=1e-6)
    assert one.twist.w == pytest.approx(two.twist.w, abs=1e-6)


AHEAD = bump(0.5, 0.0)


class Broken(Behavior):
    """Raises."""

    name = "broken"

    def propose(self, context: Context) -> Proposal:
        raise ZeroDivisionError


class Steady(Behavior):
    """Desires to drive straight on."""

    name = "steady"

    def propose(self, context: Context) -> Proposal:
        return proposal(1.0, AHEAD)


INPUTS = DecisionInputs(
    odometry=Odometry(1.0, Pose(0, 0, 0), Twist(0, 0), 0.0, still=False),
    belief=Belief(1.0, Pose(0, 0, 0), np.eye(3)),
    waypoint=Waypoint(3.0, 0.0, 0.3, "there", "goal", final=True),
)


def mofis_with(behaviors: dict[str, Behavior], composite: Composite | None = None) -> Mofis:
    local_map = LocalMap(ROBOT)
    local_map.update(INPUTS.odometry, (), None, INPUTS.odometry.pose)
    return Mofis(ROBOT, behaviors, FuzzyFusion(ROBOT), GRID, local_map, composite)


@pytest.mark.parametrize(
    ("driven", "stalled"), [(None, True), (Twist(0.4, 0.0), True), (Twist(0.0, 0.0), False)]
)
def test_wheels_that_the_safety_monitor_holds_are_not_blocked(
    driven: Twist | None, stalled: bool
) -> None:
    mofis = mofis_with({"steady": Steady(ROBOT)})
    for time in (1.0, 2.0, 3.0):
        mofis.decide(replace(INPUTS, odometry=replace(INPUTS.odometry, time=time), driven=driven))
    assert mofis.context is not None
    assert (mofis.context.stalled > 0.0) is stalled


def test_a_broken_behavior_loses_the_tick_and_the_others_decide() -> None:
    mofis = mofis_with({"broken": Broken(ROBOT), "steady": Steady(ROBOT)})
    command = mofis.decide(INPUTS)
    assert command is not None
    assert command.leader == "steady"
    assert command.twist.v > 0.1
    mofis.decide(INPUTS)
    assert [(fault.plugin, fault.count) for fault in mofis.guard.faults] == [("behavior broken", 2)]
    explanation = explain_command(command, mofis.proposals, mofis)
    assert explanation["behaviors"]["steady"]["desirability"] > 0.5
    assert "broken" not in explanation["behaviors"]


ALL: list[type[Fusion]] = [FuzzyFusion, PriorityFusion, DamnFusion, BlendFusion, ParetoFusion]


@pytest.mark.parametrize("fusion", ALL)
def test_every_fusion_follows_the_only_proposal_and_stops_without_one(fusion: type[Fusion]) -> None:
    command = fusion(ROBOT).fuse(context(), {"a": proposal(1.0, bump(0.6, 0.4))})
    assert command.leader == "a"
    assert command.twist.v == pytest.approx(0.6 * GRID.max_v, abs=0.1 * GRID.max_v)
    assert command.twist.w == pytest.approx(0.4 * GRID.max_w, abs=0.1 * GRID.max_w)
    standing = fusion(ROBOT).fuse(context(), {"a": proposal(0.0, GRID.zeros())})
    assert (standing.twist, standing.leader) == (Twist(0.0, 0.0), "none")


def test_pareto_chooses_no_prohibited_or_dominated_command() -> None:
    prohibit = GRID.zeros()
    prohibit[:, GRID.w > 0] = 1.0
    either = {"a": proposal(0.9, bump(0.5, 0.5), prohibit), "b": proposal(0.9, bump(0.5, -0.5))}
    assert ParetoFusion(ROBOT).fuse(context(), either).twist.w <= 0.0


@given(hnp.arrays(np.float64, (3, 12), elements=st.floats(0, 1, width=16)))
def test_the_pareto_front_is_all_that_is_not_dominated(objectives: Array) -> None:
    front = set(pareto_front(objectives).tolist())
    for j, point in enumerate(objectives.T):
        dominated = any(np.all(o >= point) and np.any(o > point) for o in objectives.T)
        assert (j in front) != dominated


def test_damn_weighs_votes_against_by_applicability() -> None:
    ahead = bump(0.8, 0.0)
    prohibit = np.where(GRID.v[:, None] > 0.3, 1.0, 0.0) + GRID.zeros()
    # hardly applicable, it is outvoted; fully applicable, it is not
    for applicability, fast in ((0.1, True), (1.0, False)):
        against = proposal(applicability, GRID.zeros(), prohibit)
        command = DamnFusion(ROBOT).fuse(context(), {"go": proposal(0.9, ahead), "no": against})
        assert (command.twist.v > 0.3) == fast


def test_priority_follows_the_first_applicable_behavior() -> None:
    proposals = {"go_to_xy": proposal(0.9, bump(0.8, 0.0)), "avoid": proposal(0.9, bump(0.2, 0.9))}
    fusion = PriorityFusion(ROBOT)
    assert fusion.fuse(context(), proposals).leader == "avoid"
    lower = {"go_to_xy": proposal(0.9, bump(0.8, 0.0)), "avoid": proposal(0.1, bump(0.2, 0.9))}
    assert fusion.fuse(context(), lower).leader == "go_to_xy"


class FixedWeights(Composite):
    """Gives the weights that are set."""

    name = "fixed_weights"
    weights: ClassVar[dict[str, float]] = {"steady": 0.3}

    def weigh(self, context: Context) -> dict[str, float]:
        return self.weights


def test_a_composite_weighs_primitives_and_they_decide_when_it_fails() -> None:
    composite = FixedWeights(ROBOT)
    mofis = mofis_with({"steady": Steady(ROBOT)}, composite)
    mofis.decide(INPUTS)
    assert mofis.proposals["steady"].applicability == pytest.approx(0.3)
    composite.weights = {"steady": 7.0}  # type: ignore[misc]
    mofis.decide(INPUTS)
    assert mofis.proposals["steady"].applicability == 1.0
    assert "fixed_weights" in str(mofis.guard.faults[0])
