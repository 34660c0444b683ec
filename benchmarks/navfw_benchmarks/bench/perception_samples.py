"""Samples for measuring perception: rendered frame pair, measured motion, flow, and truth.

A view is a pose of the robot with the motion that led to it, drawn so that it shows a wanted
situation (a door, a corner, ...) or without such a condition. ``view_truth`` finds the
true situation from the geometry.

The robot stands still while the gyro's bias is estimated, then drives the view's arc. Gyro and
encoders are read at control rate with the noise of the chosen sensors; the odometer and the frame
buffer of the default stack choose the pair. Only its two frames are rendered, from the true poses
and with image noise. Pitch and roll are zero.
"""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count

import numpy as np

from navfw.camera_geometry.rotations import derotate
from navfw.egomotion.odometer import Odometer
from navfw.egomotion.pairing import FrameBuffer, PairingParams, camera_motion
from navfw.egomotion.refinement import refine
from navfw.flow.block_matching import BlockMatching
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Pose, Twist, wrap_angle
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.sensor_models import GyroModel, SensorParams, WheelEncoderModel
from navfw.sim.simulation import Simulation
from navfw.sim.solids import opening_segment, wall_segments
from navfw.sim.worldspec import WorldSpec
from navfw_benchmarks.bench.true_pairs import MovingPose, exposed, random_world, true_field
from navfw_benchmarks.bench.view_truth import ViewTruth, WallGeometry, truth_of

_AIMS = ("corridor", "door", "corner", "wall", "slope wall", "anywhere")
"""The situations that views are drawn for; ``anywhere`` sets no condition."""

MARGIN = 0.1
"""Least clearance [m] of the robot's body in every view."""

_TRIES = 200
"""Number of draws for a view; the second half accepts views without the wanted situation."""

_STRAIGHT_SHARE = 0.5
"""Share of the views on a straight path; the others are on an arc."""


VIEWS_PER_WORLD = 12
"""Views in each world: many enough that building worlds costs little, few enough for variety."""

_STANDING, _DRIVING = 2.0, 2.0
"""Time [s] that the robot stands, and drives, before the view."""


@dataclass(frozen=True, slots=True)
class PerceptionSample:
    """One view: measured flow and twist, ideal flow (which goes with ``view.twist``), and truth."""

    view: MovingPose
    flow: FlowField
    twist: Twist
    ideal: FlowField
    truth: ViewTruth


def samples_of_world(
    seed: int, number: int, views: int = VIEWS_PER_WORLD
) -> Iterator[PerceptionSample]:
    """At most ``views`` samples from world ``number`` of a ``seed``; repeatable.

    Views in which the default pairing finds no frame pair (fast turn, hardly any motion) are left
    out: the stack does not interpret them either.
    """
    rng = np.random.default_rng([seed, number])
    robot, sensors = RobotModel(), SensorParams()
    world = random_world(rng, f"world {number}")
    walls = WallGeometry(world)
    chosen = random_views(
        rng, world, robot, views, lambda pose: walls.situations(pose, robot.camera)
    )
    if not chosen:
        return
    with Simulation(world, robot, chosen[0].pose, seed=0, sensors=sensors) as sim:
        for view in chosen:
            sample = _sample(rng, sim, walls, view, sensors)
            if sample is not None:
                yield sample


def drawn_samples(seed: int, workers: int = 1) -> Iterator[PerceptionSample]:
    """An endless sequence of samples, world by world, in an order independent of ``workers``.

    ``workers`` is the number of processes that make them.
    """
    if workers <= 1:
        for number in count():
            yield from samples_of_world(seed, number)
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for first in count(0, 2 * workers):
            jobs = [(seed, number) for number in range(first, first + 2 * workers)]
            for samples in pool.imap(_samples_of_job, jobs):
                yield from samples


def _samples_of_job(job: tuple[int, int]) -> list[PerceptionSample]:
    return list(samples_of_world(*job))


def _sample(
    rng: np.random.Generator,
    sim: Simulation,
    walls: WallGeometry,
    view: MovingPose,
    sensors: SensorParams,
) -> PerceptionSample | None:
    robot = sim.robot
    measured = _pair(rng, robot, view, sensors)
    if measured is None:
        return None
    motion, twist, past_time, now_time = measured
    past_pose = view.before(now_time - past_time)
    past, _ = sim.render_from(past_pose)
    now, depth = sim.render_from(view.pose)
    frames = [
        Frame(t, exposed(image, rng, sensors.image_noise))
        for t, image in ((past_time, past), (now_time, now))
    ]
    processor = _processor()
    raw = processor.compute(FramePair(frames[0], frames[1], motion))
    flow = refine(raw, robot.camera).apply(raw, robot.camera)
    true_motion = camera_motion(robot, past_pose, view.pose, motion.dt, yaw_rate_sigma=0, slip=0)
    return PerceptionSample(
        view=view,
        flow=flow,
        twist=twist,
        ideal=derotate(
            true_field(raw.points, depth, true_motion, robot.camera, now_time), robot.camera
        ),
        truth=truth_of(walls, view.pose, view.twist.v, depth, robot),
    )


@cache
def _processor() -> BlockMatching:
    return BlockMatching(RobotModel())


def _pair(
    rng: np.random.Generator, robot: RobotModel, view: MovingPose, sensors: SensorParams
) -> tuple[CameraMotion, Twist, float, float] | None:
    """Measured motion, measured twist, times [s] of both frames; None without a pair."""
    gyro = GyroModel(sensors, rng)
    wheels = WheelEncoderModel(sensors, robot, rng)
    odometer = Odometer(robot)
    buffer = FrameBuffer(robot, PairingParams(max_rotation=0.12))  # as the default stack
    speeds = np.array(robot.wheel_speeds(view.twist))
    rate, camera_rate = robot.control_rate, robot.camera.rate
    ticks = round((_STANDING + _DRIVING) * rate)
    angles = np.zeros(2)
    twist, frames = Twist(0.0, 0.0), 0
    for tick in range(ticks + 1):
        time = tick / rate
        driving = time > _STANDING
        angles = angles + speeds * (driving / rate)
        rates = (0.0, 0.0, view.twist.w if driving else 0.0)
        inertial = gyro.read(time, 1.0 / rate if tick else 0.0, rates)
        left, right = angles.tolist()
        odometry = odometer.update(inertial, wheels.read(time, 1.0 / rate, (left, right)))
        if time >= frames / camera_rate - 1e-9:
            frames += 1
            if time > _STANDING - 1.0:
                buffer.add(Frame(time, _NO_IMAGE), odometry)
                twist = odometry.twist
    if not buffer.pairs():
        return None
    pair = buffer.pairs()[0]
    return pair.motion, twist, pair.past.time, pair.now.time


_NO_IMAGE = np.zeros((1, 1), np.uint8)


# --- views ----------------------------------------------------------------------------------------


def random_views(
    rng: np.random.Generator,
    world: WorldSpec,
    robot: RobotModel,
    number: int,
    situations: Callable[[Pose], Sequence[str]],
) -> list[MovingPose]:
    """At most ``number`` views of ``world``, for the _AIMS in turn, with MARGIN to everything.

    ``situations`` gives the elementary situations that the walls form at a pose. Speeds are
    uniform in 0.1 to 0.4 m/s; half of the views are on a straight path, the others turn at up to
    0.6 rad/s. Fewer views are returned if the world has too little free space.
    """
    plan = SceneGeometry.from_world(world, robot.height)
    first = int(rng.integers(len(_AIMS)))
    views: list[MovingPose] = []
    for i in range(number):
        aim = _AIMS[(first + i) % len(_AIMS)]
        for attempt in range(_TRIES):
            pose = _aimed(rng, world, aim)
            turning = rng.random() >= _STRAIGHT_SHARE
            rate = float(rng.uniform(-0.6, 0.6)) if turning else 0.0
            view = MovingPose(pose, Twist(float(rng.uniform(0.1, 0.4)), rate))
            if not _is_free(plan, view, robot):
                continue
            shown = aim == "anywhere" or any(
                situation.removeprefix("left ").removeprefix("right ") == aim
                for situation in situations(pose)
            )
            if shown or attempt > _TRIES // 2:
                views.append(view)
                break
    return views


def _aimed(rng: np.random.Generator, world: WorldSpec, aim: str) -> Pose:
    if aim == "corridor":
        corridor = world.rooms[0]
        yaw = float(rng.uniform(-0.35, 0.35)) + float(rng.choice([0.0, math.pi]))
        x, y = float(rng.uniform(*corridor.x)), float(rng.uniform(*corridor.y))
        return Pose(x, y, wrap_angle(yaw))
    if aim == "door":
        return _towards(rng, _door(rng, world), (0.7, 3.2), 0.9, 0.12)
    if aim == "corner":
        return _towards(rng, _corner(rng, world), (0.8, 5.0), 0.75, 0.12)
    if aim == "wall":
        return _towards(rng, _wall_point(rng, world), (0.5, 5.0), 0.28, 0.0)
    if aim == "slope wall":
        return _towards(rng, _wall_point(rng, world), (0.5, 5.0), 1.0, 0.0)
    return Pose(
        float(rng.uniform(*world.x)),
        float(rng.uniform(*world.y)),
        float(rng.uniform(-math.pi, math.pi)),
    )


_Facing = tuple[float, float, float]  # x, y [m] of a target, direction [rad] towards the viewer


def _towards(
    rng: np.random.Generator,
    target: _Facing,
    distances: tuple[float, float],
    aslant: float,
    beside: float,
) -> Pose:
    """A pose with the optical axis on ``target``, off by up to ``beside`` [rad].

    The viewing direction is up to ``aslant`` [rad] off the target's; ``distances`` [m] is the
    interval of the distance.
    """
    x, y, facing = target
    distance = float(rng.uniform(*distances))
    direction = facing + float(rng.uniform(-aslant, aslant))
    yaw = direction + math.pi + float(rng.uniform(-beside, beside))
    return Pose(*Pose(x, y, direction).to_parent(distance, 0.0), wrap_angle(yaw))


def _door(rng: np.random.Generator, world: WorldSpec) -> _Facing:
    doors = [(wall, opening) for wall in world.walls for opening in wall.openings]
    wall, opening = doors[int(rng.integers(len(doors)))]
    index = opening_segment(wall, opening)
    assert index is not None  # noqa: S101 - checked before
    side = wall_segments(wall)[index].yaw + float(rng.choice([-0.5, 0.5])) * math.pi
    return (*opening.at, side)


def _corner(rng: np.random.Generator, world: WorldSpec) -> _Facing:
    room = world.rooms[int(rng.integers(1, len(world.rooms)))]
    x, y = float(rng.choice(room.x)), float(rng.choice(room.y))
    middle_x, middle_y = sum(room.x) / 2.0, sum(room.y) / 2.0
    inward = math.atan2(math.copysign(1.0, middle_y - y), math.copysign(1.0, middle_x - x))
    return x, y, inward


def _wall_point(rng: np.random.Generator, world: WorldSpec) -> _Facing:
    segments = [segment for wall in world.walls for segment in wall_segments(wall)]
    lengths = np.array([segment.length for segment in segments])
    segment = segments[int(rng.choice(len(segments), p=lengths / lengths.sum()))]
    along = float(rng.uniform(0.1, 0.9)) * segment.length
    x, y = Pose(*segment.start, segment.yaw).to_parent(along, 0.0)
    return x, y, segment.yaw + float(rng.choice([-0.5, 0.5])) * math.pi


def _is_free(plan: SceneGeometry, view: MovingPose, robot: RobotModel) -> bool:
    """Whether the robot keeps MARGIN at its pose and on the last second of its path."""
    poses = [view.before(seconds) for seconds in (0.0, 0.25, 0.5, 0.75, 1.0)]
    points = np.array([(pose.x, pose.y) for pose in poses])
    x0, y0, x1, y1 = plan.bounds
    inside = (points > (x0, y0)).all() and (points < (x1, y1)).all()
    return bool(inside) and float(plan.clearances(points).min()) > robot.radius + MARGIN
