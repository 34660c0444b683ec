"""The stack's decisions once a camera frame: from which inputs, when, and when it gives up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from stack_samples import (
    GOAL,
    LINE,
    ROBOT,
    START,
    Idle,
    RecordingFeatures,
    RecordingLocalizer,
    RecordingPlanner,
    ScriptedVision,
    drive,
    sample_stack,
)

from navfw.context import Context
from navfw.offis.offis import Offis
from navfw.progress_watch import NO_ROUTE_AFTER, STUCK_AFTER
from navfw.safety import PersistentFailure
from navfw.signals import (
    Encoders,
    Frame,
    Image,
    Inertial,
    LandmarkDetection,
    MovingObject,
    Odometry,
    PassageQuery,
    Pose,
    Proposal,
    SensorReading,
    Stixels,
    Twist,
)
from navfw.stack import TIMED, Stack
from navfw.stack_state import StackState
from navfw.testing.behavior_scenes import wall_flow
from navfw.vision import View

RNG = np.random.default_rng(0)
SHAPE = (ROBOT.camera.height, ROBOT.camera.width)


class Ahead(Idle):
    """Desires to drive straight on at full speed."""

    name = "ahead"

    def propose(self, context: Context) -> Proposal:
        commands = context.commands
        return Proposal(1.0, commands.around(1.0, 0.0), commands.zeros(), "straight on")


@dataclass
class Rig:
    """A stack whose planner, localiser and landmark recogniser are records."""

    stack: Stack = field(default_factory=lambda: sample_stack(Idle))
    planner: RecordingPlanner = field(default_factory=lambda: RecordingPlanner(ROBOT))
    localizer: RecordingLocalizer = field(default_factory=lambda: RecordingLocalizer(ROBOT))
    features: RecordingFeatures = field(default_factory=lambda: RecordingFeatures(ROBOT))

    def __post_init__(self) -> None:
        self.stack.planner.plugin, self.stack.localizer.plugin = self.planner, self.localizer
        self.stack.features.plugin = self.features
        self.stack.start(START, [GOAL])

    def step(
        self,
        time: float,
        image: Image | str | None = "noise",
        *,
        frame_time: float | None = None,
        landmark_frame: Frame | None = None,
        ticks: int = 0,
    ) -> Twist:
        """One control tick at ``time`` [s] of a robot whose wheels have turned by ``ticks``."""
        frame = None
        if image is not None:
            pixels = RNG.integers(0, 256, SHAPE, np.uint8) if isinstance(image, str) else image
            frame = Frame(time if frame_time is None else frame_time, pixels)
        return self.stack.step(
            SensorReading(
                time, Inertial(time, 0, 0, 0), Encoders(time, ticks, ticks), frame, landmark_frame
            )
        )


def test_the_stages_get_what_the_frame_shows() -> None:
    flow = wall_flow(ROBOT, 0.0, 2.0, 20.0, 20.0)
    view = View(flows=(flow,), percepts=(Offis(ROBOT).perceive(flow, Twist(0.3, 0.0)),))
    rig = Rig(sample_stack(Idle, script=lambda frame, odometry: view))
    seen = LandmarkDetection(0.0, "a", 0.1, 1.0, np.eye(2))
    rig.features.detections = (seen,)
    rig.step(0.0)
    state = rig.stack.state
    assert rig.localizer.starts == [(LINE, START, state.odometry)]
    [(odometry, percept, detections)] = rig.localizer.updates
    assert (odometry, percept) == (state.odometry, view.percept)
    assert [found.identity for found in detections] == [seen.identity]
    assert rig.planner.beliefs == [state.belief]
    assert (state.waypoint, state.path) == (GOAL, (GOAL,))
    assert state.flows is view.flows
    assert state.percept is view.percept
    assert [found.identity for found in state.landmark_detections] == [seen.identity]
    assert state.command is not None
    assert state.time == 0.0
    # the next frame shows no percept: the state keeps the last, the localiser gets none
    view = View()
    rig.step(0.1)
    assert rig.stack.state.percept is state.percept
    assert rig.stack.state.flows == ()
    assert rig.localizer.updates[1][1] is None
    assert len(rig.localizer.starts) == 1, "the localiser is started once"
    assert rig.stack.state.time == 0.1


def test_without_a_frame_nothing_is_decided() -> None:
    rig = Rig()
    rig.step(0.0)
    state = rig.stack.state
    rig.step(0.05, None)
    assert rig.stack.state is state


def test_an_invalid_frame_is_not_perceived() -> None:
    rig = Rig()
    vision = rig.stack.vision
    assert isinstance(vision, ScriptedVision)
    rig.features.detections = (LandmarkDetection(0.0, "a", 0.1, 1.0, np.eye(2)),)
    rig.step(0.0)
    rig.step(0.1, np.zeros(SHAPE, np.uint8))
    assert [frame.time for frame in vision.frames] == [0.0]
    assert [frame.time for frame in rig.features.frames] == [0.0]
    assert rig.stack.state.landmark_detections == ()
    assert len(rig.localizer.updates) == 2, "the localiser goes on by odometry"


def test_a_late_frame_belongs_to_the_pose_of_its_own_time() -> None:
    poses: list[Odometry] = []

    def script(frame: Frame, odometry: Odometry) -> View:
        poses.append(odometry)
        person = MovingObject(frame.time, 0.0, 0.2, 1.0, np.zeros((2, 2)), np.zeros(2))
        return View(moving_objects=(person,))

    rig = Rig(sample_stack(Idle, script=script))
    ticks_per_metre = ROBOT.ticks_per_turn / (2.0 * math.pi * ROBOT.wheel_radius)
    for k in range(11):
        last = k == 10
        ticks = round(0.05 * k * ticks_per_metre)  # 0.5 m in 1 s
        rig.step(0.1 * k, "noise" if last else None, frame_time=0.6, ticks=ticks)
    assert poses[0].time == pytest.approx(0.6)
    assert poses[0].pose.x == pytest.approx(0.3, abs=0.002)
    assert rig.stack.state.odometry is not None
    assert rig.stack.state.odometry.pose.x == pytest.approx(0.5, abs=0.002)
    # the person stood 1 m before the camera of then
    ((x, _),) = [track.predict(0.6) for track in rig.stack.tracker.tracks]
    expected = 0.3 + ROBOT.camera.mount_forward + 1.0
    assert x == pytest.approx(expected + rig.stack.tracker.tracks[0].radius, abs=0.01)


def test_landmarks_are_recognised_in_landmark_frames_where_the_plugin_needs_them() -> None:
    class Large(RecordingFeatures):
        landmark_frames = True

    rig = Rig(features=Large(ROBOT))
    large = Frame(0.1, np.zeros((480, 640), np.uint8))
    rig.step(0.0)
    assert rig.features.frames == []
    assert rig.stack.state.landmark_detections == ()
    rig.step(0.1, landmark_frame=large)
    assert rig.features.frames == [large]


def test_detections_are_counted_by_identity() -> None:
    rig = Rig()
    a, b = (LandmarkDetection(0.0, name, 0.1, 1.0, np.eye(2)) for name in "ab")
    for time, detections in ((0.0, ()), (0.1, (a, b)), (0.2, (a,)), (0.3, ())):
        rig.features.detections = detections
        rig.step(time)
        found = rig.stack.state.landmark_detections
        assert [one.identity for one in found] == [one.identity for one in detections]
    assert rig.stack.state.detection_counts == {"a": 2, "b": 1}
    rig.stack.start(START, [GOAL])
    rig.step(10.0)
    assert rig.stack.state.detection_counts == {}


# --- when to decide -------------------------------------------------------------------------------


def test_the_robot_stands_for_the_warm_up() -> None:
    rig = Rig(sample_stack(Ahead, overrides=["warmup=0.5"]))
    for k in range(12):
        twist = rig.step(5.0 + 0.1 * k)
        # 0.5 s after the first reading
        assert (rig.stack.state.command is None) == (k < 5)
        assert (twist.v > 0.0) == (k >= 5)
        assert not rig.stack.state.finished
    assert len(rig.planner.beliefs) == 12, "the planner works from the first frame on"


def test_a_lost_robot_decides_without_a_waypoint() -> None:
    rig = Rig()
    rig.localizer.lost = True
    rig.planner.legs = (PassageQuery(("start", "goal"), (0.0, 0.0), (2.0, 0.0), 1.0),)
    rig.step(0.0)
    assert rig.planner.beliefs == []
    state = rig.stack.state
    assert (state.waypoint, state.finished) == (None, False)
    assert state.command is not None
    assert rig.stack.mofis.context is not None
    assert rig.stack.mofis.context.local_goal is None
    # no passage is checked from a pose that is not valid
    rig.localizer.lost = False
    rig.step(0.1)
    assert rig.planner.reports[0].passages == ()
    assert rig.stack.state.waypoint == GOAL


def test_after_the_last_goal_the_robot_stops() -> None:
    rig = Rig(sample_stack(Ahead))
    twist = Twist(0.0, 0.0)
    for k in range(5):
        twist = rig.step(0.1 * k)
    assert twist.v > 0.0
    rig.planner.waypoint = None
    rig.step(0.5)
    assert rig.stack.state.finished
    assert rig.stack.state.command is None
    assert rig.stack.state.path == ()
    for k in range(6, 12):
        twist = rig.step(0.1 * k)
    assert twist == Twist(0.0, 0.0)


def test_passage_reports_reach_the_planner_at_the_next_frame_once() -> None:
    rig = Rig()
    leg = PassageQuery(("start", "goal"), (0.0, 0.0), (2.0, 0.0), 1.0)
    rig.planner.legs = (leg,)
    rig.step(0.0)
    assert rig.planner.reports == []
    rig.step(0.1)
    (report,) = rig.planner.reports
    assert report.time == 0.0
    assert report.passages == ((leg, "unknown"),)
    for k in range(2, 6):  # the next check is half a second after the first
        rig.step(0.1 * k)
    assert len(rig.planner.reports) == 1
    rig.step(0.6)
    assert [r.time for r in rig.planner.reports] == [0.0, 0.5]
    # a report of the last mission is not handed on
    rig.step(1.0)
    rig.stack.start(START, [GOAL])
    rig.step(2.0)
    assert rig.planner.reports == []


# --- giving up ------------------------------------------------------------------------------------


def test_the_stack_gives_up_without_a_route_for_long() -> None:
    rig = Rig()
    for time in np.arange(0.0, 3.0, 0.5):
        rig.step(float(time))
    rig.planner.reason = "the door is shut"
    for time in np.arange(3.0, 3.0 + NO_ROUTE_AFTER, 0.5):
        rig.step(float(time))
        assert rig.stack.state.stuck is None
    rig.step(3.0 + NO_ROUTE_AFTER)
    assert rig.stack.state.stuck == "the door is shut"


@pytest.mark.parametrize("change", ["route", "waypoint"])
def test_a_route_in_between_starts_the_time_without_one_anew(change: str) -> None:
    rig = Rig()
    rig.planner.reason = "the door is shut"
    for time in np.arange(0.0, 15.0, 0.5):
        rig.step(float(time))
    if change == "route":
        rig.planner.reason = None
    else:
        rig.localizer.lost = True
    rig.step(15.0)
    rig.planner.reason, rig.localizer.lost = "the door is shut", False
    for time in np.arange(15.5, 35.0, 0.5):
        rig.step(float(time))
        assert rig.stack.state.stuck is None
    # a new mission starts anew as well
    rig.stack.start(START, [GOAL])
    rig.planner.reason = "the door is shut"
    rig.step(40.0)
    assert rig.stack.state.stuck is None


@pytest.mark.parametrize(
    ("reason", "text"), [(None, ""), ("the door is shut", "; the door is shut")]
)
def test_the_stack_gives_up_without_progress(reason: str | None, text: str) -> None:
    rig = Rig()
    rig.step(0.0)
    for time in np.arange(1.0, STUCK_AFTER + 0.1, 1.0):
        rig.step(float(time))
        assert rig.stack.state.stuck is None
    rig.planner.reason = reason
    rig.step(STUCK_AFTER + 1.0)
    assert rig.stack.state.stuck == f"no progress toward goal for 61 s{text}"


def test_a_lost_robot_is_not_stuck() -> None:
    rig = Rig()
    rig.localizer.lost = True
    for time in np.arange(0.0, 70.0, 1.0):
        rig.step(float(time))
    assert rig.stack.state.stuck is None


def test_a_sensor_that_has_failed_for_good_is_a_fault() -> None:
    rig = Rig()
    rig.step(0.0)
    rig.step(19.0, None)
    assert rig.stack.state.fault is None
    rig.step(21.0, None)
    assert rig.stack.state.fault == PersistentFailure("sensor", "the camera is silent, for 21 s")


# --- what comes out -------------------------------------------------------------------------------


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
    flow = wall_flow(ROBOT, 0.0, 2.0, 20.0, 20.0)
    percept = Offis(ROBOT).perceive(flow, Twist(0.3, 0.0))
    one = np.ones(1)
    stixels = Stixels(0.0, 0.1 * one, one, 0.1 * one, one)
    view = View(flows=(flow,), percepts=(percept,), stixels=stixels)
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


def located(stack: Stack) -> bool:
    """Whether the local map of ``stack`` has a position."""
    return stack.local_map.occupancy.located


def test_start_returns_every_part_to_the_start_of_a_run() -> None:
    person = MovingObject(0.0, 0.0, 0.3, 0.7, np.zeros((2, 2)), np.zeros(2))
    stack = sample_stack(
        Ahead,
        script=lambda frame, odometry: View(moving_objects=(replace(person, time=frame.time),)),
    )
    drive(stack, 0.5)
    vision = stack.vision
    assert isinstance(vision, ScriptedVision)
    assert vision.frames
    assert stack.tracker.tracks
    assert located(stack)
    assert stack.mofis.proposals
    assert stack.verdict.twist != Twist(0.0, 0.0)
    stack.trim._shares = [0.5, 0.5]
    stack.start(START, [GOAL])
    assert stack.state == StackState(time=0.0)
    assert vision.frames == []
    assert stack.tracker.tracks == []
    assert not located(stack)
    assert stack.mofis.proposals == {}
    assert stack.mofis.context is None
    assert stack.verdict.twist == Twist(0.0, 0.0)
    assert stack.trim.shares == (1.0, 1.0)
    with pytest.raises(IndexError):
        stack.history.at(0.0)
    assert stack.odometer.update(Inertial(9.0, 0, 0, 0), Encoders(9.0, 7, 7)).pose == Pose(0, 0, 0)
    assert stack.safety.senses.camera_age == 0.0
