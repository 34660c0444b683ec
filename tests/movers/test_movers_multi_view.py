"""Detection of moving objects and stixels: pairs of frames, schedule, one camera, and all views."""

import itertools
import math

import numpy as np
import pytest
from flow_scene import Board, board_image
from localization_drives import odometry
from movers_detections import detection

from navfw.egomotion.pairing import FrameBuffer, PairingParams
from navfw.movers import MultiViewDetector
from navfw.movers.multi_view import (
    DetectionMode,
    DetectionSchedule,
    MovingObjectDetector,
    RecentFrames,
)
from navfw.robot import CameraModel, RobotModel, SideViews
from navfw.signals import Frame, MovingObject, Odometry, Pose, Stixels, Twist

NEAR = 0.9
QUIET_TIME = 2.0


def frame_at(
    robot: RobotModel, time: float, twist: Twist, boards: tuple[Board, ...]
) -> tuple[Frame, Odometry]:
    """Frame and odometry at ``time`` [s] of a robot that drives ``twist`` from the origin."""
    pose = Pose(twist.v * time, 0.0, 0.0)
    if twist.w:
        turn, radius = twist.w * time, twist.v / twist.w
        pose = Pose(radius * float(np.sin(turn)), radius * float(1.0 - np.cos(turn)), turn)
    ahead, *sides = (
        board_image(camera, pose, time, boards) for camera in (robot.camera, *robot.side_cameras)
    )
    return Frame(time, ahead, tuple(sides)), Odometry(time, pose, twist, 0.0, still=False)


ROBOT = RobotModel()
WIDE = RobotModel(side_views=SideViews())
SIDEWAYS = ROBOT.with_camera(WIDE.side_cameras[0])
PAIRING = PairingParams()
PERSON = Board(1.5, -0.3, vy=0.5)
"""Crosses to the left, 1.4 m before the camera at the origin."""
SLOW = Twist(0.2, 0.0)
RATE = 10.0
IMAGE = np.zeros((ROBOT.camera.height, ROBOT.camera.width), dtype=np.uint8)


@pytest.mark.parametrize(("v", "w"), [(0.0, 0.0), (0.3, 0.5), (0.0, 1.2)])
@pytest.mark.parametrize(("near", "interval"), [(False, 0.2), (True, 0.1)])
def test_pairs_always_span_a_fixed_time(v: float, w: float, near: bool, interval: float) -> None:
    frames = RecentFrames(ROBOT)
    assert frames.pair() is None
    for i in range(8):
        t = 0.1 * i
        pose = Pose(v * t, 0.0, w * t)
        frames.add(Frame(t, IMAGE), Odometry(t, pose, Twist(v, w), 0.0, False))
    pair = frames.pair(near)
    assert pair is not None
    assert pair.now.time == pytest.approx(0.7)
    assert pair.now.time - pair.past.time == pytest.approx(interval)


def test_frames_far_apart_or_after_a_wide_turn_make_no_pair() -> None:
    for after, turned in ((0.6, 0.0), (0.2, 0.5)):
        frames = RecentFrames(ROBOT)
        for time, yaw in ((0.0, 0.0), (after, turned)):
            frames.add(Frame(time, IMAGE), odometry(Pose(0.0, 0.0, yaw), time))
        assert frames.pair() is None


# --- the detection schedule ---


def modes(schedule: DetectionSchedule, first: int, last: int) -> list[DetectionMode]:
    """The mode of each frame from ``first`` up to ``last``; no search finds anything."""
    frames: list[DetectionMode] = []
    for k in range(first, last):
        frames.append(schedule.next_mode(k / RATE))
        if frames[-1] != "idle":
            schedule.update((), k / RATE)
    return frames


def test_while_nothing_moves_every_other_frame_is_searched_coarsely() -> None:
    frames = modes(DetectionSchedule(), 0, 40)
    assert frames.count("coarse") == frames.count("idle") == 20
    assert all("idle" in pair and "coarse" in pair for pair in itertools.pairwise(frames))


def test_after_a_detection_every_frame_is_searched_fully_for_a_while() -> None:
    schedule = DetectionSchedule()
    modes(schedule, 0, 10)
    schedule.update((detection(0.0, 0.0, 2.0),), 1.0)
    quiet = 11 + round(QUIET_TIME * RATE)
    assert set(modes(schedule, 11, quiet)) == {"full"}
    assert set(modes(schedule, quiet, quiet + 4)) == {"coarse", "idle"}


def test_with_always_full_every_frame_is_searched_fully() -> None:
    assert set(modes(DetectionSchedule(always_full=True), 0, 40)) == {"full"}


@pytest.mark.parametrize(("distance", "near"), [(0.9 * NEAR, True), (1.1 * NEAR, False)])
def test_near_is_by_the_nearest_of_the_last_search(distance: float, near: bool) -> None:
    schedule = DetectionSchedule()
    assert not schedule.near
    schedule.update((detection(0.0, 0.0, 3.0), detection(0.0, 0.0, distance)), 0.0)
    assert schedule.near is near
    schedule.update((), 0.1)
    assert not schedule.near


def test_reset_drops_the_last_detections() -> None:
    schedule = DetectionSchedule()
    schedule.update((detection(0.0, 0.0, 0.5),), 5.0)
    schedule.reset()
    assert not schedule.near
    assert "full" not in modes(schedule, 51, 54)


# --- one camera ---


def detect(
    detector: MovingObjectDetector,
    boards: tuple[Board, ...],
    twist: Twist = SLOW,
    *,
    frames: int = 5,
    robot: RobotModel = ROBOT,
    first: int = 0,
) -> list[tuple[MovingObject, ...]]:
    """The detections in each of ``frames`` frames at 10 Hz."""
    return [
        detector.detect(*frame_at(robot, 0.1 * k, twist, boards))
        for k in range(first, first + frames)
    ]


@pytest.mark.parametrize("v", [0.0, 0.2, 0.4])
def test_a_crossing_person_is_detected_from_a_pair_of_frames_on(v: float) -> None:
    detector = MovingObjectDetector(ROBOT, PAIRING, always_full=True)
    found = detect(detector, (PERSON,), Twist(v, 0.0))
    assert found[0] == ()
    for k in range(2, 5):
        ((person),) = found[k]
        time = 0.1 * k
        x, y = PERSON.at(time)
        ahead = x - v * time - ROBOT.camera.mount_forward
        assert person.time == pytest.approx(time)
        assert person.bearing == pytest.approx(math.atan2(y, ahead), abs=0.1)
        assert person.distance == pytest.approx(math.hypot(ahead, y), rel=0.2)
        assert person.velocity()[1] == pytest.approx(0.5, abs=0.2)


@pytest.mark.parametrize("twist", [Twist(0.0, 0.0), SLOW, Twist(0.4, 0.0), Twist(0.2, 0.3)])
def test_nothing_is_detected_among_static_boards(twist: Twist) -> None:
    boards = (Board(1.5, -0.3), Board(2.2, 0.6), Board(1.1, 0.5, width=0.1))
    for always_full in (True, False):
        detector = MovingObjectDetector(ROBOT, PAIRING, always_full=always_full)
        assert set(detect(detector, boards, twist, frames=6)) == {()}


def test_while_nothing_moves_frames_are_searched_coarsely_or_not_at_all() -> None:
    detector = MovingObjectDetector(ROBOT, PAIRING)
    flows = []
    for k in range(6):
        detector.detect(*frame_at(ROBOT, 0.1 * k, SLOW, ()))
        flows.append(detector.flow)
    assert flows == [None] * 6, "no dense flow of a frame that was not searched fully"
    # a person enters: a few frames later every frame is searched fully
    found = detect(detector, (PERSON,), frames=6, first=6)
    assert () in found
    assert len(found[-1]) == len(found[-2]) == 1
    assert detector.flow is not None
    detect(detector, (PERSON,), frames=1, first=12 + round(10 * QUIET_TIME) + 5)
    assert detector.flow is None


def test_with_always_full_the_dense_flow_is_of_the_newest_frame() -> None:
    detector = MovingObjectDetector(ROBOT, PAIRING, always_full=True)
    detect(detector, (), frames=4)
    flow = detector.flow
    assert flow is not None
    assert flow.time == pytest.approx(0.3)
    assert flow.derotated
    assert flow.motion.dt == pytest.approx(0.2)
    detector.reset()
    after_reset = [detector.flow]
    detect(detector, (), frames=1, first=4)
    after_reset.append(detector.flow)
    assert after_reset == [None, None], "no pair of frames yet"


@pytest.mark.parametrize(
    ("robot", "boards", "v", "interval"),
    [
        (ROBOT, (Board(0.8, -0.2, vy=0.4),), 0.0, 0.1),
        (ROBOT, (Board(1.5, -0.2, vy=0.4),), 0.0, 0.2),
        (SIDEWAYS, (), 0.2, 0.2),
        (SIDEWAYS, (), 0.4, 0.1),
    ],
    ids=["near object", "far object", "slow sideways motion", "fast sideways motion"],
)
def test_near_objects_and_sideways_motion_are_searched_for_over_a_shorter_time(
    robot: RobotModel, boards: tuple[Board, ...], v: float, interval: float
) -> None:
    detector = MovingObjectDetector(robot, PAIRING, always_full=True)
    *_, last, _ = detect(detector, boards, Twist(v, 0.0), robot=robot)
    assert len(last) == len(boards)
    assert detector.flow is not None
    assert detector.flow.motion.dt == pytest.approx(interval)


def test_a_camera_that_does_not_see_the_floor_detects_nothing() -> None:
    up = ROBOT.with_camera(CameraModel(pitch=-0.9))
    detector = MovingObjectDetector(up, PAIRING, always_full=True)
    assert set(detect(detector, (PERSON,), robot=up)) == {()}
    assert detector.flow is None


# --- all views ------------------------------------------------------------------------------------


def test_side_views_detect_what_the_camera_does_not_see() -> None:
    # far to the left of the camera's view
    beside = Board(0.9, 1.4, width=0.8, vx=-0.4)
    wide, narrow = (
        MultiViewDetector(robot, PAIRING, moving_objects=True, stixels=False)
        for robot in (WIDE, ROBOT)
    )
    for k in range(4):
        frame, odometry = frame_at(WIDE, 0.1 * k, Twist(0.0, 0.0), (beside,))
        objects = wide.detect(frame, odometry)
        assert narrow.detect(frame, odometry) == ()
    (seen,) = objects
    x, y = beside.at(0.3)
    assert seen.bearing == pytest.approx(math.atan2(y, x - 0.1), abs=0.25)
    wide.reset()
    assert wide.detect(*frame_at(WIDE, 0.4, Twist(0.0, 0.0), (beside,))) == ()


@pytest.mark.parametrize(
    ("robot", "stixels", "every"), [(ROBOT, False, False), (ROBOT, True, True), (WIDE, False, True)]
)
def test_every_frame_is_searched_with_side_views_or_for_stixels(
    robot: RobotModel, stixels: bool, every: bool
) -> None:
    found = []
    for first in (1, 2):  # the frame in which a person enters; pairs of frames are 0.2 s apart
        detector = MultiViewDetector(robot, PAIRING, moving_objects=True, stixels=stixels)
        for k in range(first + 3):
            boards = (PERSON,) if k >= first else ()
            objects = detector.detect(*frame_at(robot, 0.1 * k, SLOW, boards))
        found.append(len(objects))
    # else every other frame is left out while nothing moves
    assert found == ([1, 1] if every else [1, 0])


POLE = Board(0.8, 0.15, width=0.15)


def stixels_of_pole(v: float, frames: int = 5) -> Stixels | None:
    """Stixels of the last of ``frames`` frames."""
    detector = MultiViewDetector(ROBOT, PAIRING, moving_objects=False, stixels=True)
    buffer = FrameBuffer(ROBOT, PAIRING)
    for k in range(frames):
        frame, odometry = frame_at(ROBOT, 0.1 * k, Twist(v, 0.0), (POLE,))
        buffer.add(frame, odometry)
        detector.detect(frame, odometry)
        stixels = detector.stixels(buffer.pairs(), odometry)
    return stixels


@pytest.mark.parametrize("v", [0.1, 0.3, 0.5])
def test_a_pole_gives_stixels_at_its_distance(v: float) -> None:
    # 2 cm in 0.2 s are too short; later the frame buffer's pair has a longer way
    frames = 12 if v < 0.2 else 5
    stixels = stixels_of_pole(v, frames)
    assert stixels is not None
    distance = POLE.x - ROBOT.camera.mount_forward - v * 0.1 * (frames - 1)
    confident = stixels.confidence > 0.3
    middle = confident & (abs(stixels.slope - POLE.y / distance) < 0.08)
    assert middle.any()
    assert stixels.nearness[middle] == pytest.approx(1.0 / distance, rel=0.12)
    assert (abs(stixels.slope - POLE.y / distance)[confident] < 0.2).all()


def test_a_robot_that_stands_has_no_stixels() -> None:
    assert stixels_of_pole(0.0) is None


def test_only_what_is_wanted_is_detected() -> None:
    stixels_only, objects_only, neither = (
        MultiViewDetector(ROBOT, PAIRING, moving_objects=objects, stixels=stixels)
        for objects, stixels in ((False, True), (True, False), (False, False))
    )
    for k in range(5):
        frame, odometry = frame_at(ROBOT, 0.1 * k, Twist(0.3, 0.0), (PERSON,))
        assert stixels_only.detect(frame, odometry) == ()
        found = objects_only.detect(frame, odometry)
        assert neither.detect(frame, odometry) == ()
        assert objects_only.stixels((), odometry) is None
        assert neither.stixels((), odometry) is None
    assert len(found) == 1
    assert stixels_only.stixels((), odometry) is not None
