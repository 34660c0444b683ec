"""Keep clear: what was near and has left the view bars the ways into it until it is passed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import behavior_of, desired_twist

from navfw.context import Context
from navfw.signals import Percept, Pose, Proposal, Twist
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene


def last(scene: BehaviorScene) -> Context:
    return contexts_of(scene)[-1]


def open_floor() -> Percept:
    percept = last(BehaviorScene("open", Twist(0.3, 0.0))).percept
    assert percept is not None
    return percept


def barred(context: Context, proposal: Proposal, turn: float) -> bool:
    """Whether all forward commands with about this turn [of the top rate] are prohibited."""
    columns = np.abs(context.commands.relative_w - turn) < 0.06
    layer = proposal.prohibition[context.commands.forward_rows][:, columns]
    return bool((layer > 0.5).all())


def moved(context: Context, ahead: float = 0.0, turn: float = 0.0) -> Context:
    """``context`` a moment later, farther ahead [m] and turned [rad], without a new percept."""
    x, y = context.pose.to_parent(ahead, 0.0)
    pose = Pose(x, y, context.pose.yaw + turn)
    return replace(context, pose=pose, time=context.time + 0.5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_does_not_drive_into_what_it_has_turned_to(side: float) -> None:
    behavior = behavior_of("keep_clear")
    scene = BehaviorScene("beside", Twist(0.3, 0.0))
    scene = replace(scene, left=0.33) if side > 0.0 else replace(scene, right=0.33)
    context = last(scene)
    beside = behavior.propose(context)
    assert beside.applicability == 0.0
    assert not barred(context, beside, 0.0), "past it"
    at_it = moved(context, ahead=0.4, turn=side * 1.2)
    facing = behavior.propose(at_it)
    assert barred(at_it, facing, 0.0)
    assert facing.applicability == 1.0
    twist = desired_twist(at_it, facing)
    assert twist.v == pytest.approx(0.0, abs=0.02)
    assert abs(twist.w) > 0.4
    away = math.copysign(1.0, twist.w) * at_it.commands.relative_w
    still = at_it.commands.v == 0.0
    assert not facing.prohibition[np.ix_(still, away > 0.2)].any()
    assert (facing.prohibition[:, away < -0.2] >= 0.5).all(), "it does not turn back"
    assert facing.prohibition[np.ix_(still, away < -0.2)].max() == 0.5, "an emergency may"


def test_it_drives_on_past_the_object_before_it_may_turn_back() -> None:
    behavior = behavior_of("keep_clear")
    context = last(BehaviorScene("beside", Twist(0.3, 0.0), left=0.33))
    behavior.propose(context)
    context = moved(context, ahead=0.4, turn=1.2)
    way = math.copysign(1.0, desired_twist(context, behavior.propose(context)).w)
    turned = 0.0
    while desired_twist(context, behavior.propose(context)).v < 0.1:
        context = moved(context, turn=0.1 * way)
        turned += 0.1
        assert turned < 4.0
    onward = moved(context, ahead=0.1)
    assert behavior.propose(onward).applicability == 1.0
    passed = moved(onward, ahead=0.3)
    assert behavior.propose(passed).applicability == 0.0


def test_what_is_passed_or_old_is_forgotten() -> None:
    behavior = behavior_of("keep_clear")
    context = last(BehaviorScene("wall", Twist(0.2, 0.0), ahead=0.75))
    behavior.propose(context)
    assert barred(context, behavior.propose(moved(context, ahead=0.3)), 0.0)
    late = replace(moved(context, ahead=0.3), time=context.time + 20.0)
    assert not behavior.propose(late).prohibition.any()
    behavior.reset()
    behavior.propose(context)
    far = moved(context, ahead=-1.5)
    behavior.propose(far)
    assert not behavior.propose(moved(far, ahead=1.8)).prohibition.any()


@pytest.mark.parametrize(("distance", "denied"), [(1.0, True), (0.62, False)])
def test_a_percept_denies_what_it_shows_again_but_nothing_too_near_for_flow(
    distance: float, *, denied: bool
) -> None:
    behavior = behavior_of("keep_clear")
    context = last(BehaviorScene("wall", Twist(0.1, 0.0), ahead=distance))
    behavior.propose(context)
    later = moved(context)
    behavior.propose(replace(later, percept=replace(open_floor(), time=later.time)))
    ahead = moved(later, ahead=distance - 0.1 - 0.35)
    assert barred(ahead, behavior.propose(ahead), 0.0) is not denied
