"""The behaviours we ship keep their contract and do what their names say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from navfw.kinds import Behavior
from navfw.mofis.context import Context
from navfw.plugins import Registry, default_registry
from navfw.robot import RobotModel
from navfw.signals import Proposal, Twist
from navfw.testing import check_behavior
from navfw.testing.scenes import Scene, contexts_of

ROBOT = RobotModel()
SHIPPED = ("avoid", "emergency", "follow_wall", "go_to_xy")


@pytest.fixture(scope="module")
def registry() -> Iterator[Registry]:
    yield default_registry()


def behavior_class(registry: Registry, name: str) -> type[Behavior]:
    cls = registry.get("behavior", name)
    assert issubclass(cls, Behavior)
    return cls


@pytest.mark.parametrize("name", SHIPPED)
def test_keeps_the_contract(registry: Registry, name: str) -> None:
    check_behavior(behavior_class(registry, name))


def propose(registry: Registry, name: str, scene: Scene) -> tuple[Context, Proposal]:
    """The context and the behaviour's proposal at the end of a scene."""
    behavior = behavior_class(registry, name)(ROBOT)
    behavior.reset()
    proposals = [(context, behavior.propose(context)) for context in contexts_of(scene)]
    return proposals[-1]


def wanted(context: Context, proposal: Proposal) -> Twist:
    """The centre of what a proposal desires."""
    desire = proposal.desirability
    return Twist(
        float((desire * context.commands.v[:, None]).sum() / desire.sum()),
        float((desire * context.commands.w[None, :]).sum() / desire.sum()),
    )


@pytest.mark.parametrize(
    ("waypoint", "sign"), [((1.0, 2.0), 1.0), ((1.0, -2.0), -1.0), ((-2.0, 0.3), 1.0)]
)
def test_go_to_xy_turns_toward_the_waypoint(
    registry: Registry, waypoint: tuple[float, float], sign: float
) -> None:
    scene = Scene("goal aside", Twist(0.1, 0.0), waypoint=waypoint, ticks=2)
    context, proposal = propose(registry, "go_to_xy", scene)
    assert wanted(context, proposal).w * sign > 0.15


def test_go_to_xy_drives_fast_straight_on_and_slowly_at_the_goal(registry: Registry) -> None:
    far = wanted(
        *propose(registry, "go_to_xy", Scene("far", Twist(0.3, 0.0), waypoint=(4.0, 0.0), ticks=25))
    )
    near = wanted(
        *propose(registry, "go_to_xy", Scene("near", Twist(0.1, 0.0), waypoint=(0.25, 0.0)))
    )
    assert far.v > 0.3
    assert near.v < 0.6 * far.v
    assert abs(far.w) < 0.05


def test_go_to_xy_wants_nothing_without_a_waypoint(registry: Registry) -> None:
    _, proposal = propose(registry, "go_to_xy", Scene("nowhere", Twist(0.1, 0.0), waypoint=None))
    assert proposal.applicability == 0.0


def test_avoid_forbids_what_cannot_stop_before_the_wall(registry: Registry) -> None:
    context, proposal = propose(
        registry, "avoid", Scene("wall", Twist(0.2, 0.0), ahead=0.75, ticks=14)
    )
    straight = context.commands.w.size // 2
    assert context.ranges.front < 0.4
    assert proposal.prohibition[-1, straight] > 0.5
    standing = int(np.flatnonzero(context.commands.v == 0.0)[0])
    assert np.all(proposal.prohibition[standing] < 0.5)  # turning on the spot is always allowed
    rules = proposal.explain(len(context.commands.v) - 1, straight)
    assert rules and "forbid IS yes" in rules[0]["rule"]


def test_avoid_allows_the_open_floor_that_it_has_seen(registry: Registry) -> None:
    context, proposal = propose(registry, "avoid", Scene("open", Twist(0.3, 0.0), ticks=14))
    straight = context.commands.w.size // 2
    assert proposal.prohibition[-1, straight] < 0.5


def test_avoid_doubts_what_it_has_not_seen(registry: Registry) -> None:
    scene = Scene("blind", Twist(0.0, 0.0), sees=False, ticks=2)
    context, proposal = propose(registry, "avoid", scene)
    straight = context.commands.w.size // 2
    slow = int(np.searchsorted(context.commands.v, 0.05))
    assert proposal.prohibition[-1, straight] > 1.5 * proposal.prohibition[slow, straight]


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_follow_wall_keeps_its_distance(registry: Registry, side: str, sign: float) -> None:
    def beside(gap: float) -> Scene:
        scene = Scene("beside a wall", Twist(0.2, 0.0), ticks=16)
        return replace(scene, left=gap) if side == "left" else replace(scene, right=gap)

    near, far = beside(0.32), beside(0.8)
    assert wanted(*propose(registry, "follow_wall", near)).w * sign < -0.05
    assert wanted(*propose(registry, "follow_wall", far)).w * sign > 0.05


def test_follow_wall_leads_only_when_nothing_else_gets_on(registry: Registry) -> None:
    moving = Scene("moving", Twist(0.2, 0.0), left=0.5, ticks=10)
    held = Scene("held", Twist(0.0, 0.01), left=0.5, ticks=160)
    _, before = propose(registry, "follow_wall", moving)
    assert before.applicability < 0.2
    context, after = propose(registry, "follow_wall", held)
    assert context.idle > 12.0
    # without a percept there is no wall to follow, with one there is
    assert after.applicability > 0.5 or context.ranges.left > 1.2


def test_emergency_sleeps_while_all_is_well(registry: Registry) -> None:
    context, proposal = propose(registry, "emergency", Scene("open", Twist(0.3, 0.0), ticks=10))
    assert proposal.applicability == 0.0
    assert not proposal.prohibition.any()
    assert context.stalled == 0.0


def test_emergency_stops_a_robot_that_is_held(registry: Registry) -> None:
    held = Scene("held", Twist(0.3, 0.0), wheels_turn=False, ticks=30)
    context, proposal = propose(registry, "emergency", held)
    assert proposal.applicability == 1.0
    assert np.all(proposal.prohibition[context.commands.v > 0.0] == 1.0)
    assert wanted(context, proposal).v <= 0.0


def test_emergency_stops_before_a_wall_that_is_too_near(registry: Registry) -> None:
    scene = Scene("late", Twist(0.5, 0.0), ahead=0.95, ticks=12)
    _, proposal = propose(registry, "emergency", scene)
    assert proposal.applicability == 1.0
