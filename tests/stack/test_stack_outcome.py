"""What comes of the stack's decisions: giving up, the driven twist, explanations, a new start."""

from dataclasses import replace

import numpy as np
import pytest
from stack_samples import (
    GOAL,
    START,
    Ahead,
    Idle,
    Rig,
    drive,
    person_ahead,
    sample_stack,
    wall_view,
)

from navfw.safety import PersistentFailure
from navfw.signals import Belief, Encoders, Inertial, Pose, Stixels, Twist, Waypoint
from navfw.stack import StackState
from navfw.stack.stack import TIMED
from navfw.stack.stack_state import ProgressWatch

NO_ROUTE_AFTER = 20.0
STUCK_AFTER = 60.0

# --- giving up -----------------------------------------------------------------------------------


def test_the_stack_gives_up_without_a_route_for_long() -> None:
    rig = Rig()
    for time in np.arange(0.0, 3.0 + NO_ROUTE_AFTER, 0.5).tolist():
        rig.planner.reason = None if time < 3.0 else "the door is shut"
        rig.step(time)
        assert rig.stack.state.stuck is None
    rig.step(3.0 + NO_ROUTE_AFTER)
    assert rig.stack.state.stuck == "the door is shut"
    rig.stack.start(START, [GOAL])
    rig.planner.reason = "the door is shut"
    rig.step(40.0)
    assert rig.stack.state.stuck is None, "a new mission starts anew"


@pytest.mark.parametrize(
    ("lost", "reason", "stuck"),
    [
        (False, None, "no progress toward goal for 61 s"),
        (False, "the door is shut", "no progress toward goal for 61 s; the door is shut"),
        (True, None, None),
    ],
)
def test_the_stack_gives_up_without_progress_unless_it_is_lost(
    lost: bool, reason: str | None, stuck: str | None
) -> None:
    rig = Rig()
    rig.localizer.lost = lost
    for time in np.arange(0.0, STUCK_AFTER + 0.1, 1.0).tolist():
        rig.step(time)
        assert rig.stack.state.stuck is None
    rig.planner.reason = reason
    rig.step(STUCK_AFTER + 1.0)
    assert rig.stack.state.stuck == stuck


def test_a_sensor_that_has_failed_for_good_is_a_fault() -> None:
    rig = Rig()
    rig.step(0.0)
    rig.step(19.0, None)
    assert rig.stack.state.fault is None
    rig.step(21.0, None)
    assert rig.stack.state.fault == PersistentFailure("sensor", "the camera is silent, for 21 s")


# --- what comes out ------------------------------------------------------------------------------


def test_the_safety_monitor_has_the_last_word() -> None:
    rig = Rig(sample_stack(Ahead))
    simulator = drive(rig.stack, 1.0)
    driven = rig.stack.step(simulator.read())
    # nothing beside the footprint has been observed
    assert rig.stack.verdict.reason == "unobserved space ahead"
    assert driven == rig.stack.verdict.twist
    assert rig.stack.state.command is not None
    assert 0.0 < driven.v < 0.5 * rig.stack.state.command.twist.v


def test_wheels_that_are_driven_and_do_not_count_are_silent() -> None:
    rig = Rig(sample_stack(Ahead))
    # the odometer compares the encoders with the twist that was driven
    for k in range(60):
        rig.step(k / 60.0, "noise" if k % 6 == 0 else None)
    assert rig.stack.state.odometry is not None
    assert rig.stack.state.odometry.silent


def test_weak_wheels_are_trimmed() -> None:
    rig = Rig(sample_stack(Ahead))
    rig.stack.trim._shares = [0.5, 0.5]
    for k in range(6):
        rig.step(0.02 * k)
    assert rig.step(0.12).v == pytest.approx(2.0 * rig.stack.verdict.twist.v)


def test_stage_times_are_accounted_for() -> None:
    stack = sample_stack(Idle)
    drive(stack, 0.3)
    assert set(stack.timings) == set(TIMED)
    spent = {stage for stage, seconds in stack.timings.items() if seconds > 0.0}
    # flow and perception are of the scripted vision here
    assert spent == set(TIMED) - {"flow", "perception"}
    stack.start(START, [GOAL])
    assert set(stack.timings.values()) == {0.0}


def test_a_decision_can_be_explained() -> None:
    one = np.ones(1)
    stixels = Stixels(0.0, 0.1 * one, one, 0.1 * one, one)
    view = replace(wall_view(), stixels=stixels)
    (percept,) = view.percepts
    rig = Rig(sample_stack(Ahead, script=lambda frame, odometry: view))
    assert rig.stack.explain() == {}
    rig.step(0.0)
    explanation = rig.stack.explain()
    assert explanation["perception"]["sentence"] == percept.sentence
    assert explanation["perception"]["inference"] == dict(percept.explanation)
    assert explanation["stixels"] == stixels.explain()
    assert "ahead" in explanation["behaviors"]
    # the last decision is explained after the end, too
    rig.planner.waypoint = None
    rig.step(0.1)
    assert rig.stack.state.command is None
    assert rig.stack.explain() == explanation
    rig.stack.start(START, [GOAL])
    assert rig.stack.explain() == {}


def test_start_returns_every_part_to_the_start_of_a_run() -> None:
    stack = sample_stack(Ahead, script=person_ahead)
    drive(stack, 0.5)
    assert vars(stack.vision)["frames"]
    assert stack.tracker.tracks
    assert stack.local_map.occupancy.located
    assert stack.mofis.proposals
    assert stack.verdict.twist != Twist(0.0, 0.0)
    stack.trim._shares = [0.5, 0.5]
    stack.start(START, [GOAL])
    assert stack.state == StackState(time=0.0)
    assert vars(stack.vision)["frames"] == []
    assert stack.tracker.tracks == []
    assert not vars(stack.local_map.occupancy)["_origin"]
    assert stack.mofis.proposals == {}
    assert stack.mofis.context is None
    assert stack.verdict.twist == Twist(0.0, 0.0)
    assert stack.trim.shares == (1.0, 1.0)
    with pytest.raises(IndexError):
        stack.history.at(0.0)
    assert stack.odometer.update(Inertial(9.0, 0, 0, 0), Encoders(9.0, 7, 7)).pose == Pose(0, 0, 0)
    assert stack.safety.senses.camera_age == 0.0


# --- the watch for progress -----------------------------------------------------------------------

LAB = Waypoint(2.0, 1.0, 0.15, "lab", "goal", final=True)
PASSING = Waypoint(2.0, 1.0, 0.15, "hall", "room", final=False)


def belief(x: float, y: float) -> Belief:
    return Belief(0.0, Pose(x, y, 0.0), np.diag([0.49, 0.04, 0.01]), {}, 0.5)


def watched(
    place: tuple[float, float], waypoint: Waypoint | None, idle: float, no_route: str | None = None
) -> ProgressWatch:
    watch = ProgressWatch()
    for now in (0.0, NO_ROUTE_AFTER):
        watch.update(now, belief(*place), waypoint, idle, no_route)
    return watch


@pytest.mark.parametrize(
    ("place", "waypoint", "unsure"),
    [
        ((2.1, 1.05), LAB, True),
        ((2.1, 1.05), PASSING, False),
        ((2.3, 1.0), LAB, False),
        ((2.0, 1.0), None, False),
    ],
)
def test_a_goal_that_is_near_but_not_reached_leaves_the_robot_unsure(
    place: tuple[float, float], waypoint: Waypoint | None, unsure: bool
) -> None:
    watch = watched(place, waypoint, idle=0.0)
    assert watch.unsure is unsure
    assert watch.give_up_reason is None


def test_it_stays_unsure_while_it_looks_around_and_not_at_the_next_goal() -> None:
    watch = watched((2.0, 1.0), LAB, idle=0.0)
    watch.update(30.0, belief(4.0, 1.0), LAB, 30.0, None)
    assert watch.unsure
    watch.update(31.0, belief(4.0, 1.0), replace(LAB, x=9.0), 0.0, None)
    assert not watch.unsure


def test_it_gives_up_and_says_why() -> None:
    late = STUCK_AFTER + 1.0
    assert watched((0.0, 0.0), LAB, late).give_up_reason == "no progress toward lab for 61 s"
    doubt = watched((2.0, 1.0), LAB, late).give_up_reason
    assert doubt == "perhaps at lab: the position estimate has a sigma of 0.70 m"
    watch = ProgressWatch()
    for veto in ("", "unobserved space ahead", "unobserved space ahead"):
        watch.update(late, belief(0.0, 0.0), LAB, late, None, veto)
    held_by = "no progress toward lab for 61 s; held by the safety monitor: unobserved space ahead"
    assert watch.give_up_reason == held_by
    watch.update(late, belief(0.0, 0.0), LAB, late, None)
    assert watch.give_up_reason == "no progress toward lab for 61 s", "in half of the time"
    closed = "the door is closed"
    assert watched((0.0, 0.0), LAB, 0.0, closed).give_up_reason == closed
    assert watched((0.0, 0.0), None, late, closed).give_up_reason is None


@pytest.mark.parametrize(
    ("waypoint", "no_route", "x"),
    [(LAB, None, 0.0), (None, "the door is closed", 0.0), (LAB, "the door is closed", 2.0)],
)
def test_a_route_or_a_way_round_in_between_starts_the_time_without_one_anew(
    waypoint: Waypoint | None, no_route: str | None, x: float
) -> None:
    watch, closed = ProgressWatch(), "the door is closed"
    watch.update(0.0, belief(0.0, 0.0), LAB, 0.0, closed)
    watch.update(0.9 * NO_ROUTE_AFTER, belief(x, 0.0), waypoint, 0.0, no_route)
    for time, reason in ((0.91, None), (1.9, None), (1.92, closed)):
        watch.update(time * NO_ROUTE_AFTER, belief(0.0, 0.0), LAB, 0.0, closed)
        assert watch.give_up_reason == reason
