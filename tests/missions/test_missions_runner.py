"""The mission loop with fakes: every outcome, the hash of the commands; metrics of known runs."""

import dataclasses
import math
import os
import signal
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scripted_run import FakeSimulator, Posts, ScriptedPilot

from navfw.errors import MapError
from navfw.guard import PluginCallError
from navfw.missions import MissionLoop
from navfw.missions.outcome import Cause, Outcome
from navfw.missions.run_metrics import RunMetrics, first_contacts, measure, shortest_with_room
from navfw.missions.runner import Task
from navfw.recording.run_observers import Contact, RunLog, RunLogger
from navfw.robot import RobotModel
from navfw.signals import Pose, SensorReading, Sight, Twist, Waypoint
from navfw.sim import SceneGeometry, WorldSpec
from navfw.sim.worldspec import BoxSpec

ROBOT = RobotModel()
START = Pose(0.0, 0.0, 0.0)
TURN, AHEAD, BACK = ([Twist(v, w)] for v, w in ((0.0, 0.5), (0.3, 0.0), (-0.3, 0.0)))
TO_GOAL = TURN * 30 + AHEAD * 390


def goal(x: float, y: float, name: str = "there") -> Waypoint:
    return Waypoint(x, y, tolerance=0.3, place=name, kind="goal", final=True)


def drive(
    pilot: ScriptedPilot,
    *goals: Waypoint,
    posts: Posts | None = None,
    **limits: Any,
) -> MissionLoop:
    task = Task(ROBOT, START, goals or (goal(2.0, 0.5),), **{"timeout": 60.0, **limits})
    return MissionLoop(task, pilot, FakeSimulator(START, posts=posts)).run()


def test_a_good_run_is_reached_in_the_success_zone() -> None:
    run = drive(ScriptedPilot(TO_GOAL))
    assert run.verdict.outcome is Outcome.REACHED
    x, y, _ = run.log.true[-1]
    assert math.hypot(x - 2.0, y - 0.5) <= 0.5
    assert run.verdict.behavior == "script"
    assert run.log.ticks == run.verdict.tick
    assert run.sim_time == pytest.approx(run.log.ticks / ROBOT.control_rate)


def test_a_contact_ends_the_run_at_once() -> None:
    run = drive(ScriptedPilot(TO_GOAL), posts={"column": (1.0, 0.2)})
    assert run.verdict.outcome is Outcome.COLLIDED
    assert "column" in run.verdict.reason
    (contact,) = run.log.contacts
    assert math.hypot(contact.x - 1.0, contact.y - 0.2) == pytest.approx(0.28, abs=0.01)


def test_a_stack_with_a_wrong_estimate_is_lost_with_the_distance() -> None:
    run = drive(ScriptedPilot(TURN * 30 + TO_GOAL))
    assert run.verdict.outcome is Outcome.LOST
    x, y, _ = run.log.true[-1]
    assert f"{math.hypot(x - 2.0, y - 0.5):.2f} m" in run.verdict.reason


def test_goals_count_only_in_order_and_when_truly_visited() -> None:
    goals = goal(2.0, 0.0, "there"), goal(0.0, 0.0, "back")
    assert drive(ScriptedPilot(AHEAD * 390 + BACK * 390), *goals).verdict.outcome is Outcome.REACHED
    skipped = drive(ScriptedPilot([]), *goals).verdict
    assert skipped.outcome is Outcome.LOST
    assert "'there'" in skipped.reason
    assert "2.00 m" in skipped.reason


@pytest.mark.parametrize(
    ("stuck", "unsure", "limits", "reason"),
    [
        ("walls all round", False, {}, "walls all round"),
        ("perhaps at lab", True, {}, "perhaps at lab"),
        (None, True, {"stuck_after": 3.0}, "stayed within"),
        (None, True, {"timeout": 2.0}, "time limit"),
    ],
)
def test_a_stack_may_report_that_it_is_stuck_or_unsure(
    stuck: str | None, unsure: bool, limits: dict[str, Any], reason: str
) -> None:
    verdict = drive(ScriptedPilot([], stuck, unsure=unsure), **limits).verdict
    assert verdict.outcome is (Outcome.UNSURE if unsure else Outcome.STUCK)
    assert verdict.reason.startswith(reason)


class BlindPilot(ScriptedPilot):
    """Its camera shows nothing of the path ahead."""

    def step(self, reading: SensorReading) -> Twist:
        twist = super().step(reading)
        self.state = dataclasses.replace(self.state, sight=Sight.NOTHING, veto="no room")
        return twist


@pytest.mark.parametrize(
    ("twist", "outcome", "seconds", "reason"),
    [
        (Twist(0.1, 0.0), Outcome.TIMEOUT, 6.0, "time limit"),
        (Twist(0.0, 0.3), Outcome.STUCK, 5.0, "stayed within"),
    ],
)
def test_a_run_without_progress_ends_in_time_and_tells_what_the_camera_does_not_show(
    twist: Twist, outcome: Outcome, seconds: float, reason: str
) -> None:
    for pilot, seen in ((ScriptedPilot, ""), (BlindPilot, f"; {Sight.NOTHING.trouble}")):
        run = drive(pilot([twist] * 10_000), timeout=6.0, stuck_after=5.0)
        assert run.verdict.outcome is outcome
        assert run.sim_time == pytest.approx(seconds, abs=0.05)
        assert run.verdict.reason.startswith(reason)
        assert run.verdict.reason.endswith(seen)
        held = outcome is Outcome.STUCK and pilot is BlindPilot
        assert ("; held by the safety monitor: no room" in run.verdict.reason) == held


class BrokenPilot(ScriptedPilot):
    """Works until tick 5, then raises or returns what it was given."""

    def __init__(self, breakage: BaseException | Twist) -> None:
        super().__init__([Twist(0.2, 0.0)] * 5)
        self.breakage = breakage

    def step(self, reading: SensorReading) -> Twist:
        if self._script:
            return super().step(reading)
        if isinstance(self.breakage, BaseException):
            raise self.breakage
        return self.breakage


@pytest.mark.parametrize(
    ("breakage", "fault", "reason"),
    [
        (ValueError("bad cell"), Cause.EXCEPTION, "ValueError: bad cell"),
        (MapError("no way left"), Cause.EXCEPTION, "no way left"),
        (PluginCallError("planner mine: gone"), Cause.PLUGIN_FAILED, "planner mine: gone"),
        (Twist(math.nan, 0.0), Cause.BAD_COMMAND, "v = nan"),
        (KeyboardInterrupt(), None, "by the user"),
    ],
)
def test_an_exception_or_bad_command_ends_the_run_with_a_result(
    breakage: BaseException | Twist, fault: Cause | None, reason: str
) -> None:
    run = drive(BrokenPilot(breakage))
    assert run.verdict.outcome is (Outcome.CANCELLED if fault is None else Outcome.FAULT)
    assert run.verdict.fault is fault
    assert reason in run.verdict.reason
    assert run.log.ticks == 5
    assert ("Traceback" in run.verdict.trace) == (fault is Cause.EXCEPTION)


def test_an_error_in_place_of_an_interruption_cancels_the_run() -> None:
    class Disguising(BrokenPilot):
        def step(self, reading: SensorReading) -> Twist:
            try:
                os.kill(os.getpid(), signal.SIGTERM)
            except KeyboardInterrupt:
                raise SystemError("returned a result with an exception set") from None
            return super().step(reading)

    assert drive(Disguising(Twist(0.0, 0.0))).verdict.outcome is Outcome.CANCELLED


def test_a_mission_that_the_stack_refuses_is_an_input_error() -> None:
    class Refuser(ScriptedPilot):
        def start(self, pose: Pose | None, goals: Sequence[Waypoint]) -> None:
            raise MapError("no way to the goal")

    with pytest.raises(MapError, match="no way to the goal"):
        drive(Refuser([]))


@settings(deadline=None, max_examples=20)
@given(
    twists=st.lists(
        st.builds(Twist, st.floats(-0.1, 0.5), st.floats(-1.0, 1.0)), min_size=1, max_size=40
    ),
    changed=st.integers(0, 39),
)
def test_the_hash_distinguishes_command_streams(twists: list[Twist], changed: int) -> None:
    def hash_of(script: list[Twist]) -> str:
        return drive(ScriptedPilot(script)).log.command_hash

    assert hash_of(twists) == hash_of(list(twists))
    other = list(twists)
    spot = changed % len(other)
    other[spot] = Twist(math.nextafter(other[spot].v, 9.0), other[spot].w)
    assert hash_of(other) != hash_of(twists)


RADIUS = 0.18
OPEN = WorldSpec(name="open", x=(-9.0, 9.0), y=(-9.0, 9.0))
WALLED = OPEN.model_copy(
    update={"boxes": (BoxSpec(name="wall", at=(0.0, 0.6), size=(19.0, 0.2, 1.0)),)}
)
"""A wall begins at y = 0.5."""


def straight(length: float, seconds: float, drift: float = 0.0) -> RunLog:
    """Along x, with an estimate that ends ``drift`` [m] aside."""
    recorder = RunLogger()
    for share in np.linspace(0.0, 1.0, round(60 * seconds) + 1).tolist():
        true = Pose(length * share, 0.0, 0.0)
        estimate = Pose(true.x, drift * share, 0.0)
        recorder.add(seconds * share, true, estimate, Twist(0.1, 0.0), "go", False)
    return recorder.log()


def metrics(
    log: RunLog, shortest: float = 2.0, succeeded: bool = True, world: WorldSpec = WALLED
) -> RunMetrics:
    return measure(
        log,
        SceneGeometry.from_world(world),
        start=(0.0, 0.0),
        goal=(3.0, 0.4),
        within=0.5,
        shortest=shortest,
        with_room=shortest + 0.1,
        discs=((0.0, 0.0, RADIUS),),
        succeeded=succeeded,
        stage_ms={"flow": 1.0},
    )


def test_a_straight_run_has_the_measured_lengths() -> None:
    found = metrics(straight(3.0, 10.0, drift=0.2))
    assert found.path_length_m == pytest.approx(3.0)
    assert found.spl == pytest.approx(2.0 / 3.0)
    assert found.mean_speed_m_s == pytest.approx(0.3)
    assert found.min_clearance_m == pytest.approx(0.5 - RADIUS)
    assert found.clearance_p05_m == pytest.approx(0.5 - RADIUS)
    assert found.distance_to_goal_m == pytest.approx(0.4)
    assert found.estimate_error_m == pytest.approx(0.2)
    assert found.estimate_error_max_m == pytest.approx(0.2)
    assert (found.collisions, found.emergencies) == (0, 0)


def test_the_shares_of_time_below_the_top_speed_are_largest_first() -> None:
    recorder, pose = RunLogger(), Pose(0.0, 0.0, 0.0)
    for tick, why in enumerate(["", "", "", "", "", "", "late", "rule", "rule", "rule"]):
        recorder.add(0.1 * tick, pose, pose, Twist(0.1, 0.0), "go", False, slower=why)
    assert list(metrics(recorder.log()).why_slower.items()) == [("rule", 0.3), ("late", 0.1)]
    assert metrics(RunLogger().log(), succeeded=False).why_slower == {}


def test_the_shortest_path_with_room_keeps_off_corners_where_it_can() -> None:
    box = BoxSpec(name="box", at=(0.0, 0.0), size=(1.0, 1.0, 1.0))
    world = WorldSpec(name="w", x=(-9.0, 9.0), y=(-9.0, 9.0), boxes=(box,))
    plan, ends = SceneGeometry.from_world(world), ((-2.0, 0.0), (2.0, 0.0))
    roomy = shortest_with_room(plan, (*ends, ends[0]), RADIUS)
    assert roomy == pytest.approx(2.0 * plan.shortest_path(*ends, RADIUS + 0.15)[0])
    # beside a wall there is none: the shortest counts
    beside = ((-2.0, 0.5 + RADIUS + 0.05), (2.0, 0.5 + RADIUS + 0.05))
    assert shortest_with_room(plan, beside, RADIUS) >= 4.0


def test_the_traversal_lasts_from_the_first_decimetre_to_the_goal_s_neighbourhood() -> None:
    # 0.3 m/s along x; the goal (3, 0.4) comes within 0.5 m at x = 2.7
    assert metrics(straight(3.0, 10.0)).traversal_s == pytest.approx((2.7 - 0.1) / 0.3, abs=0.02)
    # without arrival to the end; a robot that did not set out has none
    assert metrics(straight(2.0, 10.0)).traversal_s == pytest.approx(9.5, abs=0.02)
    assert metrics(straight(0.05, 10.0)).traversal_s == 0.0


def test_metrics_of_failures_short_cuts_open_worlds_and_runs_without_ticks() -> None:
    assert metrics(straight(3.0, 10.0), succeeded=False).spl == 0.0
    # the success zone extends around the goal: a driven path may be shorter than the shortest one
    assert metrics(straight(1.6, 10.0), shortest=2.0).spl == 1.0
    found = metrics(RunLogger().log(), succeeded=False)
    assert (found.path_length_m, found.mean_speed_m_s, found.spl) == (0.0, 0.0, 0.0)
    assert (found.estimate_error_p50_m, found.localized_after_s, found.lost_s) == (None, None, 0.0)
    assert found.distance_to_goal_m == pytest.approx(math.hypot(3.0, 0.4))
    found = metrics(straight(1.0, 2.0), world=OPEN)
    assert (found.min_clearance_m, found.clearance_p05_m) == (math.inf, math.inf)


def test_each_emergency_counts_once() -> None:
    recorder = RunLogger()
    pose = Pose(0.0, 0.0, 0.0)
    for tick, urgent in enumerate("..!!!..!...!!"):
        recorder.add(tick / 60, pose, pose, Twist(0.0, 0.0), "", urgent == "!")
    assert metrics(recorder.log()).emergencies == 3


@given(st.lists(st.floats(0.0, 100.0), max_size=30), st.randoms())
def test_collisions_are_debounced_in_any_order(times: list[float], random: object) -> None:
    contacts = [Contact(time, 0.0, 0.0, "wall") for time in times]
    count = len(first_contacts(contacts))
    assert len(first_contacts(contacts[::-1])) == count
    assert (count > 0) == bool(times)
    assert count <= 101
    # contacts far apart in time all count
    apart = [Contact(2.0 * i, 0.0, 0.0, "wall") for i in range(len(times))]
    assert first_contacts(apart) == apart
