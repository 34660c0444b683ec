"""The primitives of the stack as published: they decide by near, middle and far alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import behavior_of, desired_twist

from navfw.context import Context, quadrant_distances
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Pose, Twist
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene

ROBOT = RobotModel()
REGISTRY = default_registry()


def last(scene: BehaviorScene) -> Context:
    return contexts_of(scene)[-1]


def test_quadrant_distances_are_near_on_the_side_of_a_wall_and_far_elsewhere() -> None:
    beside = last(BehaviorScene("left", Twist(0.3, 0.0), left=0.5)).quadrant_distances
    assert beside is not None
    assert (beside.left, beside.right, beside.ahead) == (0.0, 1.0, 1.0)
    ahead = last(BehaviorScene("ahead", Twist(0.3, 0.0), ahead=0.9)).quadrant_distances
    assert ahead is not None
    assert max(ahead.left, ahead.right, ahead.ahead) < 0.2
    corridor = last(
        BehaviorScene("corridor", Twist(0.3, 0.0), left=0.7, right=0.7)
    ).quadrant_distances
    assert corridor is not None
    assert corridor.ahead == 1.0, "walls beside a corridor are not ahead"
    assert max(corridor.left, corridor.right) < 0.2


def test_unknown_quadrants_are_neither_near_nor_far() -> None:
    percept = last(BehaviorScene("open", Twist(0.3, 0.0))).percept
    assert percept is not None
    nothing = dict.fromkeys(("near", "middle", "far"), 0.0)
    blind = replace(percept, quadrants=dict.fromkeys(percept.quadrants, nothing))
    unknown = quadrant_distances(blind, percept.time + 2.0)
    assert (unknown.left, unknown.right) == (0.5, 0.5)
    assert unknown.age == pytest.approx(2.0)


def test_with_one_layer_ahead_is_the_farther_half() -> None:
    percept = last(BehaviorScene("ahead", Twist(0.3, 0.0), ahead=0.9)).percept
    assert percept is not None
    shallow = replace(percept, obstacles={"layer1": percept.obstacles["layer1"]})
    assert quadrant_distances(shallow, percept.time).ahead < 0.2


@pytest.mark.parametrize(("side", "sign"), [("left", -1.0), ("right", 1.0)])
def test_it_turns_away_from_the_nearer_half(side: str, sign: float) -> None:
    scene = BehaviorScene("beside", Twist(0.3, 0.0))
    scene = replace(scene, left=0.5) if side == "left" else replace(scene, right=0.5)
    context = last(scene)
    proposal = behavior_of("avoid_quadrants").propose(context)
    assert proposal.applicability > 0.8
    assert desired_twist(context, proposal).w * sign > 0.3


@pytest.mark.parametrize(("goal", "sign"), [((2.0, 1.5), 1.0), ((2.0, -1.5), -1.0)])
def test_before_a_wall_it_turns_hard_to_the_waypoints_side_and_not_fast(
    goal: tuple[float, float], sign: float
) -> None:
    context = last(BehaviorScene("wall", Twist(0.3, 0.0), waypoint=goal, ahead=0.9))
    proposal = behavior_of("avoid_quadrants").propose(context)
    twist = desired_twist(context, proposal)
    assert twist.w * sign > 0.7
    assert twist.v < 0.2
    assert np.all(proposal.prohibition[-1] > 0.0), "driving on at full speed is discouraged"
    assert not proposal.prohibition[context.commands.v <= 0.05].any()


def test_old_percepts_are_ignored() -> None:
    context = last(BehaviorScene("wall", Twist(0.3, 0.0), ahead=0.9))
    late = replace(context, time=context.time + 1.0)
    for name in ("avoid_quadrants", "follow_wall_quadrants"):
        assert behavior_of(name).propose(late).applicability == 0.0


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_following_a_wall_keeps_it_between_near_and_middle(side: str, sign: float) -> None:
    def turn(distance: float) -> float:
        scene = BehaviorScene("beside", Twist(0.2, 0.0))
        scene = replace(scene, left=distance) if side == "left" else replace(scene, right=distance)
        context = last(scene)
        return (
            desired_twist(context, behavior_of("follow_wall_quadrants").propose(context)).w * sign
        )

    assert turn(0.4) < -0.1
    assert turn(1.8) > 0.1


def test_an_emergency_turns_on_the_spot_to_its_end() -> None:
    behavior = behavior_of("emergency_quadrants")
    drive = contexts_of(BehaviorScene("late", Twist(0.3, 0.0), waypoint=(3.0, 2.0), ahead=0.6))
    context = drive[-1]
    assert context.quadrant_distances is not None and context.quadrant_distances.floor < 0.2
    proposal = behavior.propose(context)
    assert proposal.applicability == 1.0
    assert np.all(proposal.prohibition[context.commands.v > 0.0] == 1.0)
    twist = desired_twist(context, proposal)
    assert (twist.v, twist.w > 0.5) == (0.0, True), "to the side of the waypoint"
    turned = 0.0
    while behavior.propose(context).applicability:
        turned += 0.1
        pose = Pose(context.pose.x, context.pose.y, context.pose.yaw + 0.1)
        # there is no percept while turning: the last one ages
        context = replace(context, pose=pose, time=context.time + 0.2)
        assert turned < 2.0
    assert 0.8 < turned < 1.2


def test_an_emergency_is_none_on_open_floor() -> None:
    context = last(BehaviorScene("open", Twist(0.3, 0.0)))
    assert behavior_of("emergency_quadrants").propose(context).applicability == 0.0


def test_the_view_moves_on_while_no_percept_is_recent() -> None:
    context = last(BehaviorScene("open", Twist(0.3, 0.0)))
    behavior = behavior_of("look_again")
    assert behavior.propose(context).applicability == 0.0, "the percept is recent"
    for late in (replace(context, time=context.time + 1.0), replace(context, percept=None)):
        proposal = behavior.propose(late)
        twist = desired_twist(late, proposal)
        assert proposal.applicability > 0.5
        assert 0.05 < twist.v < 0.25
        assert twist.w == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_view_turns_away_from_an_old_near_object_before_it_moves_on(sign: float) -> None:
    # the object fills both halves: the waypoint's side decides
    scene = BehaviorScene("wall", Twist(0.3, 0.0), waypoint=(2.0, 1.5 * sign), ahead=0.9)
    context = last(scene)
    context = replace(context, time=context.time + 1.0)
    behavior = behavior_of("look_again")
    twist = desired_twist(context, behavior.propose(context))
    assert twist.v == pytest.approx(0.0, abs=0.02)
    assert twist.w * sign > 0.3
    turned = Pose(context.pose.x, context.pose.y, context.pose.yaw + sign * 0.8)
    onward = replace(context, pose=turned, time=context.time + 1.0)
    proposal = behavior.propose(onward)
    twist = desired_twist(onward, proposal)
    assert twist.v > 0.1
    assert twist.w == pytest.approx(0.0, abs=0.05)
    forward, turning = onward.commands.forward_rows, np.abs(onward.commands.relative_w) > 0.15
    assert (proposal.prohibition[forward, turning] == 1.0).all()
    assert not proposal.prohibition[:, ~turning].any()


def test_what_was_near_and_left_the_view_is_not_turned_into_until_it_is_passed() -> None:
    behavior = behavior_of("avoid_quadrants")
    context = last(BehaviorScene("beside", Twist(0.3, 0.0), left=0.5))
    behavior.propose(context)
    gone = last(BehaviorScene("open", Twist(0.3, 0.0))).percept
    assert gone is not None
    commands = context.commands

    def into(ahead: float, turned: float = 0.0) -> bool:
        x, y = context.pose.to_parent(ahead, 0.0)
        pose = Pose(x, y, context.pose.yaw + turned)
        percept = replace(gone, time=context.time)
        layer = behavior.propose(replace(context, pose=pose, percept=percept)).prohibition
        assert not layer[:, commands.relative_w < 0.1].any(), "straight on, and away from it"
        assert not layer[commands.v <= 0.0].any(), "on the spot"
        return bool((layer[commands.forward_rows, commands.relative_w > 0.2] > 0.5).all())

    assert into(0.2)
    assert into(0.4)
    assert not into(0.6)
    behavior.propose(context)
    assert not into(0.1, turned=1.2), "it is in view again"


def test_a_wall_that_has_left_the_view_is_not_circled() -> None:
    behavior = behavior_of("follow_wall_quadrants")
    context = replace(last(BehaviorScene("beside", Twist(0.2, 0.0), left=0.5)), idle=12.0)
    assert behavior.propose(context).applicability > 0.5
    gone = last(BehaviorScene("open", Twist(0.3, 0.0))).percept
    assert gone is not None
    context = replace(context, percept=replace(gone, time=context.time))
    turned = 0.0
    while behavior.propose(context).applicability > 0.0:
        turned += 0.2
        pose = context.pose
        context = replace(context, pose=Pose(pose.x, pose.y, pose.yaw + 0.2))
        assert turned < 3.0
    assert turned > 1.0
