"""Pitch of a body that rocks, by the rates of its gyro."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from painted_floor import KNOWN, ORIGIN, ROBOT, PaintedFloor
from plan_samples import arcs

from navfw.egomotion import Odometer
from navfw.egomotion.floor_odometry import FloorOdometry
from navfw.egomotion.floor_registration import FloorRegistration
from navfw.egomotion.odometer import OdometryHistory, RockingFilter
from navfw.egomotion.pairing import camera_place
from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Encoders, Frame, Inertial, Odometry, Pose, Twist
from navfw.stack.vision import ready_frame

DT = 1.0 / 60.0
NOISE, BIAS = math.radians(0.1), math.radians(0.05)


def readings(
    pitch: Array, turning: float = 0.0, noise: float = NOISE, bias: float = BIAS, seed: int = 0
) -> Iterator[Inertial]:
    """A gyro on a body of these pitches, one a reading, that turns about the vertical."""
    rng = np.random.default_rng(seed)
    for k, rate in enumerate(np.diff(pitch) / DT):
        true = (-turning * math.sin(pitch[k]), rate, turning * math.cos(pitch[k]))
        yield Inertial(k * DT, *(np.array(true) + bias + rng.normal(0.0, noise, 3)).tolist())


def fed(
    rocking: RockingFilter, inertials: Iterator[Inertial], turning: float = 0.0, still: bool = False
) -> Array:
    """The pitch after each reading."""
    pitches = []
    for inertial in inertials:
        rocking.update(inertial, turning, DT, still)
        pitches.append(rocking.pitch)
    return np.array(pitches)


def rested(noise: float = NOISE, bias: float = BIAS) -> RockingFilter:
    rocking = RockingFilter()
    fed(rocking, readings(np.zeros(90), 0.0, noise, bias, seed=9), still=True)
    return rocking


@given(
    degrees=st.floats(0.8, 4.0),
    period=st.floats(0.4, 5.0),
    turning=st.floats(-0.6, 0.6),
    seed=st.integers(0, 9),
)
@settings(max_examples=30)
def test_a_swing_is_followed_whatever_bias_and_turn(
    degrees: float, period: float, turning: float, seed: int
) -> None:
    times = np.arange(0.0, 10.0, DT)
    true = math.radians(degrees) * np.sin(2.0 * math.pi / period * times)
    estimate = fed(rested(), readings(true, turning, seed=seed), turning)
    error = np.degrees(estimate - true[1:])[round(period / DT) :]
    assert np.sqrt((error**2).mean()) < 0.12 + 0.12 * degrees


@pytest.mark.parametrize("worse", [1.0, 3.0])
def test_a_body_that_does_not_rock_is_level_to_the_last_bit(worse: float) -> None:
    noise, bias = worse * NOISE, 2.0 * worse * BIAS
    rocking = rested(noise, bias)
    assert not fed(rocking, readings(np.zeros(3000), 0.5, noise, bias), 0.5).any()
    assert rocking.rocking == 0.0


def test_a_body_that_stays_tipped_over_is_seen_in_turns() -> None:
    tipped = np.full(240, math.radians(-1.5))
    rocking = rested()
    fed(rocking, readings(np.concatenate([np.linspace(0.0, tipped[0], 12), tipped])))
    assert math.degrees(rocking.pitch) == pytest.approx(-1.1, abs=0.25)
    fed(rocking, readings(np.full(3600, tipped[0])))
    assert abs(math.degrees(rocking.pitch)) < 0.5, "without turns it is forgotten"
    swing = math.radians(0.5) * np.sin(np.linspace(0.0, 40.0, 600))
    fed(rocking, readings(tipped[0] + swing, 0.8), 0.8)
    true = math.degrees(tipped[0] + swing[-1])
    assert math.degrees(rocking.pitch) == pytest.approx(true, abs=0.4)


def test_a_tip_at_rest_is_no_bias() -> None:
    """It tips by 2 degrees within the first second, before the bias is known."""
    tip = np.linspace(0.0, math.radians(2.0), 15)
    rocking = RockingFilter()
    fed(rocking, readings(np.concatenate([np.zeros(20), tip, np.full(150, tip[-1])])), still=True)
    assert rocking._biases == pytest.approx([BIAS, BIAS], abs=math.radians(0.05))
    before = rocking._pitch
    fed(rocking, readings(np.concatenate([np.zeros(60), tip, np.full(9, tip[-1])])), still=True)
    assert rocking._biases == pytest.approx([BIAS, BIAS], abs=math.radians(0.1))
    assert rocking.pitch - before == pytest.approx(tip[-1], abs=math.radians(0.4)), "nor later"
    fed(rocking, readings(np.linspace(0.0, 1.0, 60)))
    assert rocking.pitch == 0.2, "no body leans further"


def test_a_gyro_with_one_axis_and_an_old_reading_say_nothing() -> None:
    odometer, level = Odometer(RobotModel()), []
    for k in range(200):
        rates = (math.nan, math.nan, 0.1) if k % 2 else (0.0, 0.9, 0.1)
        time = k * DT if k % 2 else -1.0
        odometry = odometer.update(Inertial(time, *rates), Encoders(k * DT, 100 * k, 100 * k))
        level.append((odometry.pitch, odometry.rocking))
    assert set(level) == {(0.0, 0.0)}
    for k in range(200, 230):
        inertial = Inertial(k * DT, 0.0, 0.1, 0.1)
        odometry = odometer.update(inertial, Encoders(k * DT, 100 * k, 100 * k))
    assert odometry.pitch == pytest.approx(0.05, rel=0.03)
    assert odometry.rocking == pytest.approx(0.05 * math.exp(-0.125), rel=0.05)
    odometer.reset()
    again = odometer.update(inertial, Encoders(9.0, 0, 0))
    assert (again.pitch, again.rocking) == (0.0, 0.0)


def levelled(image: Image, pitch: float) -> Image:
    """``image`` as the stack hands it on, of a body that leans by ``pitch``."""
    history = OdometryHistory()
    history.add(Odometry(0.0, ORIGIN, Twist(0.0, 0.0), 0.0, still=False, pitch=pitch))
    frame = ready_frame(Frame(0.0, image), ROBOT, 1, history)
    assert frame is not None
    return frame.image


@pytest.mark.parametrize("degrees", [-2.5, 1.5])
def test_a_levelled_view_is_that_of_a_camera_that_has_only_moved(degrees: float) -> None:
    pitch = math.radians(degrees)
    place = camera_place(ROBOT, pitch)
    assert place == pytest.approx([0.1 + 0.3 * pitch, 0.0, -0.1 * pitch], abs=3e-4)
    moved = CameraModel(mount_height=0.35 + place[2], mount_forward=place[0])
    level = PaintedFloor(camera=moved).view(ORIGIN).astype(float)[85:112]
    leaning = PaintedFloor().view(ORIGIN, pitch=pitch)
    assert np.abs(leaning[85:112] - level).mean() > 15.0
    assert np.abs(levelled(leaning, pitch)[85:112] - level).mean() < 3.0, "noise alone gives 2.2"
    assert (levelled(leaning, 0.0) == leaning).all()


@given(
    lean=st.tuples(*[st.floats(-0.04, 0.04)] * 2),
    way=st.floats(-0.08, 0.12),
    turn=st.floats(-0.1, 0.1),
)
@settings(max_examples=20)
def test_motion_between_images_of_a_body_that_rocks(
    lean: tuple[float, float], way: float, turn: float
) -> None:
    true = Pose(way, 0.5 * way * turn, turn)
    floor, registration = PaintedFloor(), FloorRegistration(ROBOT)
    past, now = (
        registration.prepare(levelled(floor.view(pose, pitch=pitch), pitch), pitch)
        for pose, pitch in zip((ORIGIN, true), lean, strict=True)
    )
    guess = Pose(true.x + 0.003, true.y - 0.0005, true.yaw + 0.002)
    step = registration.register(past, now, guess, KNOWN)
    assert step is not None
    assert (step.pose.x, step.pose.y) == pytest.approx((true.x, true.y), abs=1.5e-3)
    assert step.pose.yaw == pytest.approx(turn, abs=2e-3)


def rocked(gyro: bool, seed: int) -> tuple[FloorOdometry, float, list[str]]:
    """Odometry after 4 s on a body that rocks by 2 degrees, its error of the way [m], its doubts.

    Without ``gyro`` nothing is known of the rocking.
    """
    odometry, floor, doubts = FloorOdometry(ROBOT), PaintedFloor(seed=seed), []
    for k, (true, driven) in enumerate(arcs(ORIGIN, [(4.0, 0.3, 0.1)])):
        raw, pitch = driven, math.radians(2.0) * math.sin(2.4 * k)
        image = floor.view(true, pitch=pitch)
        if gyro:
            image = levelled(image, pitch)
            raw = replace(driven, pitch=pitch, rocking=math.radians(2.0))
        odometry.observe(Frame(raw.time, image), raw)
        doubts.append(odometry.corrected(raw).doubt)
    pose = odometry.corrected(raw).pose
    return odometry, math.dist((pose.x, pose.y), (true.x, true.y)), doubts


def test_a_body_that_rocks_is_corrected_by_the_floor_as_any_other() -> None:
    odometry, error, doubts = rocked(gyro=True, seed=8)
    assert error < 0.012
    assert not any(doubts)
    assert abs(odometry.calibration[0]) < 1e-9, "its scale says nothing of the wheels"


def test_a_floor_that_contradicts_wheels_and_gyro_is_not_believed() -> None:
    _, error, doubts = rocked(gyro=False, seed=8)
    begin = next(k for k, doubt in enumerate(doubts) if doubt)
    assert "is not believed: 4" in doubts[begin]
    assert error < 0.03
