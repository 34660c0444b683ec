"""Sensor models have the specified statistics; faults and changes have an effect and an end."""

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from pydantic import ValidationError
from sim_worlds import PERFECT, TICK, drive, frames

from navfw.config import find
from navfw.errors import UnknownNameError
from navfw.numerics import Array, Image
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import SensorParams, Simulation, WorldSpec, load_world
from navfw.sim.event_actions import (
    CameraFault,
    DoorChange,
    EncoderFault,
    EventAction,
    GyroFault,
    LightChange,
    Obstacle,
    Slippery,
    Textureless,
    WeakWheel,
)
from navfw.sim.sensor_models import PRESETS, GyroModel, WheelEncoderModel
from navfw.sim.solids import drop_rectangle
from navfw.sim.world_changes import CLEAR_OF_ROBOT
from navfw.sim.worldspec import DoorSpec, DropSpec, OpeningSpec, WallSpec

ROBOT = RobotModel()
START = Pose(1.0, 1.5, 0.3)
ROOM = load_world(find("world", "paper-room"))


@pytest.fixture
def room() -> Iterator[Simulation]:
    with Simulation(ROOM, ROBOT, START, 0, PERFECT) as simulation:
        yield simulation


def frame_with(simulation: Simulation, *actions: EventAction) -> Image:
    """The next frame, with ``actions`` active."""
    for action in actions:
        simulation.begin(action)
    simulation.advance(0.1)
    frame = simulation.read().frame
    for action in actions:
        simulation.end(action)
    assert frame is not None
    return frame.image


def same(one: Image, other: Image) -> bool:
    """Equal except for the residual settling of a standing robot."""
    return float(np.abs(one.astype(float) - other).mean()) < 0.7


def test_dropped_frames_are_missing(room: Simulation) -> None:
    room.begin(CameraFault(dropped=0.5))
    assert 12 <= len(frames(drive(room, 5.0, 0.0, 0.0))) <= 38
    room.end(CameraFault(dropped=0.5))
    assert len(frames(drive(room, 1.0, 0.0, 0.0))) == 10


def test_frozen_image_repeats_although_the_robot_moves(room: Simulation) -> None:
    before = frames(drive(room, 1.0, 4.0, 4.0))[-1]
    room.begin(CameraFault(frozen=True))
    stuck = frames(drive(room, 1.0, 4.0, 4.0))
    assert len(stuck) == 10
    assert all(np.array_equal(frame.image, before.image) for frame in stuck)
    assert stuck[-1].time > before.time + 0.9
    room.end(CameraFault(frozen=True))
    assert not np.array_equal(frames(drive(room, 0.2, 4.0, 4.0))[0].image, before.image)


def test_delayed_frames_keep_their_time_of_capture(room: Simulation) -> None:
    room.begin(CameraFault(latency=0.3))
    readings = drive(room, 2.0, 4.0, 4.0)
    late = [(r.time, r.frame.time) for r in readings if r.frame is not None]
    assert len(late) == 17
    assert all(now - captured == pytest.approx(0.3, abs=TICK) for now, captured in late)
    room.end(CameraFault(latency=0.3))
    after = [(r.time, r.frame.time) for r in drive(room, 0.5, 0, 0) if r.frame is not None]
    assert all(now == captured for now, captured in after)


def test_images_black_over_exposed_noisy_and_blurred(room: Simulation) -> None:
    clean = frame_with(room)
    assert same(frame_with(room), clean)
    assert not frame_with(room, CameraFault(black=True)).any()
    assert frame_with(room, CameraFault(over_exposed=True)).mean() > 247
    noise = frame_with(room, CameraFault(noisy=12.0)).astype(float) - clean
    assert noise[(clean > 50) & (clean < 205)].std() == pytest.approx(12.0, rel=0.1)

    def detail(image: Image) -> float:
        return float(np.abs(cv2.Laplacian(image.astype(np.float32), cv2.CV_32F)).mean())

    assert detail(frame_with(room, CameraFault(blurred=1.5))) < 0.3 * detail(clean)
    assert same(frame_with(room), clean)
    with Simulation(ROOM, ROBOT, START, 0) as simulation:  # black images have sensor noise
        assert 0.0 < frame_with(simulation, CameraFault(black=True)).mean() < 5.0


def fine(image: npt.NDArray[Any]) -> Array:
    """What is finer than 4 px in an image (height, width), without the light on the walls."""
    grey = image.astype(np.float64)
    return np.asarray(grey - cv2.GaussianBlur(grey, (0, 0), 4.0))


def test_hfov_error_widens_the_true_field_of_view(room: Simulation) -> None:
    clean = frame_with(room)
    wide = frame_with(room, CameraFault(hfov_error=0.1))
    focal = 0.5 * ROBOT.camera.width / math.tan(0.5 * 1.1 * ROBOT.camera.hfov)
    shrunk = cv2.resize(clean, None, fx=focal / ROBOT.camera.focal, fy=focal / ROBOT.camera.focal)
    rows, columns = shrunk.shape
    top, left = (wide.shape[0] - rows) // 2, (wide.shape[1] - columns) // 2
    inner = wide[top : top + rows, left : left + columns]
    assert np.corrcoef(inner.ravel(), shrunk.ravel())[0, 1] > 0.75
    assert np.corrcoef(fine(wide).ravel(), fine(clean).ravel())[0, 1] < 0.4
    assert np.corrcoef(fine(inner).ravel(), fine(shrunk).ravel())[0, 1] > 0.4


def test_light_is_dimmed_and_switched_off(room: Simulation) -> None:
    clean = frame_with(room).mean()
    assert frame_with(room, LightChange(share=0.3)).mean() == pytest.approx(0.3 * clean, rel=0.05)
    assert frame_with(room, LightChange(share=0.0)).max() == 0
    assert frame_with(room).mean() == pytest.approx(clean, abs=0.2)


def test_gyro_dropout_repeats_the_last_reading(room: Simulation) -> None:
    last = drive(room, 0.5, -2.0, 2.0)[-1].inertial
    room.begin(GyroFault(dropout=True))
    assert {r.inertial for r in drive(room, 0.5, 2.0, -2.0)} == {last}
    room.end(GyroFault(dropout=True))
    assert drive(room, 0.1, 2.0, -2.0)[-1].inertial.yaw_rate < -0.5


def test_bias_step_shifts_the_gyros_mean(room: Simulation) -> None:
    room.begin(GyroFault(bias_step=2.0))
    rates = [reading.inertial.yaw_rate for reading in drive(room, 1.0, 0.0, 0.0)]
    assert np.mean(rates) == pytest.approx(math.radians(2.0), abs=1e-3)
    room.end(GyroFault(bias_step=2.0))
    rates = [reading.inertial.yaw_rate for reading in drive(room, 1.0, 0.0, 0.0)]
    assert np.mean(rates) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("side", ["left", "right", "both"])
def test_dead_encoders_do_not_count(room: Simulation, side: str) -> None:
    before = drive(room, 0.5, 4.0, 4.0)[-1].encoders
    fault = EncoderFault.model_validate({"dropout": side})
    room.begin(fault)
    dead = drive(room, 0.5, 4.0, 4.0)[-1].encoders
    assert dead.time > before.time
    assert (dead.left == before.left) == (side in ("left", "both"))
    assert (dead.right == before.right) == (side in ("right", "both"))
    room.end(fault)
    after = drive(room, 0.5, 4.0, 4.0)[-1].encoders
    for name in ("left", "right"):  # what was missed is lost: no jump
        assert 500 < getattr(after, name) - getattr(dead, name) < 800


def test_weak_wheel_turns_less(room: Simulation) -> None:
    room.begin(WeakWheel(side="left", share=0.8))
    encoders = drive(room, 2.0, 4.0, 4.0)[-1].encoders
    assert encoders.left == pytest.approx(0.8 * encoders.right, rel=0.02)


def test_wheels_turn_further_on_slippery_floor(room: Simulation) -> None:
    room.begin(Slippery(slip=0.2))
    encoders = drive(room, 2.0, 4.0, 4.0)[-1].encoders
    rolled = encoders.left / ROBOT.ticks_per_turn * 2.0 * math.pi * ROBOT.wheel_radius
    pose = room.true_pose()
    travelled = math.hypot(pose.x - START.x, pose.y - START.y)
    assert rolled == pytest.approx(1.2 * travelled, rel=0.02)


def test_walls_within_an_area_lose_their_texture(room: Simulation) -> None:
    clean = frame_with(room)
    blank = frame_with(room, Textureless(x=(-500.0, 500.0), y=(-500.0, 500.0)))
    upper = np.s_[: ROBOT.camera.height // 2 - 8, 20:-20]  # walls, well above the floor
    walls = blank[upper] != clean[upper]
    assert walls.mean() > 0.1
    assert fine(blank[upper])[walls].std() < 0.6 * fine(clean[upper])[walls].std()
    lower = np.s_[-20:]
    assert same(blank[lower], clean[lower])
    partly = frame_with(room, Textureless(x=(3.0, 5.0)))
    assert not same(partly, blank)
    assert not same(partly, clean)
    assert same(frame_with(room), clean)


def test_obstacle_appears_ahead_and_is_removed(room: Simulation) -> None:
    clean = frame_with(room)
    thing = Obstacle(ahead=1.5, radius=0.2)
    assert not same(frame_with(room, thing), clean)
    assert same(frame_with(room), clean)
    room.begin(thing)
    drive(room, 4.5, 8.0, 8.0)
    assert room.contacts == ("obstacle",)
    (presence,) = [p for p in room.change_track().presences if p.end == math.inf]
    x, y = START.to_parent(1.5, 0.0)
    assert (presence.shape.x, presence.shape.y) == pytest.approx((x, y), abs=0.01)


def test_obstacle_does_not_appear_above_a_drop() -> None:
    hole = DropSpec(name="pit", x=(1.6, 2.2), y=(1.2, 1.8))
    world = ROOM.model_copy(update={"drops": (hole,)})
    with Simulation(world, ROBOT, Pose(1.0, 1.5, 0.0), 0, PERFECT) as simulation:
        simulation.begin(Obstacle(ahead=0.7, radius=0.1))
        drive(simulation, 0.2, 0.0, 0.0)
        assert simulation.change_track().presences == ()
        drive(simulation, 1.5, -2.0, 2.0)  # turned away from the drop
        (presence,) = simulation.change_track().presences
        middle = np.array([[presence.shape.x, presence.shape.y]])
        assert drop_rectangle(hole).distance(middle)[0] == pytest.approx(0.1, abs=0.03)


def test_obstacle_does_not_appear_on_the_robot(room: Simulation) -> None:
    room.begin(Obstacle(at=(START.x, START.y), radius=0.2))
    room.advance(0.1)
    assert room.contacts == ()
    assert room.change_track().presences == ()
    while not room.change_track().presences:
        drive(room, 0.1, 4.0, 4.0)
        assert room.contacts == ()
    here = room.true_pose()
    away = math.hypot(here.x - START.x, here.y - START.y)
    assert away >= ROBOT.radius + 0.2 + CLEAR_OF_ROBOT


def walls_with_a_door(state: str) -> WorldSpec:
    door = DoorSpec.model_validate({"name": "leaf", "opening": "gap", "state": state})
    gap = OpeningSpec(name="gap", at=(3.0, 2.0), width=1.0)
    wall = WallSpec(name="partition", points=((3.0, 0.0), (3.0, 4.0)), openings=(gap,))
    return WorldSpec(name="two rooms", x=(0.0, 6.0), y=(0.0, 4.0), walls=(wall,), doors=(door,))


@pytest.mark.parametrize("state", ["open", "closed"])
def test_door_closes_and_opens(state: str) -> None:
    other = "closed" if state == "open" else "open"
    change = DoorChange.model_validate({"name": "leaf", "state": other})
    touched = {}
    for changed in (False, True):
        with Simulation(walls_with_a_door(state), ROBOT, Pose(2.2, 2.0, 0.0), 0, PERFECT) as world:
            if changed:
                world.begin(change)
            drive(world, 2.5, 8.0, 8.0)
            touched[changed] = world.contacts
    assert touched[state == "closed"] == ()
    assert touched[state == "open"] == ("leaf",)


def test_door_closes_once_the_robot_is_clear_and_reopens_at_the_end() -> None:
    change = DoorChange(name="leaf", state="closed")
    with Simulation(walls_with_a_door("open"), ROBOT, Pose(3.0, 2.0, 0.0), 0, PERFECT) as world:
        world.begin(change)
        drive(world, 0.5, 0.0, 0.0)
        assert world.contacts == ()
        drive(world, 2.0, 8.0, 8.0)
        assert world.contacts == ()
        (presence,) = world.change_track().presences
        assert presence.begin > 0.5
        world.end(change)
        drive(world, 4.0, -4.0, -4.0)
        assert world.contacts == ()
        assert world.true_pose().x < 3.1


def test_faults_do_not_change_the_noise_of_other_components() -> None:
    seen = []
    for fault in (None, CameraFault(noisy=5.0)):
        with Simulation(ROOM, ROBOT, START, 4) as simulation:
            if fault is not None:
                simulation.begin(fault)
            drive(simulation, 0.5, 2.0, 2.0)
            if fault is not None:
                simulation.end(fault)
            seen.append(drive(simulation, 0.5, 2.0, 2.0))
    for one, other in zip(*seen, strict=True):
        assert (one.inertial, one.encoders) == (other.inertial, other.encoders)
        if one.frame is not None and other.frame is not None:
            assert np.array_equal(one.frame.image, other.frame.image)


def yaw_rates(params: SensorParams, seed: int, count: int, rate: float = 0.0) -> Array:
    gyro = GyroModel(params, np.random.default_rng(seed))
    return np.array([gyro.read(i * TICK, TICK, (0.0, 0.0, rate)).yaw_rate for i in range(count)])


def ticks(params: SensorParams, seed: int, turns: float, count: int = 600) -> tuple[int, int]:
    encoders = WheelEncoderModel(params, ROBOT, np.random.default_rng(seed))
    reading = None
    for angle in np.linspace(0.0, 2.0 * math.pi * turns, count + 1)[1:]:
        reading = encoders.read(0.0, TICK, (angle, angle))
    assert reading is not None
    return reading.left, reading.right


def test_gyro_noise() -> None:
    rates = yaw_rates(PERFECT.model_copy(update={"gyro_noise": 0.01}), 1, 4000)
    assert rates.std() == pytest.approx(0.01, rel=0.05)
    assert abs(rates.mean()) < 4 * 0.01 / math.sqrt(4000)
    # white: consecutive readings are uncorrelated
    assert abs(np.corrcoef(rates[1:], rates[:-1])[0, 1]) < 0.06


def test_gyro_bias_is_constant_and_differs_between_runs() -> None:
    params = PERFECT.model_copy(update={"gyro_bias": 0.01})
    biases = np.array([yaw_rates(params, seed, 2) for seed in range(300)])
    assert np.all(biases[:, 0] == biases[:, 1])
    assert biases[:, 0].std() == pytest.approx(0.01, rel=0.15)


def test_gyro_bias_random_walk() -> None:
    params = PERFECT.model_copy(update={"gyro_bias_walk": 0.002})
    ends = np.array([yaw_rates(params, seed, 600)[-1] for seed in range(100)])
    assert ends.std() == pytest.approx(0.002 * math.sqrt(600 * TICK), rel=0.25)


def test_perfect_sensors_measure_the_true_rate_and_only_quantise() -> None:
    assert np.all(yaw_rates(PERFECT, 0, 10, rate=0.4) == 0.4)
    for turns in (3.3, -3.3):
        left, right = ticks(PERFECT, 0, turns)
        assert left == right == math.floor(turns * ROBOT.ticks_per_turn + 1e-6)
    assert ticks(SensorParams.preset("poor"), 3, 0.0) == (0, 0)  # standing wheels


@pytest.mark.parametrize(
    ("mean", "time", "spread"),
    [
        (1.01, 0.0, 0.02 / math.sqrt(600)),  # 600 independent samples average out
        # a Gauss-Markov process over 10 s with 0.5 s memory: sigma * sqrt(2 * 0.5 / 10)
        (1.0, 0.5, 0.02 * math.sqrt(0.1)),
    ],
)
def test_slip_has_the_specified_mean_and_standard_deviation(
    mean: float, time: float, spread: float
) -> None:
    params = PERFECT.model_copy(update={"slip": 0.02, "slip_mean": mean - 1.0, "slip_time": time})
    excess = [ticks(params, seed, 20.0)[0] / (20 * ROBOT.ticks_per_turn) for seed in range(60)]
    assert np.mean(excess) == pytest.approx(mean, abs=0.6 * spread)
    assert np.std(excess) == pytest.approx(spread, rel=0.3)


def test_wheels_of_unequal_radius_count_unequally() -> None:
    params = PERFECT.model_copy(update={"radius_mismatch": 0.01})
    ratios = [ticks(params, s, 20.0)[1] / ticks(params, s, 20.0)[0] for s in range(12)]
    assert np.abs(np.array(ratios) - 1.0) == pytest.approx(0.01, rel=0.02)
    assert min(ratios) < 1.0 < max(ratios)


def test_presets() -> None:
    spread = [
        SensorParams.preset(name).gyro_bias for name in ("perfect", "good", "default", "poor")
    ]
    assert spread == sorted(spread)
    assert SensorParams.preset("default") == SensorParams()
    assert SensorParams.preset("good", slip=0.1).slip == 0.1
    assert set(PRESETS) == {"perfect", "good", "default", "poor"}
    with pytest.raises(UnknownNameError, match="did you mean 'good'"):
        SensorParams.preset("goood")
    with pytest.raises(ValidationError):
        SensorParams.preset("good", slipp=0.1)
