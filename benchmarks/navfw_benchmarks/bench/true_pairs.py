"""Frame pairs with true depth and true motion, and the true flow that follows from them.

There is no true flow where a surface is unknown, or hidden in the past frame.

The recorded poses of real cameras are less accurate than flow: those of motion capture are off by
tenths of a degree, and a rolling shutter exposes each row at another pose. ``with_recording_error``
estimates this part of the error, smooth over the image, by a flow processor that is none of those
compared: nine numbers of a pair, against two for each of its cells.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from navfw.config.lookup import find
from navfw.egomotion.pairing import camera_motion, yaw_rotation
from navfw.flow.ideal import SIGMA, nearness_at, true_vectors
from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats, Indices, Mask
from navfw.robot import CameraModel, RobotModel
from navfw.signals import CameraMotion, FlowField, Frame, FramePair, Pose, Twist, wrap_angle
from navfw.sim import SceneGeometry, Simulation, load_world
from navfw.sim.camera import DepthImage
from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.worldspec import OpeningSpec, RoomSpec, WallSpec, WorldSpec
from navfw.worldgen.world_draft import WALL, WorldDraft

_CLEAR_OF_DOORS = 0.8
"""Least distance [m] of furniture from the middle of a door."""

_MAX_SIDE, _MAX_SIDE_IN_CORRIDOR = 0.8, 0.4
"""Largest side or diameter [m] of furniture; the corridor stays passable."""

_GAP = 0.02
"""Least gap [m] between furniture and anything else."""


def random_world(rng: np.random.Generator, name: str) -> WorldSpec:
    """A corridor 1.3 to 2.4 m wide, the first of the world's rooms, with two rooms on either side.

    Half of the worlds have a wall that slants across a room's corner, and half have furniture.
    """
    low, north = rng.uniform(3.5, 8.0, 2).tolist()
    high = low + float(rng.uniform(1.3, 2.4))
    draft = WorldDraft.empty(rng, float(rng.uniform(9.0, 16.0)), high + north)
    (x0, x1), (y0, y1) = ((a + 0.5 * WALL, b - 0.5 * WALL) for a, b in (draft.x, draft.y))
    split = float(rng.uniform(0.4, 0.6)) * x1
    split_south = split + float(rng.uniform(-1.0, 1.0))
    if rng.random() < 0.5:
        draft.ceiling = draft.palette.draw("ceiling")
    textures = draft.palette.draw_many("wall", 4)
    draft.enclose(draft.palette.pick(textures))
    walls = [
        WallSpec(name="south-room-wall", points=((split_south, y0), (split_south, low))),
        WallSpec(name="north-room-wall", points=((split, high), (split, y1))),
    ]
    for side, y in (("south", low), ("north", high)):
        spans = enumerate(((0.0, split - 1.0), (split + 1.0, x1)))
        doors = tuple(_door(rng, f"{side}-door-{k}", y, *span) for k, span in spans)
        walls.append(WallSpec(name=f"{side}-wall", points=((x0, y), (x1, y)), openings=doors))
    if rng.random() < 0.5:
        cut = float(rng.uniform(1.0, 2.2))
        run = min(cut * math.tan(float(rng.uniform(0.5, 1.07))), split_south - 1.2)
        walls.append(WallSpec(name="slanting-wall", points=((run, y0), (x0, cut))))
    draft.walls += [
        wall.model_copy(update={"texture": draft.palette.pick(textures)}) for wall in walls
    ]
    for room, x, y_span in (
        ("corridor", (x0, x1), (low, high)),
        ("south-west", (x0, split_south), (y0, low)),
        ("south-east", (split_south, x1), (y0, low)),
        ("north-west", (x0, split), (high, y1)),
        ("north-east", (split, x1), (high, y1)),
    ):
        floor, faces = draft.palette.draw("floor"), draft.palette.pick(textures)
        draft.rooms.append(RoomSpec(name=room, x=x, y=y_span, floor=floor, walls=faces))
    if rng.random() < 0.5:
        _furnish(rng, draft)
    return draft.world(name)


def _door(rng: np.random.Generator, name: str, y: float, start: float, end: float) -> OpeningSpec:
    width = float(rng.uniform(0.8, 1.1))
    x = float(rng.uniform(start + 0.5 * width + 0.4, end - 0.5 * width - 0.4))
    return OpeningSpec(name=name, at=(x, y), width=width)


def _furnish(rng: np.random.Generator, draft: WorldDraft) -> None:
    """Add up to seven boxes and cylinders a room, half of them low, clear of doors and walls."""
    for wall in draft.walls:
        for opening in wall.openings:
            draft.keep_free(*opening.at, _CLEAR_OF_DOORS)
    draft.shapes += [solid.shape for solid in draft.geometry().solids]
    textures = draft.palette.draw_many("thing", 4)
    for room in draft.rooms:
        largest = _MAX_SIDE_IN_CORRIDOR if room is draft.rooms[0] else _MAX_SIDE
        for _ in range(int(rng.integers(1, 8))):
            x, y = float(rng.uniform(*room.x)), float(rng.uniform(*room.y))
            height = float(rng.choice([rng.uniform(0.15, 0.5), rng.uniform(0.5, 1.7)]))
            half_x, half_y = (0.5 * rng.uniform(0.2, largest, 2)).tolist()
            name, texture = f"thing-{len(draft.shapes)}", draft.palette.pick(textures)
            box = Rectangle(x, y, half_x, half_y, float(rng.uniform(-math.pi, math.pi)))
            if rng.random() < 0.5 and draft.fits(box, _GAP):
                draft.add(name, box, height, texture)
            elif draft.fits(cylinder := Circle(x, y, half_x), _GAP):
                draft.add(name, cylinder, height, texture)


WORLDS = ("office", "paper-room", "corridor")
"""Worlds in which pairs are rendered: ``corridor`` is a random world, the others are shipped."""
_CORRIDOR_SEED = 0
"""Seed of the random world: one with furniture, without ceiling."""

PERIOD = 0.2
"""Time between the frames of a pair [s]."""
IMAGE_NOISE = 2.0
"""Standard deviation of the image noise [grey levels], as in the simulator's default sensors."""
_YAW_SIGMA = 0.001
"""Standard deviation [rad] of the measured turn about the true one."""
_CLEARANCE = 0.35
"""Least distance [m] of robot and camera to anything: about the least in missions."""


def _arc(length: float, turn: float) -> Pose:
    """Pose at the end of an arc of ``length`` [m] and ``turn`` [rad], in its start's frame."""
    chord = length * float(np.sinc(turn / math.tau))
    return Pose(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), wrap_angle(turn))


@dataclass(frozen=True, slots=True)
class MovingPose:
    """The robot's ``pose`` in the map while it drives with ``twist``."""

    pose: Pose
    twist: Twist

    def before(self, seconds: float) -> Pose:
        """The pose ``seconds`` [s] earlier on the arc of the twist."""
        return self.pose.compose(_arc(-self.twist.v * seconds, -self.twist.w * seconds))


def _moved(centimetres: float, degrees: float = 0.0) -> Pose:
    return _arc(0.01 * centimetres, math.radians(degrees))


MOTIONS: dict[str, tuple[Pose, ...]] = {
    "2 cm": (_moved(2),),
    "4 cm": (_moved(4),),
    "6 cm": (_moved(6), _moved(-6)),
    "8 cm": (_moved(8),),
    "10 cm": (_moved(10),),
    "turn 2 deg": (_moved(0, 2), _moved(0, -2)),
    "turn 8 deg": (_moved(0, 8), _moved(0, -8)),
    "arc 6 cm 2 deg": (_moved(6, 2), _moved(6, -2)),
    "arc 8 cm 4 deg": (_moved(8, 4), _moved(8, -4)),
    "arc 6 cm 8 deg": (_moved(6, 8), _moved(6, -8)),
}
"""Motions of base_link from the past frame to the current one, by name; variants take turns."""


@dataclass(frozen=True, slots=True)
class TruePair:
    """A frame pair with ground truth.

    ``pair.motion`` is the measured camera motion, ``motion`` the true one; ``depth`` and
    ``past_depth`` (height, width) [m] belong to the current and the past frame: inf where there is
    no surface, 0 where the depth is unknown. ``recording_error`` (9,) corrects the true flow of a
    recorded pair (``true_pairs``); None for rendered ones.
    """

    world: str
    name: str
    pair: FramePair
    motion: CameraMotion
    depth: Floats
    past_depth: Floats
    recording_error: Array | None = None


def load_worlds(names: Sequence[str] = WORLDS) -> dict[str, WorldSpec]:
    """Worlds by name; ``corridor`` is drawn, the others are loaded from their files.

    Raises:
        InputError: a world is unknown, or its file breaks the schema.

    """
    drawn = {"corridor": random_world(np.random.default_rng(_CORRIDOR_SEED), "corridor")}
    return {name: drawn.get(name) or load_world(find("world", name)) for name in names}


def rendered_pairs(
    worlds: dict[str, WorldSpec],
    robot: RobotModel,
    places: int,
    seed: int = 0,
) -> Iterator[TruePair]:
    """One pair of every motion at each of ``places`` random free poses of each world.

    The variants of a motion (left and right, for example) take turns. The same arguments give the
    same pairs.
    """
    for name, world in worlds.items():
        rng = np.random.default_rng([seed, *name.encode()])
        with Simulation(world, robot, _start(world, robot), 0) as simulation:
            for k in range(places):
                pose = _free_pose(simulation, rng)
                after, depth = simulation.render_from(pose)
                for motion_name, variants in MOTIONS.items():
                    step = variants[k % len(variants)]
                    past = pose.compose(step.relative(Pose(0.0, 0.0, 0.0)))
                    before, depth_before = simulation.render_from(past)
                    true = camera_motion(robot, past, pose, PERIOD)
                    frames = (exposed(image, rng) for image in (before, after))
                    pair = FramePair(
                        Frame(0.0, next(frames)),
                        Frame(PERIOD, next(frames)),
                        _measured(true, robot, rng),
                    )
                    yield TruePair(name, motion_name, pair, true, depth, depth_before)


def _start(world: WorldSpec, robot: RobotModel) -> Pose:
    plan = SceneGeometry.from_world(world, robot.height)
    rng = np.random.default_rng(0)
    while True:
        x, y = _random_point(world, rng)
        if plan.clearance(x, y) > robot.radius + 0.1:
            return Pose(x, y, 0.0)


def _free_pose(simulation: Simulation, rng: np.random.Generator) -> Pose:
    plan = simulation.plan
    while True:
        x, y = _random_point(simulation.world, rng)
        pose = Pose(x, y, float(rng.uniform(-math.pi, math.pi)))
        camera = pose.to_parent(simulation.robot.camera.mount_forward, 0.0)
        if min(plan.clearance(x, y), plan.clearance(*camera)) > _CLEARANCE:
            return pose


def _random_point(world: WorldSpec, rng: np.random.Generator) -> tuple[float, float]:
    x, y = rng.uniform((world.x[0], world.y[0]), (world.x[1], world.y[1])).tolist()
    return x, y


def exposed(image: Image, rng: np.random.Generator, noise: float = IMAGE_NOISE) -> Image:
    """``image`` with noise of that standard deviation [grey levels]."""
    noisy = image + noise * rng.standard_normal(image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _measured(true: CameraMotion, robot: RobotModel, rng: np.random.Generator) -> CameraMotion:
    """``true`` with a rotation error as of a gyro: about the vertical, with _YAW_SIGMA."""
    base = robot.camera.base_from_camera
    error = base.T @ yaw_rotation(_YAW_SIGMA * float(rng.standard_normal())) @ base
    return replace(true, rotation=error @ true.rotation, yaw_sigma=_YAW_SIGMA)


HIDDEN = 1.1
"""A surface is hidden in the past frame where another is nearer there by this factor."""
ITERATIONS = 20
"""Steps of the robust fit of the recording's error."""


def true_flow(points: Array, true: TruePair, camera: CameraModel) -> tuple[Array, Mask]:
    """True vectors (rows, cols, 2) [px] at ``points``, and where there is a truth.

    There is none where one of the four pixels around a point has no depth, and where the point is
    hidden behind something nearer in the past frame.
    """
    nearness = _nearness(points, true, camera)
    vectors = true_vectors(points, nearness, true.motion, camera.focal)
    missing = cv2.dilate((true.depth <= 0.0).astype(np.uint8), np.ones((2, 2), np.uint8))
    valid = (missing[pixels(points, camera)] == 0) & np.isfinite(vectors).all(axis=-1)
    valid &= ~_hidden(points, nearness, vectors, true, camera)
    if true.recording_error is not None:
        vectors = vectors + _slopes(points, nearness, camera) @ true.recording_error
    return vectors, valid


def true_field(
    points: Array, depth: DepthImage, motion: CameraMotion, camera: CameraModel, time: float
) -> FlowField:
    """True flow at ``points`` (rows, cols, 2) [px], rotation included, at ``time`` [s].

    ``depth`` (height, width) [m] is that of the current frame. Points without a surface (the sky)
    have confidence 0, all others 1.
    """
    nearness = nearness_at(points, depth, camera)
    vectors = true_vectors(points, nearness, motion, camera.focal)
    seen = np.isfinite(vectors).all(axis=-1) & (nearness > 0.0)
    return FlowField(
        time=time,
        points=points,
        vectors=np.where(seen[..., None], vectors, 0.0),
        confidence=seen.astype(np.float64),
        sigma=np.full(seen.shape, SIGMA),
        motion=motion,
    )


def with_recording_error(true: TruePair, flow: FlowField, camera: CameraModel) -> TruePair:
    """``true`` with the error of its recorded motion, as far as ``flow`` shows it.

    The error is a small rotation (three numbers), a small translation (three), and a change of the
    rotation over the rows of the image (three, for a rolling shutter). The fit is iteratively
    reweighted least squares with Cauchy weights.
    """
    vectors, valid = true_flow(flow.points, true, camera)
    slopes = _slopes(flow.points, _nearness(flow.points, true, camera), camera)[valid]
    off = (flow.vectors - vectors)[valid]
    weight = np.ones(len(off))
    error: Array = np.zeros(slopes.shape[-1])
    for _ in range(ITERATIONS):
        root = np.sqrt(weight)[:, None]
        system = (slopes * root[..., None]).reshape(-1, error.size)
        error = np.asarray(np.linalg.lstsq(system, (off * root).ravel(), rcond=None)[0])
        size = np.linalg.norm(off - slopes @ error, axis=1)
        weight = 1.0 / (1.0 + (size / (2.0 * max(float(np.median(size)), 1e-3))) ** 2)
    return replace(true, recording_error=error)


def _slopes(points: Array, nearness: Array, camera: CameraModel) -> Array:
    """Derivatives (rows, cols, 2, 9) of the flow by the nine numbers of the recording's error."""
    f, half = camera.focal, 0.5 * camera.height
    x, y = points[..., 0], points[..., 1]
    zero = np.zeros_like(x)
    turn, shift = (
        np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        for rows in (
            ([x * y / f, -(f + x**2 / f), y], [f + y**2 / f, -x * y / f, -x]),
            ([zero - f, zero, x], [zero, zero - f, y]),
        )
    )
    by_row = turn * (y / half)[..., None, None]
    return np.concatenate([turn, shift * nearness[..., None, None], by_row], axis=-1)


def _nearness(points: Array, true: TruePair, camera: CameraModel) -> Array:
    """Nearness [1/m] at ``points``; 0 where a pixel has no depth."""
    holes = np.where(true.depth > 0.0, true.depth, np.inf).astype(np.float32)
    return nearness_at(points, holes, camera)


def _hidden(
    points: Array, nearness: Array, vectors: Array, true: TruePair, camera: CameraModel
) -> Mask:
    """Where the surface at ``points`` lies behind another one in the past frame."""
    ray = np.concatenate([points / camera.focal, np.ones_like(points[..., :1])], axis=-1)
    past = (ray + nearness[..., None] * true.motion.translation) @ true.motion.rotation
    expected = nearness / np.where(past[..., 2] > 1e-6, past[..., 2], np.inf)
    depth = true.past_depth
    seen = np.where(depth > 0.0, 1.0 / np.where(depth > 0.0, depth, 1.0), 0.0)
    return np.asarray(seen[pixels(points - np.nan_to_num(vectors), camera)] > HIDDEN * expected)


def pixels(points: Array, camera: CameraModel) -> tuple[Indices, Indices]:
    """Rows and columns of the pixels at ``points``, those outside moved to the border."""
    x = np.clip(points[..., 0] + 0.5 * camera.width, 0, camera.width - 1).astype(np.int64)
    y = np.clip(points[..., 1] + 0.5 * camera.height, 0, camera.height - 1).astype(np.int64)
    return y, x
