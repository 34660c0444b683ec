"""The stack's decisions once a camera frame: from which inputs, and when."""

import math
from dataclasses import replace

import numpy as np
import pytest
from stack_samples import (
    GOAL,
    LINE,
    ROBOT,
    SHAPE,
    START,
    Ahead,
    Idle,
    RecordingFeatures,
    RecordingPlanner,
    Rig,
    context_of,
    drive,
    person_ahead,
    registry,
    sample_stack,
    wall_view,
)

from navfw.config import find
from navfw.context import Context
from navfw.errors import ConfigError, InputError
from navfw.interfaces import Behavior
from navfw.plugins.fault_injection import inject_faults
from navfw.signals import (
    Belief,
    Frame,
    LandmarkDetection,
    MovingObject,
    Odometry,
    PassageQuery,
    Proposal,
    Twist,
    Waypoint,
)
from navfw.stack import Stack, load_stack
from navfw.stack.vision import View

SEEN = LandmarkDetection(0.0, "a", 0.1, 1.0, np.eye(2))
LEG = PassageQuery(("start", "goal"), (0.0, 0.0), (2.0, 0.0), 1.0)


def test_the_stages_get_what_the_frame_shows() -> None:
    view = wall_view()
    rig = Rig(sample_stack(Idle, script=lambda frame, odometry: view))
    rig.features.detections = (SEEN,)
    rig.step(0.0)
    state = rig.stack.state
    assert rig.localizer.starts == [(LINE, START, state.odometry)]
    [(odometry, percept, detections)] = rig.localizer.updates
    assert (odometry, percept) == (state.odometry, view.percept)
    assert [detection.identity for detection in detections] == [SEEN.identity]
    assert rig.planner.beliefs == [state.belief]
    assert (state.waypoint, state.path) == (GOAL, (GOAL,))
    assert state.flows is view.flows
    assert state.percept is view.percept
    assert [detection.identity for detection in state.landmark_detections] == [SEEN.identity]
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


def test_the_top_speed_leaves_successive_frames_a_pair() -> None:
    settings = ["commands.cruise=0.5", "pairing.max_baseline=0.04", "pairing.baseline=0.03"]
    stack = sample_stack(Idle, overrides=settings)
    assert stack.mofis.commands.max_v == pytest.approx(0.9 * 0.04 * ROBOT.camera.rate)


def test_without_a_frame_nothing_is_decided() -> None:
    rig = Rig()
    rig.step(0.0)
    state = rig.stack.state
    rig.step(0.05, None)
    assert rig.stack.state is state


def test_an_invalid_frame_is_not_perceived() -> None:
    rig = Rig()
    rig.features.detections = (SEEN,)
    rig.step(0.0)
    rig.step(0.1, np.zeros(SHAPE, np.uint8))
    assert [frame.time for frame in vars(rig.stack.vision)["frames"]] == [0.0]
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
    other = replace(SEEN, identity="b")
    for time, detections in ((0.0, ()), (0.1, (SEEN, other)), (0.2, (SEEN,)), (0.3, ())):
        rig.features.detections = detections
        rig.step(time)
        assert rig.stack.state.landmark_detections == detections
    assert rig.stack.state.detection_counts == {"a": 2, "b": 1}
    rig.stack.start(START, [GOAL])
    rig.step(10.0)
    assert rig.stack.state.detection_counts == {}


# --- when to decide ------------------------------------------------------------------------------


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
    rig.planner.legs = (LEG,)
    rig.step(0.0)
    assert rig.planner.beliefs == []
    state = rig.stack.state
    assert (state.waypoint, state.finished) == (None, False)
    assert state.command is not None
    assert context_of(rig.stack).local_goal is None
    # no passage is checked from a pose that is not valid
    rig.localizer.lost = False
    rig.step(0.1)
    assert rig.planner.reports[0].passages == ()
    assert rig.stack.state.waypoint == GOAL


def test_after_the_last_goal_the_robot_stops() -> None:
    rig = Rig(sample_stack(Ahead))
    twists = [rig.step(0.1 * k) for k in range(5)]
    assert twists[-1].v > 0.0
    rig.planner.waypoint = None
    rig.step(0.5)
    assert rig.stack.state.finished
    assert rig.stack.state.command is None
    assert rig.stack.state.path == ()
    twists = [rig.step(0.1 * k) for k in range(6, 12)]
    assert twists[-1] == Twist(0.0, 0.0)


def test_passage_reports_reach_the_planner_at_the_next_frame_once() -> None:
    rig = Rig()
    rig.planner.legs = (LEG,)
    rig.step(0.0)
    assert rig.planner.reports == []
    rig.step(0.1)
    (report,) = rig.planner.reports
    assert report.time == 0.0
    assert report.passages == ((LEG, "unknown"),)
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


def test_skidding_wheels_are_corrected_by_the_floor_unless_the_stack_says_otherwise() -> None:
    skidding = ROBOT.model_copy(update={"skid": 0.08})
    for robot, settings, corrected in (
        (ROBOT, [], False),
        (skidding, [], True),
        (skidding, ["floor_odometry=false"], False),
        (ROBOT, ["floor_odometry=true"], True),
    ):
        config = load_stack(find("stack", "default"), registry(), settings)
        assert (Stack(config, robot, LINE).floor_odometry is not None) is corrected


# --- moving obstacles -----------------------------------------------------------------------------


class Careful(Idle):
    """Declares that it handles moving obstacles."""

    name = "careful"
    handles_moving_obstacles = True


class Failing(Careful):
    """Declares so, and then fails."""

    name = "failing"

    def propose(self, context: Context) -> Proposal:
        raise RuntimeError("no proposal")


@pytest.mark.parametrize(
    ("behaviors", "fault_in", "barred"),
    [
        ((Idle,), None, True),
        ((Idle, Careful), None, False),
        ((Idle, Failing), None, True),
        ((Idle, Careful), "careful", False),  # an inactive fault injector
    ],
)
def test_tracks_bar_arcs_unless_a_behaviour_handles_them(
    behaviors: tuple[type[Behavior], ...], fault_in: str | None, barred: bool
) -> None:
    stack = sample_stack(*behaviors, script=person_ahead)
    if fault_in is not None:
        inject_faults(stack.mofis.behaviors, fault_in)
    drive(stack, 0.25)  # three detections of the person, before any percept
    context = context_of(stack)
    straight = context.commands.nearest(Twist(0.3, 0.0))
    assert (context.arcs.free[straight] < 0.8) == barred
    # either way the conflict is known, and the local goal leads past
    assert context.conflicts is not None
    assert context.local_goal is not None
    assert abs(context.local_goal.bearing) > 0.1


# --- refusals -------------------------------------------------------------------------------------


class RefusingPlanner(RecordingPlanner):
    """Refuses every update."""

    name = "refusing_planner"

    def update(self, belief: Belief) -> Waypoint | None:
        raise InputError("no way")


def test_parameters_that_do_not_suit_the_robot_are_an_error_in_the_stack_file() -> None:
    file = find("stack", "default")
    with pytest.raises(ConfigError, match="cannot divide the image height") as caught:
        Stack.load(file, ROBOT, LINE, registry(), ["flow.block_matching.rows=7"])
    assert file.name in str(caught.value.file)


def test_a_plugin_may_refuse_in_the_first_step_and_fails_in_those_after_it() -> None:
    rig = Rig(planner=RefusingPlanner(ROBOT))
    with pytest.raises(InputError, match="no way"):
        rig.step(0.0)
    rig.stack.planner.plugin = RecordingPlanner(ROBOT)
    rig.stack.start(START, [GOAL])
    rig.step(0.1)
    rig.stack.planner.plugin = RefusingPlanner(ROBOT)
    rig.step(0.2)
    assert any("no way" in fault for fault in rig.stack.state.faults)
