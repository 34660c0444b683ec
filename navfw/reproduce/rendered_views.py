"""Rendered image pairs with ground truth, their flow, and the percepts of OFFIS judged."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from navfw.bench.real_labels import Judgement, SentenceVerdict
from navfw.bench.view_truth import ViewTruth, WallGeometry, truth_of
from navfw.camera_geometry.rotations import derotate
from navfw.egomotion.camera_motion import camera_motion
from navfw.egomotion.refinement import refine
from navfw.flow.block_matching import BlockMatching
from navfw.flow.grid import grid_points
from navfw.flow.ideal import SIGMA, nearness_at, true_vectors
from navfw.offis.offis import Offis
from navfw.reproduce.percept_verdict import judge_percept
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Image, Percept, Pose, Twist
from navfw.sim.camera import DepthImage
from navfw.sim.sensor_models import SensorParams
from navfw.sim.simulation import Simulation
from navfw.sim.worldspec import WorldSpec

IMAGE_NOISE = 2.0
"""Standard deviation of the image noise [grey levels]."""


@dataclass(frozen=True, slots=True)
class RenderedPair:
    """A rendered image pair with its ground truth.

    ``depth`` (height, width) [m] belongs to the second image; ``motion`` is the camera's true
    motion, ``twist`` the robot's.
    """

    pair: FramePair
    depth: DepthImage
    motion: CameraMotion
    twist: Twist
    truth: ViewTruth


@dataclass(frozen=True, slots=True)
class CheckedPercept:
    """A percept of OFFIS from ``flow``, judged by the truth of its view."""

    flow: FlowField
    percept: Percept
    judgement: Judgement

    @property
    def right(self) -> bool:
        """Whether no statement is wrong."""
        return self.judgement.verdict is SentenceVerdict.RIGHT


class ViewRenderer:
    """Renders image pairs with a robot's camera in a world; a context manager.

    ``seed`` is that of the image noise. The robot's body stays at ``start``.
    """

    def __init__(self, world: WorldSpec, robot: RobotModel, start: Pose, seed: int) -> None:
        self.robot = robot
        self._walls = WallGeometry(world)
        self._rng = np.random.default_rng(seed)
        # rendered at twice the size and averaged, against aliasing
        self._sim = Simulation(world, robot, start, 0, SensorParams(supersample=2))

    def __enter__(self) -> ViewRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self._sim.close()

    def render(self, past: Pose, now: Pose, dt: float) -> RenderedPair:
        """The images from two poses, ``dt`` [s] apart."""
        robot = self.robot
        before, _ = self._sim.render_from(past)
        after, depth = self._sim.render_from(now)
        motion = camera_motion(robot, past, now, dt, slip=0.0)
        step = past.relative(now)
        twist = Twist(float(np.hypot(step.x, step.y)) / dt, step.yaw / dt)
        frames = Frame(0.0, self._exposed(before)), Frame(dt, self._exposed(after))
        return RenderedPair(
            FramePair(*frames, motion),
            depth,
            motion,
            twist,
            truth_of(self._walls, now, twist.v, depth, robot),
        )

    def _exposed(self, image: Image) -> Image:
        noisy = image + IMAGE_NOISE * self._rng.standard_normal(image.shape)
        return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)


def true_flow(view: RenderedPair, robot: RobotModel, rows: int = 12, cols: int = 16) -> FlowField:
    """The true flow of ``view``, rotation included: the paper's synthetic mode (sec 6.1)."""
    camera = robot.camera
    points = grid_points(camera, rows, cols)
    nearness = nearness_at(points, view.depth, camera)
    vectors = true_vectors(points, nearness, view.motion, camera.focal)
    seen = np.asarray(np.isfinite(vectors).all(axis=-1))
    return FlowField(
        time=view.pair.now.time,
        points=points,
        vectors=np.where(seen[..., None], vectors, 0.0),
        confidence=np.where(seen, 1.0, 0.0),
        sigma=np.full(seen.shape, SIGMA),
        motion=view.motion,
    )


def matched_flow(
    view: RenderedPair, robot: RobotModel, params: BlockMatching.Params, *, gyro: bool
) -> FlowField:
    """Flow of ``view`` by block matching; without ``gyro`` no rotation is predicted."""
    motion = view.motion if gyro else _unturned(view.motion)
    pair = dataclasses.replace(view.pair, motion=motion)
    return BlockMatching(robot, params).compute(pair)


def derotated(flow: FlowField, robot: RobotModel, *, with_refinement: bool) -> FlowField:
    """``flow`` without its rotational part: from the gyro alone, or refined by the flow."""
    if with_refinement:
        return refine(flow, robot.camera).apply(flow, robot.camera)
    return derotate(flow, robot.camera)


def not_derotated(flow: FlowField) -> FlowField:
    """``flow`` unchanged but labelled as without rotation: the error of the paper's waypoint 3."""
    return dataclasses.replace(flow, motion=_unturned(flow.motion), derotated=True)


def _unturned(motion: CameraMotion) -> CameraMotion:
    return dataclasses.replace(motion, rotation=np.eye(3))


def checked_percept(offis: Offis, flow: FlowField, view: RenderedPair) -> CheckedPercept:
    """The percept of ``offis`` from derotated ``flow``, judged by the truth of ``view``."""
    offis.reset()
    percept = offis.perceive(flow, view.twist)
    return CheckedPercept(flow, percept, judge_percept(percept, view.truth))
