"""The safety monitor: sensors that fail, and wheels that do not follow."""

from typing import Literal

import numpy as np
import pytest
from safety_samples import ORIGIN, monitor_with, odometry, picture, reading, started

from navfw.guard import FailingStage
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
        ({"encoder_age": 0.5}, 0.4, ""),
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


STALLS = [(0.3, 0.05, True), (0.3, 0.07, False), (0.07, 0.0, False), (0.09, 0.0, True)]


@pytest.mark.parametrize(("wanted", "v", "stalls"), [*STALLS, (-0.1, 0.0, False)])
def test_wheels_stall_below_a_fifth_of_the_commanded_speed(
    wanted: float, v: float, stalls: bool
) -> None:
    monitor = monitor_with()
    assert set(driving(monitor, 0.0, 0.8, wanted, v)) == {wanted}, "not before the stall time"
    later = driving(monitor, 0.8, 4.0, wanted, v)
    assert (0.0 in later) == stalls
    verdict = monitor.limit(Twist(wanted, 0.4), 4.0, ORIGIN)
    assert verdict.twist.w == 0.4
    assert (verdict.reason == "the wheels do not follow") == (verdict.twist.v != wanted)


def test_after_a_stall_the_robot_stands_for_a_while_and_tries_again() -> None:
    monitor = monitor_with()
    driven = driving(monitor, 0.0, 4.0, 0.3, 0.0)
    first = driven.index(0.0) / 20.0
    # the wheels are commanded from the first tick on; two ticks until the stall counts
    assert first == pytest.approx(0.8 + 0.1, abs=0.051)
    again = driven.index(0.3, driven.index(0.0)) / 20.0
    assert again - first == pytest.approx(1.0, abs=0.01)
    assert 0.0 in driven[round(20 * again) :], "still stalled: it stands again"
    assert driving(monitor, 5.0, 6.5, 0.3, 0.3)[-1] == 0.3


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
    drive, back = Drive(), Twist(-0.15, 0.0)
    assert drive.run(3.0, back).v == back.v, "with valid frames as far as there is room"
    monitor = monitor_with()
    assert reversed_blindly(monitor, -0.1, 10.0) == pytest.approx(0.3, abs=0.011)
    verdict = monitor.limit(Twist(-0.1, 0.5), 10.0, ORIGIN)
    assert (verdict.twist.w, verdict.reason) == (0.5, "longest reverse without a valid frame")
    assert monitor.limit(Twist(0.0, 0.5), 10.0, ORIGIN).reason == "", "a turn is no reverse"
    monitor.reset()
    assert reversed_blindly(monitor, -0.05, 15.0) == pytest.approx(0.3, abs=0.011)
    # a valid frame allows for the whole distance again
    monitor.update(reading(15.0, picture()), odometry(15.0))
    assert monitor.limit(Twist(-0.1, 0.0), 15.0, ORIGIN).twist.v == -0.1


def test_probes_of_silent_encoders_are_short_and_slow() -> None:
    monitor, forward, backward = started(), list[float](), list[float]()
    for tick in range(1, 60 * 7):
        time = tick / 60.0
        monitor.update(reading(time, picture()), odometry(time, silent=True))
        for driven, v in ((forward, 0.4), (backward, -0.1)):
            twist = monitor.limit(Twist(v, 0.3), time, ORIGIN).twist
            driven.append(twist.v)
            assert twist.w == 0.3
    probing = {k + 1 for k, v in enumerate(forward) if v}
    assert {forward[k - 1] for k in probing} == {monitor.params.probe}
    assert {-backward[k - 1] for k in probing} == {monitor.params.probe}
    assert {k + 1 for k, v in enumerate(backward) if v} == probing
    # the last 0.3 s of every 3 s
    expected = {k for k in range(1, 60 * 7) if (k / 60.0) % 3.0 > 2.7}
    assert len(probing ^ expected) <= 2
    reason = monitor.limit(Twist(0.4, 0.0), 7.0, ORIGIN).reason
    assert reason == "the wheel encoders do not count"
    monitor.update(reading(8.0, picture()), odometry(8.0))
    assert monitor.limit(Twist(0.4, 0.0), 8.0, ORIGIN).twist.v == 0.4


@pytest.mark.parametrize(
    ("image", "encoder_age", "silent", "text"),
    [
        (None, 0.0, False, "the camera is silent, for 21 s"),
        (np.zeros((120, 160), np.uint8), 0.0, False, "the camera image is dark, for 21 s"),
        (picture(), 1.0, False, "the wheel encoders do not count, for 20 s"),
        (picture(), 0.0, True, "the wheel encoders do not count, for 20 s"),
    ],
    ids=["no frames", "dark frames", "no counts", "wheels that do not count"],
)
def test_a_sensor_that_fails_for_long_ends_the_run(
    image: Image | None, encoder_age: float, silent: bool, text: str
) -> None:
    monitor = started()
    for time, failed in ((10.0, False), (19.9, False), (20.6, True)):
        now = reading(time, image, encoder_age=encoder_age * time)
        monitor.update(now, odometry(time, silent=silent))
        assert (monitor.failure is not None) == failed
    assert monitor.failure is not None
    assert (monitor.failure.part, monitor.failure.reason) == ("sensor", text)
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


# --- thresholds ---------------------------------------------------------------------------------


def test_without_blind_reverse_the_robot_reverses_only_by_sight() -> None:
    monitor, back = monitor_with(blind_reverse=0.0), Twist(-0.1, 0.0)
    for time, image, speed in ((0.0, picture(), -0.1), (2.0, None, 0.0), (2.1, picture(), -0.1)):
        monitor.update(reading(time, image), odometry(time, v=-0.1))
        assert monitor.limit(back, time, ORIGIN).twist.v == speed


def test_no_age_may_be_longer_than_a_minute() -> None:
    assert monitor_with(encoder_stop=60.0).params.encoder_stop == 60.0
    with pytest.raises(ValueError, match="60"):
        monitor_with(encoder_stop=60.5)


def test_of_a_silent_camera_and_a_failing_stage_the_longer_failure_is_given() -> None:
    for since, why in ((1.9, "the camera is late"), (0.5, "flow mine fails")):
        monitor = started(camera_slow=0.1, camera_stop=9.0)
        stage = FailingStage("flow mine", since, "broken")
        monitor.update(reading(2.0, picture(), frame_age=1.0), odometry(2.0, 0.3), (stage,))
        assert monitor.limit(Twist(0.4, 0.0), 2.0, ORIGIN).reason == why
