"""Behaviours that use the flow alone: balance, and saccades by the divergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import behavior_of, desired_twist
from hypothesis import given
from hypothesis import strategies as st

from navfw.context import Context
from navfw.interfaces import Behavior
from navfw.robot import RobotModel
from navfw.signals import Pose, Proposal, Twist
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene, wall_flow

ROBOT = RobotModel()
OPEN = contexts_of(BehaviorScene("open", Twist(0.3, 0.0), waypoint=(9.0, 0.0), ticks=3))[-1]


def with_walls(ahead: float = 20.0, left: float = 20.0, right: float = 20.0) -> Context:
    return replace(OPEN, flow=wall_flow(ROBOT, OPEN.time, ahead, left, right))


@given(st.floats(0.3, 1.2), st.floats(0.3, 1.2))
def test_balance_turns_away_from_the_nearer_wall_and_mirrors(left: float, right: float) -> None:
    behavior = behavior_of("balance")
    context = with_walls(left=left, right=right)
    here = desired_twist(context, behavior.propose(context)).w
    mirrored = with_walls(left=right, right=left)
    assert desired_twist(mirrored, behavior.propose(mirrored)).w == pytest.approx(-here, abs=0.03)
    if abs(left - right) > 0.3:
        assert here * (left - right) > 0.0


def test_balance_is_drawn_to_the_goal_and_slower_in_turns() -> None:
    behavior = behavior_of("balance")
    straight = desired_twist(OPEN, behavior.propose(OPEN))
    assert abs(straight.w) < 0.03
    assert straight.v == pytest.approx(0.3, abs=0.03)
    aside = replace(with_walls(), belief=replace(OPEN.belief, pose=Pose(0.0, 0.0, -1.0)))
    turning = desired_twist(aside, behavior.propose(aside))
    assert turning.w > 0.3
    assert turning.v < straight.v


def test_balance_needs_fresh_flow_of_both_sides() -> None:
    behavior = behavior_of("balance")
    context = with_walls(left=0.4)
    assert desired_twist(context, behavior.propose(context)).w < -0.3
    assert context.flow is not None
    half = context.flow.confidence * (context.flow.points[..., 0] < 0.0)
    half_blind = replace(context, flow=replace(context.flow, confidence=half))
    old = replace(context, time=context.time + 2.0)
    for unusable in (half_blind, old, replace(context, flow=None)):
        assert abs(desired_twist(unusable, behavior.propose(unusable)).w) < 0.05


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
    context, proposal = drive_toward(3.0)
    twist = desired_twist(context, proposal)
    assert twist.v > 0.25
    assert abs(twist.w) < 0.05
    context, proposal = drive_toward(0.7)
    twist = desired_twist(context, proposal)
    assert abs(twist.v) < 0.02
    assert twist.w > 0.7, "to the left: the flow is larger on the right"
    assert "saccade" in proposal.reason
    context, proposal = drive_toward(0.7, frames=1)
    assert desired_twist(context, proposal).v > 0.25, "one frame is not enough"


def test_divergence_measures_the_time_to_contact() -> None:
    # 6 cm between frames 0.2 s apart are 0.3 m/s; the camera is 0.1 m ahead of the axle
    _, proposal = drive_toward(2.0, frames=1)
    seconds = float(proposal.reason.split()[2])
    assert seconds == pytest.approx((2.0 - 0.1) / 0.3, rel=0.1)


def test_after_a_saccade_it_drives_straight_on_for_a_while() -> None:
    behavior = behavior_of("divergence")
    drive_toward(0.7, 2, behavior)
    pose = Pose(OPEN.pose.x, OPEN.pose.y, OPEN.pose.yaw + 1.0)
    away = replace(OPEN, time=OPEN.time + 1.5, pose=pose)
    away = replace(away, belief=replace(OPEN.belief, pose=pose))
    twist = desired_twist(away, behavior.propose(away))
    assert twist.v > 0.25
    assert abs(twist.w) < 0.05, "not back to the goal at once"
    there = Pose(pose.x + 0.9 * np.cos(pose.yaw), pose.y + 0.9 * np.sin(pose.yaw), pose.yaw)
    later = replace(away, time=away.time + 3.0, pose=there)
    later = replace(later, belief=replace(OPEN.belief, pose=there))
    assert desired_twist(later, behavior.propose(later)).w < -0.3, "then to the goal again"


@pytest.mark.parametrize("name", ["balance", "divergence"])
def test_they_do_not_apply_without_a_waypoint(name: str) -> None:
    assert behavior_of(name).propose(replace(OPEN, waypoint=None)).applicability == 0.0
