"""The safety monitor: sensors that fail, and wheels that do not follow."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from safety_samples import ORIGIN, monitor_with, odometry, picture, reading

from navfw.numerics import Image
from navfw.safety import SafetyMonitor
from navfw.signals import Twist

RATE = 60.0


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
                frame = picture() if isinstance(image, str) else image
            self.x += wanted.v * moves / RATE
            now = reading(time, frame, gyro_age=gyro_age, encoder_age=encoder_age)
            measured = odometry(time, self.x, v=wanted.v * moves)
            self.monitor.update(now, measured)
            self.verdict = self.monitor.limit(wanted, time, measured.pose)
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


def feed(
    monitor: SafetyMonitor, time: float, image: Image | None, *, x: float = 0.0, **more: float
) -> None:
    """Update with one reading; its frame is ``late`` [s] old, the encoders may be ``silent``."""
    now = reading(time, image, frame_age=more.get("late", 0.0))
    silent = bool(more.get("silent", 0.0))
    monitor.update(now, odometry(time, x, v=0.3, silent=silent))


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


@pytest.mark.parametrize(
    ("ages", "v", "reason"),
    [
        ({"frame_age": 0.44}, 0.4, ""),
        ({"frame_age": 0.46}, 0.12, "the camera is late"),
        ({"frame_age": 1.19}, 0.12, "the camera is late"),
        ({"frame_age": 1.21}, 0.0, "the camera is silent"),
        ({"gyro_age": 0.19}, 0.4, ""),
        ({"gyro_age": 0.21}, 0.12, "the gyro is silent"),
        ({"encoder_age": 0.49}, 0.4, ""),
        ({"encoder_age": 0.51}, 0.0, "the wheel encoders are silent"),
        ({"gyro_age": 9.0, "frame_age": 0.5}, 0.12, "the camera is late"),
        ({"encoder_age": 0.6, "frame_age": 2.0}, 0.0, "the wheel encoders are silent"),
    ],
)
def test_old_readings_limit_the_speed_from_their_thresholds(
    ages: dict[str, float], v: float, reason: str
) -> None:
    monitor = monitor_with()
    monitor.update(reading(10.0, picture(), **ages), odometry(10.0, v=0.4))
    verdict = monitor.limit(Twist(0.4, 0.7), 10.0, ORIGIN)
    assert verdict.twist == Twist(v, 0.7)
    assert verdict.reason == reason
    assert verdict.stopped == (v == 0.0)
    # less speed than the cap is left alone
    assert monitor.limit(Twist(0.0, 0.7), 10.0, ORIGIN).reason == ""


def driving(
    monitor: SafetyMonitor, begin: float, end: float, wanted: float, v: float
) -> list[float]:
    """Speeds driven from time ``begin`` to ``end`` [s], at 20 Hz, while the wheels do ``v``."""
    driven = []
    for tick in range(round(20 * begin), round(20 * end)):
        time = tick / 20.0
        monitor.update(reading(time, picture()), odometry(time, time * v, v=v))
        driven.append(monitor.limit(Twist(wanted, 0.0), time, ORIGIN).twist.v)
    return driven


@pytest.mark.parametrize(
    ("wanted", "v", "stalls"),
    [
        (0.3, 0.05, True),
        (0.3, 0.07, False),
        (0.07, 0.0, False),
        (0.09, 0.0, True),
        (-0.1, 0.0, False),
    ],
)
def test_wheels_stall_below_a_fifth_of_the_commanded_speed(
    wanted: float, v: float, stalls: bool
) -> None:
    monitor = monitor_with()
    assert set(driving(monitor, 0.0, 0.8, wanted, v)) == {wanted}, "not before the stall time"
    later = driving(monitor, 0.8, 4.0, wanted, v)
    assert (0.0 in later) == stalls
    assert monitor.limit(Twist(wanted, 0.4), 4.0, ORIGIN).twist.w == 0.4


def test_after_a_stall_the_robot_stands_for_a_while_and_tries_again() -> None:
    monitor = monitor_with()
    driven = driving(monitor, 0.0, 4.0, 0.3, 0.0)
    first = driven.index(0.0) / 20.0
    # the wheels are commanded from the first tick on; two ticks until the stall counts
    assert first == pytest.approx(0.8 + 0.1, abs=0.051)
    again = driven.index(0.3, driven.index(0.0)) / 20.0
    assert again - first == pytest.approx(1.0, abs=0.01)
    assert 0.0 in driven[round(20 * again) :], "still stalled: it stands again"


def test_a_wheel_that_follows_in_between_is_no_stall() -> None:
    monitor = monitor_with()
    driving(monitor, 0.0, 0.7, 0.3, 0.0)
    driving(monitor, 0.7, 0.8, 0.3, 0.3)
    assert 0.0 not in driving(monitor, 0.8, 1.5, 0.3, 0.0)


def reversed_blindly(monitor: SafetyMonitor, v: float, seconds: float) -> float:
    """Distance [m] reversed in so many seconds without frames, at ``v`` [m/s]."""
    monitor.update(reading(0.0, picture()), odometry(0.0, v=v))
    driven = 0.0
    for tick in range(1, round(20 * seconds)):
        time = tick / 20.0
        now = monitor.limit(Twist(v, 0.0), time, ORIGIN).twist.v
        # the camera counts as silent from camera_stop on
        driven += max(-now, 0.0) / 20.0 if time > monitor.params.camera_stop else 0.0
        monitor.update(reading(time), odometry(time, v=now))
    return driven


def test_reverse_without_frames_is_limited_in_distance() -> None:
    monitor = monitor_with()
    assert reversed_blindly(monitor, -0.1, 10.0) == pytest.approx(0.3, abs=0.011)
    monitor.reset()
    assert reversed_blindly(monitor, -0.05, 15.0) == pytest.approx(0.3, abs=0.011)
    # a valid frame allows for the whole distance again
    monitor.update(reading(15.0, picture()), odometry(15.0))
    assert monitor.limit(Twist(-0.1, 0.0), 15.0, ORIGIN).twist.v == -0.1


def test_probes_of_silent_encoders_are_short_and_slow() -> None:
    monitor = monitor_with()
    monitor.update(reading(0.0, picture()), odometry(0.0))
    forward, backward = [], []
    for tick in range(1, 60 * 7):
        time = tick / 60.0
        monitor.update(reading(time, picture()), odometry(time, silent=True))
        forward.append(monitor.limit(Twist(0.4, 0.0), time, ORIGIN).twist.v)
        backward.append(monitor.limit(Twist(-0.1, 0.0), time, ORIGIN).twist.v)
    probing = {k + 1 for k, v in enumerate(forward) if v}
    assert {forward[k - 1] for k in probing} == {monitor.params.probe}
    assert {-backward[k - 1] for k in probing} == {monitor.params.probe}
    assert {k + 1 for k, v in enumerate(backward) if v} == probing
    # the last 0.3 s of every 3 s
    expected = {k for k in range(1, 60 * 7) if (k / 60.0) % 3.0 > 2.7}
    assert len(probing ^ expected) <= 2
    reason = monitor.limit(Twist(0.4, 0.0), 7.0, ORIGIN).reason
    assert reason == "the wheel encoders do not count"


@pytest.mark.parametrize(
    ("sensor", "text"),
    [("camera", "the camera is silent, for 21 s"), ("encoders", "the wheel encoders do not count")],
)
def test_a_sensor_that_gives_no_reading_for_long_is_named(sensor: str, text: str) -> None:
    monitor = monitor_with()
    monitor.update(reading(0.0, picture()), odometry(0.0))
    for age, failed in ((19.9, False), (20.6, True)):
        old = {"encoder_age": age} if sensor == "encoders" else {}
        frame = picture() if sensor == "encoders" else None
        monitor.update(reading(age, frame, **old), odometry(age))
        assert (monitor.failure is not None) == failed
    assert text in str(monitor.failure)
    monitor.reset()
    assert monitor.failure is None


def test_reset_drops_stall_standstill_and_reverse() -> None:
    monitor = monitor_with()
    assert 0.0 in driving(monitor, 0.0, 1.2, 0.3, 0.0)
    monitor.reset()
    assert driving(monitor, 0.0, 0.5, 0.3, 0.3)[0] == 0.3
    driving(monitor, 0.5, 1.2, 0.3, 0.0)
    monitor.reset()
    assert 0.0 not in driving(monitor, 1.2, 1.9, 0.3, 0.0), "the time without following is dropped"
    reversed_blindly(monitor, -0.1, 10.0)
    monitor.reset()
    assert monitor.limit(Twist(-0.1, 0.0), 0.0, ORIGIN).twist.v == -0.1
    # no commanded speed, and no time of the last run
    monitor.update(reading(100.0), odometry(100.0, v=-0.1))
    assert monitor.limit(Twist(-0.1, 0.0), 100.0, ORIGIN).twist.v == -0.1
