"""Samples for measuring perception: rendered frame pair, measured motion, flow, and truth.

The robot stands still while the gyro's bias is estimated, then drives the view's arc. Gyro and
encoders are read at control rate with the noise of the chosen sensors; the odometer and the frame
buffer of the default stack choose the pair. Only its two frames are rendered, from the true poses
and with image noise. Pitch and roll are zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from navfw.bench.random_views import YARD, RandomView, random_views, random_world
from navfw.bench.view_truth import ViewTruth, WallGeometry, truth_of
from navfw.egomotion.camera_motion import camera_motion
from navfw.egomotion.odometer import Odometer
from navfw.egomotion.pairing import FrameBuffer, PairingParams
from navfw.egomotion.refinement import refine
from navfw.flow.block_matching import BlockMatching
from navfw.robot import RobotModel
from navfw.signals import Array, CameraMotion, FlowField, Frame, FramePair, Image, Pose, Twist
from navfw.sim.camera import DepthImage
from navfw.sim.sensor_models import GyroModel, SensorParams, WheelEncoderModel
from navfw.sim.simulation import Simulation
from navfw.sim.worldspec import WorldSpec

VIEWS_PER_WORLD = 12
"""Views in each world: many enough that building worlds costs little, few enough for variety."""

_STANDING, _DRIVING = 2.0, 2.0
"""Time [s] that the robot stands, and drives, before the view."""


@dataclass(frozen=True, slots=True)
class PerceptionSample:
    """One view: measured flow and twist, ideal flow (which goes with ``view.twist``), and truth."""

    view: RandomView
    furnished: bool
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
    aside = Pose(-0.5 * YARD, 0.5 * YARD, 0.0)
    with Simulation(world, robot, aside, seed=0, sensors=sensors) as sim:
        for view in chosen:
            sample = _sample(rng, sim, walls, view, sensors)
            if sample is not None:
                yield sample


def _sample(
    rng: np.random.Generator,
    sim: Simulation,
    walls: WallGeometry,
    view: RandomView,
    sensors: SensorParams,
) -> PerceptionSample | None:
    robot = sim.robot
    found = _pair(rng, robot, view, sensors)
    if found is None:
        return None
    motion, twist, past_time, now_time = found
    past_pose = view.before(now_time - past_time)
    past, _ = sim.render_from(past_pose)
    now, depth = sim.render_from(view.pose)
    frames = [
        Frame(t, _noisy(rng, image, sensors.image_noise))
        for t, image in ((past_time, past), (now_time, now))
    ]
    processor = _processor()
    raw = processor.compute(FramePair(frames[0], frames[1], motion))
    flow = refine(raw, robot.camera).apply(raw, robot.camera)
    true_motion = camera_motion(robot, past_pose, view.pose, motion.dt, yaw_rate_sigma=0, slip=0)
    return PerceptionSample(
        view=view,
        furnished=_furnished(sim.world),
        flow=flow,
        twist=twist,
        ideal=ideal_flow(raw.points, depth, true_motion, robot.camera.focal, now_time),
        truth=truth_of(walls, view.pose, view.twist.v, depth, robot),
    )


def _furnished(world: WorldSpec) -> bool:
    return bool(world.boxes or world.cylinders)


@cache
def _processor() -> BlockMatching:
    return BlockMatching(RobotModel())


def _pair(
    rng: np.random.Generator, robot: RobotModel, view: RandomView, sensors: SensorParams
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


def _noisy(rng: np.random.Generator, image: Image, sigma: float) -> Image:
    noise = rng.normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def ideal_flow(
    points: Array, depth: DepthImage, motion: CameraMotion, focal: float, time: float
) -> FlowField:
    """Derotated flow without error at ``points`` (rows, cols, 2) [px], from true depth and motion.

    ``depth`` (height, width) [m], ``focal`` [px], ``time`` [s] of the current frame. Points at
    infinite depth (the sky) have confidence 0.
    """
    height, width = depth.shape
    nearness = np.where(np.isfinite(depth), 1.0 / np.maximum(depth, 1e-3), 0.0)
    column = np.clip(points[..., 0] + 0.5 * width, 1.0, width - 1.0).astype(int)
    row = np.clip(points[..., 1] + 0.5 * height, 1.0, height - 1.0).astype(int)
    # points lie between pixels: nearness is linear on a plane, so the mean of the four is exact
    around = [nearness[row - i, column - j] for i in (0, 1) for j in (0, 1)]
    q = np.mean(around, axis=0, dtype=np.float64)
    seen = np.min(around, axis=0) > 0.0
    s = motion.translation
    e = points * s[2] - focal * s[:2]
    vectors = e * (q / (1.0 + s[2] * q))[..., None]
    return FlowField(
        time=time,
        points=points,
        vectors=vectors,
        confidence=seen.astype(np.float64),
        sigma=np.full(seen.shape, 0.02),
        motion=motion,
        derotated=True,
    )
