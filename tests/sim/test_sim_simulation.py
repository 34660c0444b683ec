"""The simulation as a whole: driving, contacts, timing, determinism, readings without truth.

Round robots and those of a URDF; bodies that several solids share.
"""

import dataclasses
import hashlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import sim_worlds
from processes import run
from sim_worlds import PERFECT, TICK, drive

from navfw.config import find
from navfw.errors import SimulationError, WorldError
from navfw.numerics import Array
from navfw.robot import RobotModel, load_robot
from navfw.signals import Encoders, Frame, Inertial, Pose, SensorReading, Twist
from navfw.sim import SensorParams, Simulation, WorldSpec, load_world
from navfw.sim.worldspec import BoxSpec, CylinderSpec, OpeningSpec, WallSpec

ROBOT = RobotModel()
WORLD = WorldSpec(
    name="hall",
    x=(-6, 6),
    y=(-6, 6),
    walls=(WallSpec(name="north", points=((3, -6), (3, 6))),),
    boxes=(BoxSpec(name="crate", at=(-3, 3), size=(1, 1, 0.5)),),
    cylinders=(CylinderSpec(name="column", at=(-3, -3), radius=0.3),),
)

FIELD = WorldSpec(
    name="field",
    x=(-3, 8),
    y=(-3, 8),
    cylinders=tuple(
        CylinderSpec(name=f"pole-{i}-{j}", at=(i, j), radius=0.08, height=1.2)
        for i in range(6)
        for j in range(6)
    ),
    boxes=(BoxSpec(name="crate", at=(2.5, 2.5), size=(0.3, 0.5, 0.7), yaw=0.5),),
)


OPENINGS = (OpeningSpec(name=f"gap-{i}", at=(2.0 + 2.0 * i, 0.0), width=0.9) for i in range(12))
LONG = WallSpec(name="long", points=((0, 0), (26, 0)), openings=tuple(OPENINGS))
PIECES = WorldSpec(name="hall", x=(-2, 28), y=(-3, 3), walls=(LONG,))


def simulate(start: Pose, seed: int = 0, sensors: SensorParams = PERFECT) -> Simulation:
    return Simulation(WORLD, ROBOT, start, seed, sensors)


def accelerate(sim: Simulation, twist: Twist, seconds: float) -> None:
    """Accelerate as LOCOM does, then keep the speed."""
    ramp = max(abs(twist.v) / ROBOT.max_accel, abs(twist.w) / ROBOT.max_turn_accel)
    for i in range(round(seconds / TICK)):
        share = min((i + 1) * TICK / ramp, 1.0)
        sim.drive(*ROBOT.wheel_speeds(Twist(share * twist.v, share * twist.w)))
        sim.advance(TICK)


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
        accelerate(sim, Twist(0.2, 0.0), 1.0)
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
    ("world", "start", "name"),
    [
        (WORLD, Pose(2.2, 0, 0), "north"),
        (WORLD, Pose(-3, 1.8, math.pi / 2), "crate"),
        (WORLD, Pose(-3, -2.0, -math.pi / 2), "column"),
        (FIELD, Pose(-0.6, 2, 0), "pole-0-2"),
        (FIELD, Pose(5.6, 4, math.pi), "pole-5-4"),
        (FIELD, Pose(2.5, 1.8, math.pi / 2), "crate"),
        (PIECES, Pose(25.0, -0.5, math.pi / 2), "long"),
    ],
)
def test_contacts_are_named(world: WorldSpec, start: Pose, name: str) -> None:
    with Simulation(world, ROBOT, start, 0, PERFECT) as sim:
        drive(sim, 3.0, 6.0, 6.0, until_contact=True)
        # the first contact is when the body's edge arrives, not earlier
        clearance = sim.plan.clearance(sim.true_pose().x, sim.true_pose().y)
        assert clearance == pytest.approx(ROBOT.radius, abs=0.005)
        touched = {sim.contacts}
        for _ in range(60):
            sim.advance(TICK)
            touched |= {sim.contacts} - {()}
    assert touched == {(name,)}


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
    with simulate(Pose(0, 0, 0), sensors=SensorParams()) as sim:
        assert sim.read() is sim.read()  # reading twice draws no noise


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
    folders = [str(Path(__file__).parent), str(Path(sim_worlds.__file__).parent)]
    code = (
        f"import sys; sys.path[:0] = {folders}; "
        "from test_sim_simulation import record; print(record(7))"
    )
    fresh = run([sys.executable, "-c", code], check=True)
    # nothing else on stdout: PyBullet's banner is suppressed
    assert fresh.stdout.strip() == record(7)
    assert fresh.stderr == ""
    assert record(8) != record(7)


def test_readings_contain_no_ground_truth() -> None:
    """The stack gets images, rates, counts and the time, but no pose, depth or names."""
    names = {f.name for f in dataclasses.fields(SensorReading)}
    assert names == {"time", "inertial", "encoders", "frame", "landmark_frame"}
    with simulate(Pose(1.0, 0.5, 0.4), sensors=SensorParams.preset("poor")) as sim:
        frame = sim.read().frame
        accelerate(sim, Twist(0.3, 0.6), 1.0)
        reading = sim.read()
    assert [type(reading.inertial), type(reading.encoders)] == [Inertial, Encoders]
    assert abs(reading.inertial.yaw_rate - 0.6) > 1e-6  # the gyro's rate has an error
    # no memory shared with the renderer's depth, no colour, no segmentation
    assert type(frame) is Frame
    assert frame.image.dtype == np.uint8
    assert frame.image.ndim == 2


def test_misuse_and_a_start_that_is_not_free_raise() -> None:
    for x, message in ((-3, r"the start .* 'crate'"), (-20, "on the floor")):
        with pytest.raises(WorldError, match=message):
            simulate(Pose(x, 3, 0))
    with simulate(Pose(0, 0, 0)) as sim:
        with pytest.raises(SimulationError, match="finite"):
            sim.drive(math.nan, 0.0)
        with pytest.raises(SimulationError, match="no frame"):
            sim.true_depth()
    sim.close()


def test_solids_may_overlap_with_may_overlap() -> None:
    boxes = [BoxSpec(name=name, at=(0, 0), size=(1, 1, 1)) for name in ("a", "b")]
    world = WorldSpec(name="pile", x=(-3, 3), y=(-3, 3), boxes=tuple(boxes), may_overlap=True)
    with Simulation(world, ROBOT, Pose(2, 0, 0), 0) as sim:
        assert sim.plan.clearance(2.0, 0.0) == pytest.approx(1.5)


EMPTY = load_world(find("world", "empty"))
START = Pose(0.5 * sum(EMPTY.x), 0.5 * sum(EMPTY.y), 0.4)


def drive_robot(
    name: str, twist: Twist, seconds: float, world: WorldSpec = EMPTY, start: Pose = START
) -> tuple[Array, tuple[float, float], set[str]]:
    """True poses (n, 3) at 60 Hz, the wheels' way [m], and what was touched."""
    robot = load_robot(name)
    poses, touched = [], set()
    with Simulation(world, robot, start, 0, PERFECT) as simulation:
        begun = simulation.read().encoders
        for tick in range(round(seconds * 60)):
            ramp = min(1.0, tick / 20)
            simulation.drive(*(ramp * speed for speed in robot.wheel_speeds(twist)))
            simulation.advance(TICK)
            reading = simulation.read()
            pose = simulation.true_pose()
            poses.append((pose.x, pose.y, pose.yaw))
            touched |= set(simulation.contacts)
    per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
    left = (reading.encoders.left - begun.left) * per_tick
    right = (reading.encoders.right - begun.right) * per_tick
    return np.array(poses), (left, right), touched


@pytest.mark.parametrize("name", ["default", "cart", "husky", "racecar", "rocking"])
def test_it_drives_straight_and_its_encoders_measure_the_way(name: str) -> None:
    off, turn = (0.008, 0.003) if name == "default" else (0.04, 0.02)
    poses, (left, right), touched = drive_robot(name, Twist(0.4, 0.0), 2.0)
    way = math.dist(poses[-1, :2], (START.x, START.y))
    assert way == pytest.approx(0.73, abs=off)
    assert left == pytest.approx(way, rel=0.03)
    assert right == pytest.approx(way, rel=0.03)
    assert poses[-1, 2] == pytest.approx(START.yaw, abs=turn)
    course = math.atan2(poses[-1, 1] - START.y, poses[-1, 0] - START.x)
    assert course == pytest.approx(START.yaw, abs=2.0 * turn)
    assert not touched


@pytest.mark.parametrize("rate", [0.8, -0.8])
@pytest.mark.parametrize(
    ("name", "spread", "away"),
    [
        ("default", 0.01, 0.002),
        ("cart", 0.02, 0.08),
        ("husky", 0.12, 0.08),
        ("racecar", 0.08, 0.08),
        ("rocking", 0.02, 0.08),
    ],
)
def test_it_turns_on_the_spot_as_fast_as_commanded(
    name: str, spread: float, away: float, rate: float
) -> None:
    poses, _, touched = drive_robot(name, Twist(0.0, rate), 4.0)
    late = poses[60:]
    turned = np.unwrap(late[:, 2])
    assert (turned[-1] - turned[0]) * 60 / (len(late) - 1) == pytest.approx(rate, rel=spread)
    # base_link is where it turns: the turn of a skid steer does not carry it away
    assert np.hypot(*(late[:, :2] - late[0, :2]).T).max() < away
    assert not touched


@pytest.mark.parametrize(("name", "least", "most"), [("default", 0, 0.2), ("rocking", 2.4, 3.2)])
def test_a_light_body_pitches_as_it_starts_and_brakes(name: str, least: float, most: float) -> None:
    robot, pitch = load_robot(name), [0.0]
    with Simulation(EMPTY, robot, START, 0, PERFECT) as simulation:
        for tick in range(180):
            speed = 0.4 * min(1.0, tick / 40, max(0.0, (120 - tick) / 20))
            simulation.drive(*robot.wheel_speeds(Twist(speed, 0.0)))
            simulation.advance(TICK)
            pitch.append(pitch[-1] + TICK * simulation.read().inertial.pitch_rate)
    assert least <= math.degrees(max(pitch) - min(pitch)) <= most


def test_a_contact_of_any_link_is_a_collision() -> None:
    ahead = START.to_parent(1.2, 0.0)
    box = BoxSpec(name="crate", at=ahead, size=(0.2, 0.2, 0.5), yaw=START.yaw)
    world = EMPTY.model_copy(update={"boxes": (box,)})
    _, _, touched = drive_robot("husky", Twist(0.5, 0.0), 3.0, world)
    assert touched == {"crate"}


def test_the_gyro_measures_how_a_body_rocks_and_leans_at_rest_do_not_count(tmp_path: Path) -> None:
    """A caster 6 mm above the floor: the cart rests on the other one, and tips when it brakes."""
    shipped = find("robot", "cart")
    urdf = (shipped.parent / "urdf" / "cart.urdf").read_text()
    assert 'xyz="0.17 0 0.03"' in urdf
    urdf = urdf.replace('xyz="0.17 0 0.03"', 'xyz="0.17 0 0.036"')
    (tmp_path / "cart.urdf").write_text(urdf.replace('xyz="0 0 0.12"', 'xyz="-0.01 0 0.3"'))
    text = shipped.read_text().replace("urdf/cart.urdf", "cart.urdf")
    (tmp_path / "tipping.yaml").write_text(text)
    robot = load_robot(tmp_path / "tipping.yaml")
    with Simulation(EMPTY, robot, Pose(1.0, 1.0, 0.0), 0, PERFECT) as sim:
        assert abs(pitch_of(sim)) < 1e-6
        turned, pitches = 0.0, []
        for seconds, speed in ((1.5, 8.0), (0.1, 0.0), (0.1, 0.0), (1.0, 0.0)):
            for reading in drive(sim, seconds, speed, speed):
                turned += reading.inertial.pitch_rate * TICK
            ahead = sim.read().inertial.pitch_rate * TICK
            pitches.append(pitch_of(sim))
            assert turned + ahead == pytest.approx(pitches[-1], abs=1e-4)
        assert max(pitches) > math.radians(0.5)


def pitch_of(sim: Simulation) -> float:
    """The true pitch [rad] of base_link, nose down."""
    x, y, z, w = sim._truth()[0][1]
    return math.asin(2.0 * (w * y - z * x))
