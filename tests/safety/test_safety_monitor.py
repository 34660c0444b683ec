"""The monitor's last word: it never adds speed, and stops for every reason it should."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.robot import RobotModel
from navfw.safety import SafetyMonitor
from navfw.signals import Encoders, Frame, Image, Inertial, Odometry, Pose, SensorReading, Twist

ROBOT = RobotModel()
RATE = 60.0
RNG = np.random.default_rng(1)


def picture(mean: float = 120.0, spread: float = 30.0) -> Image:
    noise = RNG.normal(mean, spread, (120, 160))
    return np.clip(noise, 0, 255).astype(np.uint8)


def endless(twist: Twist) -> tuple[float, float]:
    return 10.0, 10.0


class Drive:
    """Feeds a monitor with readings at the control rate and keeps its verdicts."""

    def __init__(self) -> None:
        self.monitor = SafetyMonitor(ROBOT)
        self.tick = 0
        self.x = 0.0

    def run(
        self,
        seconds: float,
        asked: Twist,
        image: Image | str | None = "fresh",
        moves: float = 1.0,
        gyro_age: float = 0.0,
        encoder_age: float = 0.0,
    ) -> Twist:
        got = asked
        for _ in range(round(seconds * RATE)):
            time = self.tick / RATE
            frame = None
            if self.tick % 6 == 0 and image is not None:
                frame = Frame(time, picture() if isinstance(image, str) else image)
            self.x += asked.v * moves / RATE
            reading = SensorReading(
                time,
                Inertial(time - gyro_age, 0.0, 0.0, 0.0),
                Encoders(time - encoder_age, 0, 0),
                frame,
            )
            odometry = Odometry(
                time, Pose(self.x, 0.0, 0.0), Twist(asked.v * moves, 0.0), 0.0, still=False
            )
            self.monitor.hear(reading, odometry)
            self.verdict = self.monitor.limit(asked, time, endless)
            got = self.verdict.twist
            self.tick += 1
        return got


def test_all_well_nothing_is_changed() -> None:
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
def test_a_blind_robot_slows_and_then_stops_but_may_turn(image: Image | None, why: str) -> None:
    drive = Drive()
    drive.run(1.0, Twist(0.4, 0.0))
    slowed = drive.run(0.8, Twist(0.4, 0.2), image)
    assert 0.0 < slowed.v < 0.2
    stopped = drive.run(1.0, Twist(0.4, 0.2), image)
    assert stopped == Twist(0.0, 0.2)
    assert why in drive.verdict.reason
    assert drive.run(0.1, Twist(-0.1, 0.0), image).v == -0.1
    assert drive.run(0.5, Twist(0.4, 0.0)).v == 0.4  # sight comes back


def test_a_standing_robot_may_see_the_same_picture_for_long() -> None:
    drive = Drive()
    image = picture()
    drive.run(5.0, Twist(0.0, 0.0), image)
    assert drive.monitor.senses.camera_age < 0.2


def test_silent_gyro_slows_and_silent_encoders_stop() -> None:
    drive = Drive()
    assert 0.0 < drive.run(1.0, Twist(0.4, 0.0), gyro_age=0.5).v < 0.2
    assert drive.run(1.0, Twist(0.4, 0.0), encoder_age=1.0).v == 0.0
    assert "encoders" in drive.verdict.reason


def test_wheels_that_do_not_follow_get_a_rest() -> None:
    drive = Drive()
    drive.run(0.5, Twist(0.3, 0.0))
    drive.run(1.0, Twist(0.3, 0.0), moves=0.0)
    assert drive.verdict.twist.v == 0.0
    assert "wheels" in drive.verdict.reason
    drive.run(1.5, Twist(0.0, 0.0))
    assert drive.run(0.2, Twist(0.3, 0.0)).v == 0.3


@given(st.floats(0.0, 2.0), st.floats(0.0, ROBOT.max_v))
def test_it_can_always_stop_within_the_room(room: float, v: float) -> None:
    monitor = SafetyMonitor(ROBOT)
    verdict = monitor.limit(Twist(v, 0.0), 0.0, lambda twist: (room, 10.0))
    way = verdict.twist.v * monitor.params.latency + verdict.twist.v**2 / (2 * ROBOT.max_brake)
    assert way <= max(room - monitor.params.gap, 0.0) + 1e-9
    assert verdict.twist.v <= v
    assert verdict.stopped == (v > 0.0 and verdict.twist.v <= 0.0)


ANY = st.floats(allow_nan=True, allow_infinity=True)


@given(ANY, ANY)
def test_whatever_is_asked_the_answer_is_within_limits(v: float, w: float) -> None:
    twist = SafetyMonitor(ROBOT).limit(Twist(v, w), 0.0, endless).twist
    assert -ROBOT.max_reverse <= twist.v <= ROBOT.max_v
    assert abs(twist.w) <= ROBOT.max_w
    assert math.isfinite(twist.v) and math.isfinite(twist.w)


def test_backing_ends_where_the_room_behind_ends() -> None:
    monitor = SafetyMonitor(ROBOT)
    assert monitor.limit(Twist(-0.1, 0.0), 0.0, lambda twist: (0.5, 0.5)).twist.v == -0.1
    for blocked in ((0.0, 0.5), (0.5, ROBOT.radius)):  # something there; never seen
        twist = monitor.limit(Twist(-0.1, 0.4), 0.0, lambda twist, room=blocked: room).twist
        assert twist == Twist(0.0, 0.4)


def test_the_unseen_is_entered_slowly() -> None:
    monitor = SafetyMonitor(ROBOT)
    verdict = monitor.limit(Twist(0.4, 0.0), 0.0, lambda twist: (2.0, 0.03))
    assert verdict.twist.v == monitor.params.creep
    assert "seen" in verdict.reason


def hear(
    monitor: SafetyMonitor, time: float, image: Image | None, *, x: float = 0.0, **more: float
) -> None:
    """One reading, with a frame that was taken ``late`` [s] ago; the encoders may be ``silent``."""
    frame = None if image is None else Frame(time - more.get("late", 0.0), image)
    reading = SensorReading(time, Inertial(time, 0, 0, 0), Encoders(time, 0, 0), frame)
    silent = bool(more.get("silent", 0.0))
    odometry = Odometry(time, Pose(x, 0, 0), Twist(0.3, 0.0), 0.0, still=False, silent=silent)
    monitor.hear(reading, odometry)


def test_a_frame_is_as_old_as_its_time_says() -> None:
    monitor = SafetyMonitor(ROBOT)
    for tick in range(30):
        hear(monitor, 0.1 * tick, picture(), late=0.8)
    assert monitor.senses.camera_age == pytest.approx(0.8)
    assert monitor.limit(Twist(0.4, 0.0), 2.9, endless).twist.v == monitor.params.slow


def test_a_picture_that_does_not_change_is_not_looked_at() -> None:
    monitor, image = SafetyMonitor(ROBOT), picture()
    hear(monitor, 0.0, image)
    hear(monitor, 0.1, image)
    assert monitor.senses.seeing
    hear(monitor, 0.2, image, x=0.01)
    assert not monitor.senses.seeing
    assert monitor.senses.trouble == ""
    hear(monitor, 0.3, image, x=0.03)
    assert "frozen" in monitor.senses.trouble
    hear(monitor, 0.4, picture(), x=0.05)
    assert monitor.senses.seeing


def test_without_encoders_it_stands_and_tries_a_few_millimetres_now_and_then() -> None:
    monitor = SafetyMonitor(ROBOT)
    way = {0.4: 0.0, -0.1: 0.0}
    hear(monitor, 0.0, picture())
    for tick in range(1, 600):
        hear(monitor, tick / RATE, picture() if tick % 6 == 0 else None, silent=1.0)
        for asked in way:
            got = monitor.limit(Twist(asked, 0.3), tick / RATE, endless).twist
            assert got.w == 0.3
            way[asked] += got.v / RATE
    assert 0.02 < way[0.4] < 0.06
    assert -0.06 < way[-0.1] < -0.02
    hear(monitor, 10.0, picture())
    assert monitor.limit(Twist(0.4, 0.0), 10.0, endless).twist.v == 0.4


@pytest.mark.parametrize(("image", "silent", "why"), [(0, 0.0, "dark"), (120, 1.0, "encoders")])
def test_a_sensor_out_for_long_is_a_failure(image: int, silent: float, why: str) -> None:
    monitor = SafetyMonitor(ROBOT)
    hear(monitor, 0.0, picture())
    for second in range(1, 60):
        dark = np.zeros((120, 160), np.uint8)
        hear(monitor, float(second), picture() if image else dark, silent=silent)
        assert (monitor.failure is not None) == (second > monitor.params.give_up)
    assert why in str(monitor.failure)


def test_a_blind_robot_backs_a_little_and_no_farther() -> None:
    drive = Drive()
    back = Twist(-0.15, 0.0)
    assert drive.run(3.0, back).v == back.v  # with eyes open as far as there is room
    assert drive.run(1.0, back, image=None).v == back.v  # not blind yet
    drive.run(3.0, back, image=None)
    assert drive.run(0.1, back, image=None).v == 0.0
    assert "without seeing" in drive.monitor.limit(back, drive.tick / RATE, endless).reason
    assert drive.run(0.1, Twist(0.0, 0.5), image=None).w == 0.5
    assert drive.run(0.2, back).v == back.v  # it sees again
