"""Primitives that decide by near, middle and far alone, and by what was near and left the view."""

import math
from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import behavior_of, desired_twist, scene, twist_of

from navfw.context import Context
from navfw.context.decision_context import QuadrantDistances, quadrant_distances
from navfw.signals import Percept, Pose, Proposal


def percept_of(**walls: float) -> Percept:
    """The newest percept between ``walls`` (ahead, left, right) at these distances [m]."""
    percept = scene(**walls).percept
    assert percept is not None
    return percept


def distances(**walls: float) -> QuadrantDistances:
    percept = percept_of(**walls)
    return quadrant_distances(percept, percept.time)


def moved(context: Context, ahead: float = 0.0, turn: float = 0.0, seconds: float = 0.5) -> Context:
    """``context`` after a time [s], farther ahead [m] and turned [rad], without a new percept."""
    x, y = context.pose.to_parent(ahead, 0.0)
    pose = Pose(x, y, context.pose.yaw + turn)
    return replace(context, pose=pose, time=context.time + seconds)


def test_quadrant_distances_are_near_on_the_side_of_a_wall_and_far_elsewhere() -> None:
    left = distances(left=0.5)
    assert (left.left, left.right, left.ahead) == (0.0, 1.0, 1.0)
    ahead = distances(ahead=0.9)
    assert max(ahead.left, ahead.right, ahead.ahead) < 0.2
    corridor = distances(left=0.7, right=0.7)
    assert corridor.ahead == 1.0, "walls beside a corridor are not ahead"
    assert max(corridor.left, corridor.right) < 0.2


def test_unknown_quadrants_are_neither_near_nor_far() -> None:
    percept = percept_of()
    nothing = dict.fromkeys(("near", "middle", "far"), 0.0)
    blind = replace(percept, quadrants=dict.fromkeys(percept.quadrants, nothing))
    unknown = quadrant_distances(blind, percept.time + 2.0)
    assert (unknown.left, unknown.right) == (0.5, 0.5)
    assert unknown.age == pytest.approx(2.0)


def test_with_one_layer_ahead_is_the_farther_half() -> None:
    percept = percept_of(ahead=0.9)
    shallow = replace(percept, obstacles={"layer1": percept.obstacles["layer1"]})
    assert quadrant_distances(shallow, percept.time).ahead < 0.2


@pytest.mark.parametrize(("side", "sign"), [("left", -1.0), ("right", 1.0)])
def test_it_turns_away_from_the_nearer_half(side: str, sign: float) -> None:
    context = scene(**{side: 0.5})
    proposal = behavior_of("avoid_quadrants").propose(context)
    assert proposal.applicability > 0.8
    assert desired_twist(context, proposal).w * sign > 0.3


@pytest.mark.parametrize(("goal", "sign"), [((2.0, 1.5), 1.0), ((2.0, -1.5), -1.0)])
def test_before_a_wall_it_turns_hard_to_the_waypoints_side_and_not_fast(
    goal: tuple[float, float], sign: float
) -> None:
    context = scene(waypoint=goal, ahead=0.9)
    proposal = behavior_of("avoid_quadrants").propose(context)
    twist = desired_twist(context, proposal)
    assert twist.w * sign > 0.7
    assert twist.v < 0.2
    assert np.all(proposal.prohibition[-1] > 0.0), "driving on at full speed is discouraged"
    assert not proposal.prohibition[context.commands.v <= 0.05].any()


def test_old_percepts_are_ignored() -> None:
    context = scene(ahead=0.9)
    late = replace(context, time=context.time + 1.0)
    for name in ("avoid_quadrants", "follow_wall_quadrants"):
        assert behavior_of(name).propose(late).applicability == 0.0


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_following_a_wall_keeps_it_between_near_and_middle(side: str, sign: float) -> None:
    near, far = (
        twist_of("follow_wall_quadrants", scene(0.2, **{side: distance})).w * sign
        for distance in (0.4, 1.8)
    )
    assert near < -0.1
    assert far > 0.1


def test_an_emergency_turns_on_the_spot_to_its_end() -> None:
    behavior = behavior_of("emergency_quadrants")
    context = scene(waypoint=(3.0, 2.0), ahead=0.6)
    assert context.quadrant_distances is not None and context.quadrant_distances.floor < 0.2
    proposal = behavior.propose(context)
    assert proposal.applicability == 1.0
    assert np.all(proposal.prohibition[context.commands.v > 0.0] == 1.0)
    twist = desired_twist(context, proposal)
    assert (twist.v, twist.w > 0.5) == (0.0, True), "to the side of the waypoint"
    angle = 0.0
    while behavior.propose(context).applicability:
        angle += 0.1
        # there is no percept while turning: the last one ages
        context = moved(context, turn=0.1, seconds=0.2)
        assert angle < 2.0
    assert 0.8 < angle < 1.2
    assert behavior_of("emergency_quadrants").propose(scene()).applicability == 0.0


def test_the_view_moves_on_while_no_percept_is_recent() -> None:
    context, behavior = scene(), behavior_of("look_again")
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
    context = scene(waypoint=(2.0, 1.5 * sign), ahead=0.9)
    context = replace(context, time=context.time + 1.0)
    behavior = behavior_of("look_again")
    twist = twist_of(behavior, context)
    assert twist.v == pytest.approx(0.0, abs=0.02)
    assert twist.w * sign > 0.3
    onward = moved(context, turn=sign * 0.8, seconds=1.0)
    proposal = behavior.propose(onward)
    twist = desired_twist(onward, proposal)
    assert twist.v > 0.1
    assert twist.w == pytest.approx(0.0, abs=0.05)
    forward, turning = onward.commands.forward_rows, np.abs(onward.commands.relative_w) > 0.15
    assert (proposal.prohibition[forward, turning] == 1.0).all()
    assert not proposal.prohibition[:, ~turning].any()


def test_what_was_near_and_left_the_view_is_not_turned_into_until_it_is_passed() -> None:
    behavior = behavior_of("avoid_quadrants")
    context, gone = scene(left=0.5), percept_of()
    behavior.propose(context)
    commands = context.commands

    def into(ahead: float, angle: float = 0.0) -> bool:
        pose = context.pose.compose(Pose(ahead, 0.0, angle))
        percept = replace(gone, time=context.time)
        layer = behavior.propose(replace(context, pose=pose, percept=percept)).prohibition
        assert not layer[:, commands.relative_w < 0.1].any(), "straight on, and away from it"
        assert not layer[commands.v <= 0.0].any(), "on the spot"
        return bool((layer[commands.forward_rows, commands.relative_w > 0.2] > 0.5).all())

    assert into(0.2)
    assert into(0.4)
    assert not into(0.6)
    behavior.propose(context)
    assert not into(0.1, angle=1.2), "it is in view again"


def test_a_wall_that_has_left_the_view_is_not_circled() -> None:
    behavior = behavior_of("follow_wall_quadrants")
    context = replace(scene(0.2, left=0.5), idle=12.0)
    assert behavior.propose(context).applicability > 0.5
    context = replace(context, percept=replace(percept_of(), time=context.time))
    angle = 0.0
    while behavior.propose(context).applicability > 0.0:
        angle += 0.2
        context = moved(context, turn=0.2, seconds=0.0)
        assert angle < 3.0
    assert angle > 1.0


# --- keep clear: what has left the view bars the ways into it until it is passed ------------------


def barred(context: Context, proposal: Proposal, turn: float) -> bool:
    """Whether all forward commands with about this turn [of the top rate] are prohibited."""
    columns = np.abs(context.commands.relative_w - turn) < 0.06
    layer = proposal.prohibition[context.commands.forward_rows][:, columns]
    return bool((layer > 0.5).all())


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_does_not_drive_into_what_it_has_turned_to(side: float) -> None:
    behavior = behavior_of("keep_clear")
    context = scene(**{"left" if side > 0.0 else "right": 0.33})
    passing = behavior.propose(context)
    assert passing.applicability == 0.0
    assert not barred(context, passing, 0.0), "past it"
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
    behavior, context = behavior_of("keep_clear"), scene(left=0.33)
    behavior.propose(context)
    context = moved(context, ahead=0.4, turn=1.2)
    way = math.copysign(1.0, twist_of(behavior, context).w)
    angle = 0.0
    while twist_of(behavior, context).v < 0.1:
        context = moved(context, turn=0.1 * way)
        angle += 0.1
        assert angle < 4.0
    for ahead, applicability in ((0.1, 1.0), (0.3, 0.0)):
        context = moved(context, ahead=ahead)
        assert behavior.propose(context).applicability == applicability


def test_what_is_passed_or_old_is_forgotten() -> None:
    behavior = behavior_of("keep_clear")
    context = scene(0.2, ahead=0.75)
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
    context = scene(0.1, ahead=distance)
    behavior.propose(context)
    later = moved(context)
    behavior.propose(replace(later, percept=replace(percept_of(), time=later.time)))
    ahead = moved(later, ahead=distance - 0.1 - 0.35)
    assert barred(ahead, behavior.propose(ahead), 0.0) is not denied
