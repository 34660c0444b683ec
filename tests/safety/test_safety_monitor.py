"""The safety monitor: it never adds speed, and stops for every reason it should."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.localmap import FreeDistance, LocalMap
from navfw.robot import RobotModel
from navfw.safety import SafetyMonitor
from navfw.signals import Encoders, Frame, Image, Inertial, Odometry, Pose, SensorReading, Twist

ROBOT = RobotModel()
RATE = 60.0
RNG = np.random.default_rng(1)


def picture(mean: float = 120.0, spread: float = 30.0) -> Image:
    noise = RNG.normal(mean, spread, (120, 160))
    return np.clip(noise, 0, 255).astype(np.uint8)


class FixedDistances(LocalMap):
    """A local map with the same free distances [m] for every pose and twist."""

    def __init__(self, contact: float = 10.0, unobserved: float = 10.0) -> None:
        super().__init__(ROBOT)
        self.distances = FreeDistance(contact, unobserved)

    def free_distance(self, pose: Pose, twist: Twist) -> FreeDistance:
        return self.distances


ORIGIN = Pose(0.0, 0.0, 0.0)


def monitor_with(contact: float = 10.0, unobserved: float = 10.0) -> SafetyMonitor:
    return SafetyMonitor(ROBOT, FixedDistances(contact, unobserved))


class Drive:
    """Updates a monitor with readings at the control rate and keeps its last verdict."""

    def __init__(self) -> None:
        self.monitor = monitor_with()
        self.tick = 0
        self.x = 0.0

    def run(
        self,
        seconds: float,
        wanted: Twist,
        image: Image | Literal["fresh"] | None = "fresh",
        moves: float = 1.0,
        gyro_age: float = 0.0,
        encoder_age: float = 0.0,
    ) -> Twist:
        driven = wanted
        for _ in range(round(seconds * RATE)):
            time = self.tick / RATE
            frame = None
            if self.tick % 6 == 0 and image is not None:
                frame = Frame(time, picture() if isinstance(image, str) else image)
            self.x += wanted.v * moves / RATE
            reading = SensorReading(
                time,
                Inertial(time - gyro_age, 0.0, 0.0, 0.0),
                Encoders(time - encoder_age, 0, 0),
                frame,
            )
            odometry = Odometry(
                time, Pose(self.x, 0.0, 0.0), Twist(wanted.v * moves, 0.0), 0.0, still=False
            )
            self.monitor.update(reading, odometry)
            self.verdict = self.monitor.limit(wanted, time, odometry.pose)
            driven = self.verdict.twist
            self.tick += 1
        return driven


def test_with_valid_sensors_and_room_nothing_is_limited() -> None:
    drive = Drive()
    assert drive.run(3.0, Twist(0.4, 0.3)) == Twist(0.4, 0.3)
    assert drive.verdict.reason == ""


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (None, "silent"),
        (np.zeros((120, 160), np.uint8), "dark"),
        (np.full((120, 160), 255, np.uint8), "over-exposed"),
        (np.full((120, 160), 128, np.uint8), "contrast"),
        (picture(), "frozen"),
    ],
)
def test_without_valid_frames_the_robot_slows_and_stops_but_may_turn(
    image: Image | None, why: str
) -> None:
    drive = Drive()
    drive.run(1.0, Twist(0.4, 0.0))
    slowed = drive.run(0.8, Twist(0.4, 0.2), image)
    assert 0.0 < slowed.v < 0.2
    stopped = drive.run(1.0, Twist(0.4, 0.2), image)
    assert stopped == Twist(0.0, 0.2)
    assert why in drive.verdict.reason
    assert drive.run(0.1, Twist(-0.1, 0.0), image).v == -0.1
    assert drive.run(0.5, Twist(0.4, 0.0)).v == 0.4  # frames are valid again


def test_an_unchanged_image_is_valid_while_the_robot_stands() -> None:
    drive = Drive()
    image = picture()
    drive.run(5.0, Twist(0.0, 0.0), image)
    assert drive.monitor.senses.camera_age < 0.2


def test_a_silent_gyro_slows_and_silent_encoders_stop() -> None:
    drive = Drive()
    assert 0.0 < drive.run(1.0, Twist(0.4, 0.0), gyro_age=0.5).v < 0.2
    assert drive.run(1.0, Twist(0.4, 0.0), encoder_age=1.0).v == 0.0
    assert "encoders" in drive.verdict.reason


def test_wheels_that_do_not_follow_are_stopped_for_a_while() -> None:
    drive = Drive()
    drive.run(0.5, Twist(0.3, 0.0))
    drive.run(1.0, Twist(0.3, 0.0), moves=0.0)
    assert drive.verdict.twist.v == 0.0
    assert "wheels" in drive.verdict.reason
    drive.run(1.5, Twist(0.0, 0.0))
    assert drive.run(0.2, Twist(0.3, 0.0)).v == 0.3


@given(st.floats(0.0, 2.0), st.floats(0.0, ROBOT.max_v))
def test_the_robot_can_always_stop_within_the_free_distance(room: float, v: float) -> None:
    monitor = monitor_with(room)
    verdict = monitor.limit(Twist(v, 0.0), 0.0, ORIGIN)
    distance = verdict.twist.v * monitor.params.latency + verdict.twist.v**2 / (2 * ROBOT.max_brake)
    assert distance <= max(room - monitor.params.gap, 0.0) + 1e-9
    assert verdict.twist.v <= v
    assert verdict.stopped == (v > 0.0 and verdict.twist.v <= 0.0)


ANY = st.floats(allow_nan=True, allow_infinity=True)
MONITOR = monitor_with()


@given(ANY, ANY)
def test_every_twist_is_within_the_limits_of_the_drive(v: float, w: float) -> None:
    twist = MONITOR.limit(Twist(v, w), 0.0, ORIGIN).twist
    assert -ROBOT.max_reverse <= twist.v <= ROBOT.max_v
    assert abs(twist.w) <= ROBOT.max_w
    assert math.isfinite(twist.v) and math.isfinite(twist.w)


def test_reversing_ends_where_the_free_distance_behind_ends() -> None:
    back = Twist(-0.1, 0.4)
    assert monitor_with(0.5, 0.5).limit(back, 0.0, ORIGIN).twist == back
    for blocked in ((0.0, 0.5), (0.5, ROBOT.radius)):  # an obstacle; unobserved floor
        verdict = monitor_with(*blocked).limit(back, 0.0, ORIGIN)
        assert verdict.twist == Twist(0.0, 0.4)
        assert verdict.reason == "no observed free space behind"
        assert not verdict.stopped, "only a forward speed counts as stopped"


def test_unobserved_space_is_entered_slowly() -> None:
    monitor = monitor_with(2.0, 0.03)
    verdict = monitor.limit(Twist(0.4, 0.0), 0.0, ORIGIN)
    assert verdict.twist.v == monitor.params.creep
    assert "unobserved" in verdict.reason


# --- without a local map --------------------------------------------------------------------------


def observed_floor() -> LocalMap:
    """A local map around the origin whose floor is all observed free."""
    local_map = LocalMap(ROBOT)
    local_map.update(Odometry(0.0, ORIGIN, Twist(0.0, 0.0), 0.0, still=True), (), None, ORIGIN)
    local_map.occupancy.log_odds[:] = -1.0
    return local_map


FLOOR = observed_floor()


@given(v=st.floats(-0.15, 0.5), w=st.floats(-1.6, 1.6))
def test_without_a_local_map_the_robot_turns_at_most(v: float, w: float) -> None:
    never_updated, reset = LocalMap(ROBOT), observed_floor()
    reset.reset()
    half = 0.5 * reset.params.occupancy.extent
    outside = (Pose(half + 0.1, 0.0, 0.0), Pose(0.0, -half - 0.1, 3.0))
    cases = [(never_updated, ORIGIN), (reset, ORIGIN), *((FLOOR, pose) for pose in outside)]
    for local_map, pose in cases:
        assert local_map.free_distance(pose, Twist(v, w)) == (0.0, 0.0)
        verdict = SafetyMonitor(ROBOT, local_map).limit(Twist(v, w), 0.0, pose)
        assert verdict.twist == Twist(0.0, w)
        assert verdict.stopped == (v > 0.0)
        assert bool(verdict.reason) == (v != 0.0)


def test_over_observed_floor_the_robot_drives_both_ways() -> None:
    for v in (0.4, -0.1):
        assert SafetyMonitor(ROBOT, FLOOR).limit(Twist(v, 0.0), 0.0, ORIGIN).twist.v == v


# --- sensors --------------------------------------------------------------------------------------


def feed(
    monitor: SafetyMonitor, time: float, image: Image | None, *, x: float = 0.0, **more: float
) -> None:
    """Update with one reading; its frame is ``late`` [s] old, the encoders may be ``silent``."""
    frame = None if image is None else Frame(time - more.get("late", 0.0), image)
    reading = SensorReading(time, Inertial(time, 0, 0, 0), Encoders(time, 0, 0), frame)
    silent = bool(more.get("silent", 0.0))
    odometry = Odometry(time, Pose(x, 0, 0), Twist(0.3, 0.0), 0.0, still=False, silent=silent)
    monitor.update(reading, odometry)


def test_the_age_of_a_frame_counts_from_its_time_stamp() -> None:
    monitor = monitor_with()
    for tick in range(30):
        feed(monitor, 0.1 * tick, picture(), late=0.8)
    assert monitor.senses.camera_age == pytest.approx(0.8)
    assert monitor.limit(Twist(0.4, 0.0), 2.9, ORIGIN).twist.v == monitor.params.slow


def usable(monitor: SafetyMonitor) -> bool:
    """Whether the newest frame may be used for flow."""
    return monitor.senses.seeing


def test_an_unchanged_image_of_a_moving_robot_is_not_used() -> None:
    monitor, image = monitor_with(), picture()
    feed(monitor, 0.0, image)
    feed(monitor, 0.1, image)
    assert usable(monitor)
    feed(monitor, 0.2, image, x=0.01)
    assert not usable(monitor)
    assert monitor.senses.trouble == ""
    feed(monitor, 0.3, image, x=0.03)
    assert "frozen" in monitor.senses.trouble
    feed(monitor, 0.4, picture(), x=0.05)
    assert usable(monitor)


def test_without_encoders_the_robot_stands_but_for_short_probes() -> None:
    monitor = monitor_with()
    driven = {0.4: 0.0, -0.1: 0.0}
    feed(monitor, 0.0, picture())
    for tick in range(1, 600):
        feed(monitor, tick / RATE, picture() if tick % 6 == 0 else None, silent=1.0)
        for wanted in driven:
            twist = monitor.limit(Twist(wanted, 0.3), tick / RATE, ORIGIN).twist
            assert twist.w == 0.3
            driven[wanted] += twist.v / RATE
    assert 0.02 < driven[0.4] < 0.06
    assert -0.06 < driven[-0.1] < -0.02
    feed(monitor, 10.0, picture())
    assert monitor.limit(Twist(0.4, 0.0), 10.0, ORIGIN).twist.v == 0.4


@pytest.mark.parametrize(("image", "silent", "why"), [(0, 0.0, "dark"), (120, 1.0, "encoders")])
def test_a_sensor_that_fails_for_long_ends_the_run(image: int, silent: float, why: str) -> None:
    monitor = monitor_with()
    feed(monitor, 0.0, picture())
    for second in range(1, 60):
        dark = np.zeros((120, 160), np.uint8)
        feed(monitor, float(second), picture() if image else dark, silent=silent)
        assert (monitor.failure is not None) == (second > monitor.params.give_up)
    assert why in str(monitor.failure)


def test_without_valid_frames_the_robot_reverses_a_little_and_no_farther() -> None:
    drive = Drive()
    back = Twist(-0.15, 0.0)
    assert drive.run(3.0, back).v == back.v  # with valid frames as far as there is room
    assert drive.run(1.0, back, image=None).v == back.v  # not counted as blind yet
    drive.run(3.0, back, image=None)
    assert drive.run(0.1, back, image=None).v == 0.0
    assert "without a valid frame" in drive.monitor.limit(back, drive.tick / RATE, ORIGIN).reason
    assert drive.run(0.1, Twist(0.0, 0.5), image=None).w == 0.5
    assert drive.run(0.2, back).v == back.v  # frames are valid again
