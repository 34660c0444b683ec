"""The simulation as a whole: driving, contacts, timing, determinism, readings without truth."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from navfw.errors import SimulationError, WorldError
from navfw.robot import RobotModel
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Twist
from navfw.sim import BoxSpec, CylinderSpec, SensorParams, Simulation, WallSpec, WorldSpec

ROBOT = RobotModel()
TICK = 1.0 / 60.0
WORLD = WorldSpec(
    name="hall",
    x=(-6, 6),
    y=(-6, 6),
    walls=(WallSpec(name="north", points=((3, -6), (3, 6))),),
    boxes=(BoxSpec(name="crate", at=(-3, 3), size=(1, 1, 0.5)),),
    cylinders=(CylinderSpec(name="column", at=(-3, -3), radius=0.3),),
)
PERFECT = SensorParams.preset("perfect")


def simulate(start: Pose, seed: int = 0, sensors: SensorParams = PERFECT) -> Simulation:
    return Simulation(WORLD, ROBOT, start, seed, sensors)


def drive(sim: Simulation, twist: Twist, seconds: float) -> None:
    """Accelerate as LOCOM does, then keep the speed."""
    ramp = max(abs(twist.v) / ROBOT.max_accel, abs(twist.w) / ROBOT.max_turn_accel)
    for i in range(round(seconds / TICK)):
        share = min((i + 1) * TICK / ramp, 1.0)
        sim.drive(*ROBOT.wheel_speeds(Twist(share * twist.v, share * twist.w)))
        sim.advance(TICK)


def test_drives_straight() -> None:
    with simulate(Pose(-3, 0, 0)) as sim:
        drive(sim, Twist(0.3, 0.0), 5.0)
        end = sim.true_pose()
    assert end.x + 3 == pytest.approx(0.3 * (5.0 - 0.25), rel=0.01)
    assert abs(end.y) < 0.005
    assert abs(end.yaw) < 0.003


@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_turns_on_the_spot(rate: float) -> None:
    with simulate(Pose(0, 0, 0.3)) as sim:
        drive(sim, Twist(0.0, rate), 2.5)
        end = sim.true_pose()
    assert end.yaw - 0.3 == pytest.approx(rate * (2.5 - 0.125), rel=0.02)
    assert math.hypot(end.x, end.y) < 0.002


def test_does_not_wobble() -> None:
    with simulate(Pose(-2, 0, 0)) as sim:
        attitudes = []
        for i in range(120):
            speed = 0.5 if (i // 30) % 2 == 0 else 0.0  # steps beyond LOCOM's acceleration limits
            sim.drive(*ROBOT.wheel_speeds(Twist(speed, 0.5)))
            sim.advance(TICK)
            inertial = sim.read().inertial
            attitudes.append((inertial.roll_rate, inertial.pitch_rate))
    # 0.01 rad/s over a frame pair is a twentieth of a pixel
    assert np.abs(attitudes).max() < 0.01


def test_perfect_sensors_measure_the_motion() -> None:
    with simulate(Pose(0, 0, 0)) as sim:
        drive(sim, Twist(0.2, 0.0), 1.0)
        sim.read()
        heading = 0.0
        for _ in range(60):
            sim.drive(*ROBOT.wheel_speeds(Twist(0.2, 0.5)))
            sim.advance(TICK)
            heading += sim.read().inertial.yaw_rate * TICK
        end, encoders = sim.true_pose(), sim.read().encoders
    assert heading == pytest.approx(end.yaw, abs=1e-4)
    travelled = math.pi * ROBOT.wheel_radius * (encoders.left + encoders.right)
    assert travelled / ROBOT.ticks_per_turn == pytest.approx(0.2 * 2.0 - 0.2 * 0.17, abs=0.01)


@pytest.mark.parametrize(
    ("start", "name"),
    [
        (Pose(2.2, 0, 0), "north"),
        (Pose(-3, 1.8, math.pi / 2), "crate"),
        (Pose(-3, -2.0, -math.pi / 2), "column"),
    ],
)
def test_contacts_are_named(start: Pose, name: str) -> None:
    with simulate(start) as sim:
        touched: list[tuple[float, tuple[str, ...]]] = []
        for _ in range(180):
            sim.drive(*ROBOT.wheel_speeds(Twist(0.3, 0.0)))
            sim.advance(TICK)
            if sim.contacts:
                touched.append(
                    (sim.plan.clearance(sim.true_pose().x, sim.true_pose().y), sim.contacts)
                )
    assert touched
    assert {names for _, names in touched} == {(name,)}
    # the first contact is when the body's edge arrives, not earlier
    assert touched[0][0] == pytest.approx(ROBOT.radius, abs=0.005)


def test_no_contact_with_the_floor() -> None:
    with simulate(Pose(0, 0, 0)) as sim:
        drive(sim, Twist(0.3, 1.0), 1.0)
        assert sim.contacts == ()


def test_clock_and_camera_rate() -> None:
    with simulate(Pose(0, 0, 0)) as sim:
        times = []
        for _ in range(61):
            reading = sim.read()
            assert reading.time == pytest.approx(sim.time, abs=1e-9)
            if reading.frame is not None:
                assert reading.frame.image.shape == (120, 160)
                assert reading.frame.image.dtype == np.uint8
                times.append(reading.frame.time)
            sim.advance(TICK)
        assert sim.timings.steps == 61 * 4
        assert sim.timings.frames == 11
    assert times == pytest.approx(np.arange(11) * 0.1)


def test_reading_twice_draws_no_noise() -> None:
    with simulate(Pose(0, 0, 0), sensors=SensorParams()) as sim:
        assert sim.read() is sim.read()


def record(seed: int) -> str:
    """A digest of all sensor readings of a short drive."""
    digest = hashlib.sha256()
    with simulate(Pose(1.0, 0.5, 0.4), seed, SensorParams()) as sim:
        for i in range(40):
            reading = sim.read()
            digest.update(repr((reading.time, reading.inertial, reading.encoders)).encode())
            if reading.frame is not None:
                digest.update(reading.frame.image.tobytes())
            sim.drive(*ROBOT.wheel_speeds(Twist(0.4, math.sin(0.3 * i))))
            sim.advance(TICK)
    return digest.hexdigest()


@pytest.mark.thorough
def test_same_seed_same_bytes_in_a_fresh_process() -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); "
        "from test_sim_simulation import record; print(record(7))"
    )
    fresh = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    # nothing else on stdout: PyBullet's banner is suppressed
    assert fresh.stdout.strip() == record(7)
    assert fresh.stderr == ""
    assert record(8) != record(7)


def test_readings_contain_no_ground_truth() -> None:
    """The stack gets images, rates, counts and the time, but no pose, depth or names."""
    assert {f.name for f in dataclasses.fields(SensorReading)} == {
        *("time", "inertial", "encoders", "frame", "landmark_frame")
    }
    with simulate(Pose(1.0, 0.5, 0.4), sensors=SensorParams.preset("poor")) as sim:
        drive(sim, Twist(0.3, 0.6), 1.0)
        reading = sim.read()
        sim.advance(0.1)
        frame = sim.read().frame
    assert type(reading.inertial) is Inertial
    assert type(reading.encoders) is Encoders
    assert type(frame) is Frame
    # the gyro's rate has an error
    assert abs(reading.inertial.yaw_rate - 0.6) > 1e-6
    # no memory shared with the renderer's depth, no colour, no segmentation
    assert frame.image.dtype == np.uint8
    assert frame.image.ndim == 2


def test_start_must_be_free() -> None:
    with pytest.raises(WorldError, match=r"the start .* 'crate'"):
        simulate(Pose(-3, 3, 0))
    with pytest.raises(WorldError, match="on the floor"):
        simulate(Pose(-20, 3, 0))


def test_misuse_raises() -> None:
    with simulate(Pose(0, 0, 0)) as sim:
        with pytest.raises(SimulationError, match="finite"):
            sim.drive(math.nan, 0.0)
        with pytest.raises(SimulationError, match="no frame"):
            sim.true_depth()
    sim.close()
