"""The shipped behaviours keep their contract and propose what their names say."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from behavior_samples import ROBOT, behavior_of, composite_of, desired_twist, scene, twist_of
from hypothesis import given
from hypothesis import strategies as st

from navfw.context import CommandGrid, Context
from navfw.interfaces import Behavior
from navfw.localmap import LocalGoal
from navfw.movers import ConflictPredictor
from navfw.movers.conflict_prediction import ConflictParams
from navfw.movers.tracking import Track
from navfw.signals import Odometry, Pose, Proposal, Twist, Waypoint
from navfw.testing import check_behavior, contexts_of
from navfw.testing.behavior_scenes import BehaviorScene, wall_flow

SHIPPED = """
    avoid centre_corridor emergency escape follow_wall give_way go_to_xy peek traverse_door
"""


@pytest.mark.parametrize("name", SHIPPED.split())
def test_keeps_the_contract(name: str) -> None:
    check_behavior(type(behavior_of(name)))


def propose(name: str, v: float = 0.3, **scene: Any) -> tuple[Context, Proposal]:
    """The context and the behaviour's proposal at the end of a drive straight on [m/s]."""
    behavior = behavior_of(name)
    drive = contexts_of(BehaviorScene("drive", Twist(v, 0.0), **scene))
    return [(context, behavior.propose(context)) for context in drive][-1]


@pytest.mark.parametrize(
    ("waypoint", "sign"), [((1.0, 2.0), 1.0), ((1.0, -2.0), -1.0), ((-2.0, 0.3), 1.0)]
)
def test_go_to_xy_turns_toward_the_waypoint(waypoint: tuple[float, float], sign: float) -> None:
    twist = desired_twist(*propose("go_to_xy", 0.1, waypoint=waypoint, ticks=2))
    assert twist.w * sign > 0.15


def test_go_to_xy_drives_fast_straight_on_and_slowly_at_the_goal() -> None:
    far = desired_twist(*propose("go_to_xy", waypoint=(4.0, 0.0), ticks=25))
    near = desired_twist(*propose("go_to_xy", 0.1, waypoint=(0.25, 0.0)))
    assert far.v > 0.3
    assert near.v < 0.6 * far.v
    assert abs(far.w) < 0.05
    assert propose("go_to_xy", 0.1, waypoint=None)[1].applicability == 0.0


def test_avoid_prohibits_commands_that_cannot_stop_before_the_wall() -> None:
    context, proposal = propose("avoid", 0.2, ahead=0.75, ticks=14)
    straight = context.commands.w.size // 2
    assert context.ranges.front < 0.4
    assert proposal.prohibition[-1, straight] > 0.5
    standing = int(np.flatnonzero(context.commands.v == 0.0)[0])
    assert np.all(proposal.prohibition[standing] < 0.5)  # turning on the spot is always allowed
    rules = proposal.explain(len(context.commands.v) - 1, straight)
    assert rules and "prohibit IS yes" in rules[0]["rule"]


def test_avoid_prohibits_turns_without_room_to_stop_them() -> None:
    context = scene(0.0, ticks=14)
    turn = np.where(context.commands.w > 0.0, 0.1, math.inf)  # something is to the left
    beside = replace(context, arcs=replace(context.arcs, turn=turn))
    standing = int(np.flatnonzero(context.commands.v == 0.0)[0])
    prohibited = behavior_of("avoid").propose(beside).prohibition[standing]
    assert np.all(prohibited[context.commands.w <= 0.0] < 0.5)
    assert prohibited[-1] > 0.5
    assert prohibited[np.searchsorted(context.commands.w, 0.15)] < 0.5, "a slow turn can be stopped"


def test_avoid_allows_observed_open_floor_and_discourages_speed_into_unobserved_space() -> None:
    context, proposal = propose("avoid", ticks=14)
    straight = context.commands.w.size // 2
    assert proposal.prohibition[-1, straight] < 0.5
    context, proposal = propose("avoid", 0.0, perceives=False, ticks=2)
    slow = int(np.searchsorted(context.commands.v, 0.05))
    assert proposal.prohibition[-1, straight] > 1.5 * proposal.prohibition[slow, straight]


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_follow_wall_keeps_its_distance(side: str, sign: float) -> None:
    near, far = (
        desired_twist(*propose("follow_wall", 0.2, ticks=16, **{side: distance})).w * sign
        for distance in (0.32, 0.8)
    )
    assert near < -0.05
    assert far > 0.05


def test_travel_follows_walls_only_without_progress() -> None:
    travel, context = composite_of("travel"), scene(0.2, left=0.5, ticks=10)
    moving = travel.weigh(context)
    assert moving["follow_wall"] == 0.0
    assert moving["go_to_xy"] == 1.0
    barred = LocalGoal(0.8, 0.0, np.inf, False, np.inf)
    caught = travel.weigh(replace(context, idle=20.0, local_goal=barred))
    assert caught["follow_wall"] == 1.0
    assert caught["go_to_xy"] < 0.5


def test_travel_centres_in_corridors_and_not_in_doors() -> None:
    travel, corridor = composite_of("travel"), scene(left=0.7, right=0.7, ticks=20)
    assert travel.weigh(corridor)["centre_corridor"] > 0.9
    assert travel.weigh(scene())["centre_corridor"] == 0.0
    door = Waypoint(0.9, 0.0, 0.25, "door", "door", final=False, width=0.9)
    at_door = travel.weigh(replace(corridor, waypoint=door))
    assert at_door["centre_corridor"] == 0.0
    assert at_door["traverse_door"] == 1.0


@pytest.mark.parametrize(("nearer", "sign"), [("left", -1.0), ("right", 1.0)])
def test_centre_corridor_turns_away_from_the_nearer_wall(nearer: str, sign: float) -> None:
    walls = {"left": 0.7, "right": 0.7, nearer: 0.45}
    context, proposal = propose("centre_corridor", ticks=20, **walls)
    assert proposal.applicability > 0.2
    assert desired_twist(context, proposal).w * sign > 0.05


def test_traverse_door_only_at_doors_and_slowly_in_narrow_ones() -> None:
    context = scene(ticks=20)
    assert behavior_of("traverse_door").propose(context).applicability == 0.0
    door = Waypoint(context.belief.pose.x + 0.8, 0.0, 0.25, "door", "door", final=False)
    narrow, wide = (
        twist_of("traverse_door", replace(context, waypoint=replace(door, width=width))).v
        for width in (0.6, 1.2)
    )
    assert narrow < wide


def test_peek_creeps_into_unobserved_space_only() -> None:
    context, proposal = propose("peek", 0.0, perceives=False, ticks=2)
    assert proposal.applicability > 0.4
    assert 0.0 < desired_twist(context, proposal).v < 0.4 * context.commands.max_v
    context, seeing = propose("peek", ticks=20)
    assert seeing.applicability < 0.05
    unseen = replace(context.arcs, observed=np.zeros_like(context.arcs.observed))
    beside = behavior_of("peek").propose(replace(context, arcs=unseen))
    assert beside.applicability > 0.4, "the floor under the body's sides is unobserved"


def test_escape_backs_out_and_then_turns() -> None:
    escape = behavior_of("escape")
    scene = BehaviorScene("dead end", Twist(0.2, 0.0), ahead=1.0, left=0.5, right=0.5, ticks=24)
    drive = contexts_of(scene)
    for context in drive:
        assert escape.propose(context).applicability == 0.0
    standing = replace(drive[-1], twist=Twist(0.0, 0.0))
    phases = []
    for k in range(60):
        now = replace(standing, time=standing.time + 0.1 * k)
        proposal = escape.propose(now)
        if proposal.applicability == 0.0:
            continue
        assert np.all(proposal.prohibition[now.commands.v > 0.0] == 1.0)
        phases.append(desired_twist(now, proposal).v < 0.0)
        if phases[-1] and len(phases) > 5:  # it has backed out by now
            pose = standing.pose
            standing = replace(standing, pose=Pose(pose.x - 0.3, pose.y, pose.yaw))
    assert phases[0], "it backs out first, along the trail"
    assert not phases[-1], "then it turns on the spot"


def test_escape_looks_again_from_farther_back_where_the_way_ahead_is_free_but_unseen() -> None:
    escape = behavior_of("escape")
    standing = replace(propose("escape", ticks=24)[0], twist=Twist(0.0, 0.0))
    for observed in (0.0, 1.0):
        arcs = replace(standing.arcs, observed=np.full_like(standing.arcs.free, observed))
        assert standing.arcs.free[-1, standing.commands.w.size // 2] > 0.3
        escape.reset()
        applies: list[float] = []
        for k in range(60):
            pose = Pose(standing.pose.x - 0.3 * any(applies), standing.pose.y, standing.pose.yaw)
            now = replace(standing, time=standing.time + 0.1 * k, arcs=arcs, pose=pose)
            applies.append(escape.propose(now).applicability)
        first = applies.index(1.0)
        assert (applies[first + 5] == 0.0) is (observed == 0.0), "else it turns as well"


def test_emergency_stops_before_near_walls_and_if_wheels_do_not_turn_and_else_not_at_all() -> None:
    context, proposal = propose("emergency", ticks=10)
    assert proposal.applicability == 0.0
    assert not proposal.prohibition.any()
    assert context.stalled == 0.0
    context, proposal = propose("emergency", moves=False, ticks=30)
    assert proposal.applicability == 1.0
    assert np.all(proposal.prohibition[context.commands.v > 0.0] == 1.0)
    assert desired_twist(context, proposal).v <= 0.0
    assert propose("emergency", 0.5, ahead=0.95, ticks=12)[1].applicability == 1.0


def with_conflicts(context: Context, *tracks: Track, twist: Twist) -> Context:
    """``context`` of a robot that drives ``twist`` among moving obstacles with these ``tracks``."""
    odometry = Odometry(0.0, context.pose, twist, 0.0, still=False)
    predictor = ConflictPredictor(ROBOT, ConflictParams(uncertainty=0.0))
    conflicts = predictor.predict(tracks, odometry, context.commands.v, context.commands.w)
    return replace(context, conflicts=conflicts, twist=twist)


def person(context: Context, x: float, y: float, vx: float, vy: float) -> Track:
    """A person at (x, y) in base_link with (vx, vy) in odom; scenes face along odom's x."""
    place = context.pose.to_parent(x, y)
    return Track(np.array([*place, vx, vy]), 0.01 * np.eye(4), 0.25, 0.0, 5)


COMMANDS = CommandGrid(ROBOT)


def give_way_proposal(*tracks: tuple[float, float, float, float], v: float) -> Proposal:
    context = scene()
    people = [person(context, *track) for track in tracks]
    return behavior_of("give_way").propose(with_conflicts(context, *people, twist=Twist(v, 0.0)))


def test_give_way_waits_for_a_crossing_obstacle_and_does_not_apply_without_any() -> None:
    nobody = give_way_proposal(v=0.4)
    assert nobody.applicability == 0.0
    assert not nobody.prohibition.any()
    proposal = give_way_proposal((0.9, -0.9, 0.0, 0.45), v=0.45)
    ahead, waiting = COMMANDS.nearest(Twist(0.5, 0.0)), COMMANDS.nearest(Twist(0.0, 0.0))
    assert proposal.applicability > 0.5
    assert proposal.prohibition[ahead] > 0.5 > proposal.prohibition[waiting]
    assert proposal.desirability[waiting] > proposal.desirability[ahead]
    assert any("touching" in rule["rule"] for rule in proposal.explain(*ahead))


def test_give_way_leaves_the_way_of_an_approaching_obstacle() -> None:
    # toward the robot's left half; it passes a robot that moves aside
    proposal = give_way_proposal((1.0, 0.25, -0.5, 0.0), v=0.0)
    best = np.unravel_index(int(proposal.desirability.argmax()), COMMANDS.shape)
    assert proposal.prohibition[COMMANDS.nearest(Twist(0.0, 0.0))] > 0.5
    assert COMMANDS.v[best[0]] != 0.0


def test_give_way_does_not_drive_toward_a_close_obstacle() -> None:
    # it stands beside the way and would be touched by a robot that drives on
    proposal = give_way_proposal((0.6, 0.1, 0.0, 0.0), v=0.2)
    toward = COMMANDS.nearest(Twist(0.2, 0.0))
    assert proposal.prohibition[toward] > 0.8
    assert any("approach" in rule["rule"] for rule in proposal.explain(*toward))
    for allowed in (Twist(0.0, 0.8), Twist(-0.15, 0.0)):
        assert proposal.prohibition[COMMANDS.nearest(allowed)] < 0.5


def test_give_way_allows_the_least_bad_command() -> None:
    around = [(0.6, 0.0, -0.4, 0.0), (-0.6, 0.0, 0.4, 0.0), (0.0, 0.6, 0.0, -0.4)]
    proposal = give_way_proposal(*around, (0.0, -0.6, 0.0, 0.4), v=0.0)
    assert proposal.prohibition.min() < 0.5


def test_give_way_backs_away_only_from_what_is_close() -> None:
    # it passes ahead of the robot; what is behind is not seen
    back, standing = COMMANDS.nearest(Twist(-0.15, 0.0)), COMMANDS.nearest(Twist(0.0, 0.0))
    passing = give_way_proposal((1.0, -0.8, 0.0, 0.4), v=0.3).desirability
    assert passing[back] < 0.3 < passing[standing]
    close = give_way_proposal((0.55, 0.0, -0.1, 0.0), v=0.0).desirability
    assert close[back] > 0.3


def test_give_way_escapes_where_there_is_room() -> None:
    # an obstacle approaches; where a wall is ahead, driving on is no escape to compare others with
    context = scene()
    free = with_conflicts(context, person(context, 0.9, 0.5, -0.4, -0.2), twist=Twist(0.3, 0.0))
    walled = replace(free, arcs=replace(free.arcs, free=0.0 * free.arcs.free))
    prohibited = [behavior_of("give_way").propose(one).prohibition > 0.5 for one in (free, walled)]
    assert prohibited[0][COMMANDS.v <= 0.0].sum() > prohibited[1][COMMANDS.v <= 0.0].sum()


# --- behaviours that use the flow alone -----------------------------------------------------------


OPEN = scene(waypoint=(9.0, 0.0), ticks=3)


def at(seconds: float, pose: Pose) -> Context:
    """The open so many seconds later at another pose."""
    belief = replace(OPEN.belief, pose=pose)
    return replace(OPEN, time=OPEN.time + seconds, pose=pose, belief=belief)


def with_walls(ahead: float = 20.0, left: float = 20.0, right: float = 20.0) -> Context:
    return replace(OPEN, flow=wall_flow(ROBOT, OPEN.time, ahead, left, right))


@given(st.floats(0.3, 1.2), st.floats(0.3, 1.2))
def test_balance_turns_away_from_the_nearer_wall_and_mirrors(left: float, right: float) -> None:
    behavior = behavior_of("balance")
    turn = twist_of(behavior, with_walls(left=left, right=right)).w
    mirrored = twist_of(behavior, with_walls(left=right, right=left)).w
    assert mirrored == pytest.approx(-turn, abs=0.03)
    if abs(left - right) > 0.3:
        assert turn * (left - right) > 0.0


def test_balance_is_drawn_to_the_goal_and_slower_in_turns() -> None:
    behavior = behavior_of("balance")
    straight = twist_of(behavior, OPEN)
    assert abs(straight.w) < 0.03
    assert straight.v == pytest.approx(0.3, abs=0.03)
    aside = replace(with_walls(), belief=replace(OPEN.belief, pose=Pose(0.0, 0.0, -1.0)))
    turning = twist_of(behavior, aside)
    assert turning.w > 0.3
    assert turning.v < straight.v


def test_balance_needs_fresh_flow_of_both_sides() -> None:
    behavior = behavior_of("balance")
    context = with_walls(left=0.4)
    assert twist_of(behavior, context).w < -0.3
    assert context.flow is not None
    half = context.flow.confidence * (context.flow.points[..., 0] < 0.0)
    half_blind = replace(context, flow=replace(context.flow, confidence=half))
    old = replace(context, time=context.time + 2.0)
    for unusable in (half_blind, old, replace(context, flow=None)):
        assert abs(twist_of(behavior, unusable).w) < 0.05


def drive_toward(
    distance: float, frames: int = 3, behavior: Behavior | None = None
) -> tuple[Context, Proposal]:
    """The divergence behaviour before a wall, after so many frames of it."""
    behavior = behavior or behavior_of("divergence")
    for k in range(frames):
        time = OPEN.time + 0.1 * k
        flow = wall_flow(ROBOT, time, distance - 0.03 * k, 20.0, 0.9)
        context = replace(OPEN, time=time, flow=flow)
        proposal = behavior.propose(context)
    return context, proposal


def test_divergence_drives_on_while_contact_is_far_and_turns_before_it() -> None:
    twist = desired_twist(*drive_toward(3.0))
    assert twist.v > 0.25
    assert abs(twist.w) < 0.05
    context, proposal = drive_toward(0.7)
    twist = desired_twist(context, proposal)
    assert abs(twist.v) < 0.02
    assert twist.w > 0.7, "to the left: the flow is larger on the right"
    assert "saccade" in proposal.reason
    assert desired_twist(*drive_toward(0.7, frames=1)).v > 0.25, "one frame is not enough"


def test_divergence_measures_the_time_to_contact() -> None:
    # 6 cm between frames 0.2 s apart are 0.3 m/s; the camera is 0.1 m ahead of the axle
    _, proposal = drive_toward(2.0, frames=1)
    seconds = float(proposal.reason.split()[2])
    assert seconds == pytest.approx((2.0 - 0.1) / 0.3, rel=0.1)


def test_after_a_saccade_it_drives_straight_on_for_a_while() -> None:
    behavior = behavior_of("divergence")
    drive_toward(0.7, 2, behavior)
    pose = Pose(OPEN.pose.x, OPEN.pose.y, OPEN.pose.yaw + 1.0)
    twist = twist_of(behavior, at(1.5, pose))
    assert twist.v > 0.25
    assert abs(twist.w) < 0.05, "not back to the goal at once"
    later = at(4.5, pose.compose(Pose(0.9, 0.0, 0.0)))
    assert twist_of(behavior, later).w < -0.3, "then to the goal again"


@pytest.mark.parametrize("name", ["balance", "divergence"])
def test_they_do_not_apply_without_a_waypoint(name: str) -> None:
    assert behavior_of(name).propose(replace(OPEN, waypoint=None)).applicability == 0.0
