"""Rendered frame pairs with true depth and true motion, for measuring flow processors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from navfw.config.lookup import find
from navfw.egomotion.camera_motion import camera_motion, yaw_rotation
from navfw.robot import RobotModel
from navfw.signals import Array, CameraMotion, Frame, FramePair, Image, Pose
from navfw.sim import Simulation, WorldSpec, load_world
from navfw.sim.worldspec import BoxSpec, CylinderSpec, WallSpec

WORLDS = ("office", "paper-room", "corridor")
"""Worlds in which pairs are rendered: ``corridor`` is built here, the others are shipped."""

PERIOD = 0.2
"""Time between the frames of a pair [s]."""
IMAGE_NOISE = 2.0
"""Standard deviation of the image noise [grey levels], as in the simulator's default sensors."""
_YAW_SIGMA = 0.001
"""Standard deviation [rad] of the measured turn about the true one."""
_CLEARANCE = 0.35
"""Least distance [m] of robot and camera to anything: about the least in missions."""


def _straight(centimetres: float) -> Pose:
    return Pose(0.01 * centimetres, 0.0, 0.0)


def _arc(centimetres: float, degrees: float) -> Pose:
    """Pose at the end of an arc of that length and turn, in the frame of its start."""
    way, turn = 0.01 * centimetres, math.radians(degrees)
    chord = way * math.sin(0.5 * turn) / (0.5 * turn)
    return Pose(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn)


MOTIONS: dict[str, tuple[Pose, ...]] = {
    "2 cm": (_straight(2),),
    "4 cm": (_straight(4),),
    "6 cm": (_straight(6), _straight(-6)),
    "8 cm": (_straight(8),),
    "10 cm": (_straight(10),),
    "turn 2 deg": (Pose(0, 0, math.radians(2)), Pose(0, 0, -math.radians(2))),
    "turn 8 deg": (Pose(0, 0, math.radians(8)), Pose(0, 0, -math.radians(8))),
    "arc 6 cm 2 deg": (_arc(6, 2), _arc(6, -2)),
    "arc 8 cm 4 deg": (_arc(8, 4), _arc(8, -4)),
    "arc 6 cm 8 deg": (_arc(6, 8), _arc(6, -8)),
}
"""Motions of base_link from the past frame to the current one, by name; variants take turns."""


@dataclass(frozen=True, slots=True)
class TruePair:
    """A frame pair with ground truth.

    ``pair.motion`` is the measured camera motion, ``motion`` the true one; ``depth`` and
    ``past_depth`` (height, width) [m] belong to the current and the past frame: inf where there is
    no surface, 0 where the depth is unknown. ``recording_error`` (9,) corrects the true flow of a
    recorded pair (``navfw.bench.true_flow``); None for rendered ones.
    """

    world: str
    name: str
    pair: FramePair
    motion: CameraMotion
    depth: npt.NDArray[np.float32]
    past_depth: npt.NDArray[np.float32]
    recording_error: Array | None = None


def corridor_world(seed: int = 0) -> WorldSpec:
    """A corridor 1.8 m wide and 9 m long, without ceiling, with four obstacles along the walls."""
    rng = np.random.default_rng(seed)
    boxes, cylinders = [], []
    for k in range(4):
        x, side = 1.8 + 1.7 * k, float(rng.choice((-1.0, 1.0)))
        if rng.random() < 0.5:
            size = tuple(rng.uniform((0.2, 0.2, 0.3), (0.5, 0.4, 1.2)).tolist())
            y = side * (0.9 - 0.5 * size[1] - 0.05)
            boxes.append(BoxSpec(name=f"box-{k}", at=(x, y), size=size))
        else:
            radius = float(rng.uniform(0.08, 0.2))
            y = side * (0.9 - radius - 0.05)
            height = float(rng.uniform(0.4, 1.6))
            cylinders.append(
                CylinderSpec(name=f"post-{k}", at=(x, y), radius=radius, height=height)
            )
    outline = ((0.05, -0.95), (8.95, -0.95), (8.95, 0.95), (0.05, 0.95), (0.05, -0.95))
    return WorldSpec(
        name="corridor",
        x=(0, 9),
        y=(-1, 1),
        walls=(WallSpec(name="walls", points=outline),),
        boxes=tuple(boxes),
        cylinders=tuple(cylinders),
    )


def load_worlds(names: Sequence[str] = WORLDS) -> dict[str, WorldSpec]:
    """Worlds by name; ``corridor`` is built, the others are loaded from their files.

    Raises:
        InputError: a world is unknown, or its file breaks the schema.

    """
    return {n: corridor_world() if n == "corridor" else load_world(find("world", n)) for n in names}


def rendered_pairs(
    worlds: dict[str, WorldSpec],
    robot: RobotModel,
    places: int,
    seed: int = 0,
    noise: float = IMAGE_NOISE,
    motions: dict[str, tuple[Pose, ...]] = MOTIONS,
) -> Iterator[TruePair]:
    """One pair of every motion at each of ``places`` random free poses of each world.

    The variants of a motion (left and right, for example) take turns. ``noise`` is the standard
    deviation of the image noise [grey levels]. The same arguments give the same pairs.
    """
    for name, world in worlds.items():
        rng = np.random.default_rng([seed, *name.encode()])
        with Simulation(world, robot, _start(world, robot), 0) as simulation:
            for k in range(places):
                here = _free_pose(simulation, rng)
                after, depth = simulation.render_from(here)
                for motion_name, variants in motions.items():
                    step = variants[k % len(variants)]
                    past = here.compose(step.relative(Pose(0.0, 0.0, 0.0)))
                    before, depth_before = simulation.render_from(past)
                    true = camera_motion(robot, past, here, PERIOD)
                    frames = (_exposed(image, noise, rng) for image in (before, after))
                    pair = FramePair(
                        Frame(0.0, next(frames)),
                        Frame(PERIOD, next(frames)),
                        _measured(true, robot, rng),
                    )
                    yield TruePair(name, motion_name, pair, true, depth, depth_before)


def _start(world: WorldSpec, robot: RobotModel) -> Pose:
    """A free pose for the robot's body, which is never drawn."""
    from navfw.sim.floorplan import FloorPlan

    plan = FloorPlan.from_world(world, robot.height)
    rng = np.random.default_rng(0)
    while True:
        x, y = rng.uniform((world.x[0], world.y[0]), (world.x[1], world.y[1])).tolist()
        if plan.clearance(x, y) > robot.radius + 0.1:
            return Pose(x, y, 0.0)


def _free_pose(simulation: Simulation, rng: np.random.Generator) -> Pose:
    world, plan = simulation.world, simulation.plan
    while True:
        x, y = rng.uniform((world.x[0], world.y[0]), (world.x[1], world.y[1])).tolist()
        pose = Pose(x, y, float(rng.uniform(-math.pi, math.pi)))
        camera = pose.to_parent(simulation.robot.camera.mount_forward, 0.0)
        if min(plan.clearance(x, y), plan.clearance(*camera)) > _CLEARANCE:
            return pose


def _exposed(image: Image, noise: float, rng: np.random.Generator) -> Image:
    noisy = image + noise * rng.standard_normal(image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _measured(true: CameraMotion, robot: RobotModel, rng: np.random.Generator) -> CameraMotion:
    """``true`` with a rotation error as of a gyro: about the vertical, with _YAW_SIGMA."""
    base = robot.camera.base_from_camera
    error = base.T @ yaw_rotation(_YAW_SIGMA * float(rng.standard_normal())) @ base
    return replace(true, rotation=error @ true.rotation, yaw_sigma=_YAW_SIGMA)
