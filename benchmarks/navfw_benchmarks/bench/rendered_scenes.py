"""Hard scenes, rendered with known truth, of kinds that no real recording here shows.

Each sequence is a drive of 2 s through a random world, with another camera height and field of
view. Its labels follow from depth and walls by the rule of real-frames.md. Kinds are held out
whole: tuning may look at some; the others are reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.robot.camera_models import AutoExposure, CameraEffects
from navfw.signals import Pose
from navfw.sim import SceneGeometry, SensorParams, Simulation
from navfw.sim.camera import DepthImage
from navfw.sim.event_actions import LightChange
from navfw.sim.worldspec import BoxSpec, CylinderSpec, Look, Style, TextureSpec, WorldSpec
from navfw.worldgen.looks import with_look
from navfw_benchmarks.bench import view_truth
from navfw_benchmarks.bench.perception_samples import MARGIN, random_views
from navfw_benchmarks.bench.real_labels import QUADRANTS, FrameLabel
from navfw_benchmarks.bench.true_pairs import MovingPose, random_world
from navfw_benchmarks.bench.view_truth import WallGeometry, truth_of

RATE = 15.0
"""Images per second."""
_WIDTH, _HEIGHT, _FINER = 320, 240, 2
"""Size of the images [px]; how many times finer they are than those of the truth."""
_IMAGES, _LABELLED = 30, (14, 19, 24, 29)
"""Images of a sequence; numbers of those with a label."""
_DIMMED = (8, 18)
"""Images at which the light goes down, and comes back."""
_FLAT, _LOW = 0.06, 0.25
"""Heights [camera heights] up to which surfaces are floor, and things are low."""
_LARGE, _SMALL = 200, 25
"""Least areas [px] of what is nearest, and of what may be named as well."""
_IN_SIGHT, _OPEN = 0.1, 1.0 / 3.0
"""Nearness [1/camera heights] from which things count; share of an open front that they fill."""


@dataclass(frozen=True, slots=True)
class SceneKind:
    """A kind of scene: its split, the ``look`` of surfaces, and what makes it hard.

    ``floor`` is the pattern of all floors, ``gloss`` the share of light that floors mirror, ``low``
    the number of low things ahead, ``light`` what is left of the light for some images.
    """

    split: str
    look: Look | None = "photo"
    floor: Style | None = None
    gloss: float = 0.0
    low: int = 0
    light: float = 1.0
    effects: CameraEffects = field(default_factory=CameraEffects)


KINDS = {
    "speckle": SceneKind("tuning", look=None),
    "photographs": SceneKind("tuning"),
    "vignetting": SceneKind("tuning", effects=CameraEffects(vignetting=0.7)),
    "automatic exposure": SceneKind(
        "tuning", light=0.4, effects=CameraEffects(auto_exposure=AutoExposure())
    ),
    "glossy floor": SceneKind("test", gloss=0.35),
    "low things": SceneKind("test", low=4),
    "patterned floor": SceneKind("test", floor="rug"),
    "plain walls": SceneKind("test", look="plain"),
    "rolling shutter": SceneKind("test", effects=CameraEffects(readout_time=0.05)),
    "motion blur": SceneKind("test", effects=CameraEffects(exposure_time=0.05)),
}
"""The kinds of scenes by name."""


def render_scenes(kind: str, count: int, folder: Path) -> Iterator[tuple[float, list[FrameLabel]]]:
    """Save ``count`` sequences of a kind into folders of ``folder``, one after another.

    Yields the horizontal field of view [deg] and the labels of each. The same arguments give the
    same images.
    """
    what = KINDS[kind]
    for number in range(count):
        rng = np.random.default_rng([number, *kind.encode()])
        images = folder / f"{kind}-{number}"
        images.mkdir()
        camera = CameraModel(
            width=_WIDTH,
            height=_HEIGHT,
            hfov=float(rng.uniform(0.95, 1.4)),
            mount_height=float(rng.uniform(0.16, 0.36)),
            rate=RATE,
        )
        robot = RobotModel(camera=camera, camera_effects=what.effects)
        world, view = _drive(rng, robot, what)
        yield math.degrees(camera.hfov), _save(what, kind, images, world, robot, view)


def _drive(
    rng: np.random.Generator, robot: RobotModel, what: SceneKind
) -> tuple[WorldSpec, MovingPose]:
    """A world, and the last pose of a drive of _IMAGES on which nothing is touched."""
    while True:
        world = random_world(rng, "scene")
        plan = SceneGeometry.from_world(world, robot.height)
        situations = partial(WallGeometry(world).situations, camera=robot.camera)
        for view in random_views(rng, world, robot, 6, situations):
            poses = [view.before(t) for t in np.linspace(0.0, (_IMAGES + 1) / RATE, 12)]
            points = np.array([(pose.x, pose.y) for pose in poses])
            if view.twist.v > 0.2 and plan.clearances(points).min() > robot.radius + MARGIN:
                world = with_low_things(rng, world, plan, view, what)
                return _with_surfaces(rng, world, what), view


def _with_surfaces(rng: np.random.Generator, world: WorldSpec, what: SceneKind) -> WorldSpec:
    if what.look is not None:
        world = with_look(world, what.look, int(rng.integers(1_000_000)))
    if what.floor is None:
        return world
    pattern = TextureSpec(style=what.floor, contrast=float(rng.uniform(22.0, 40.0)), finest=0.03)
    floors = dict.fromkeys([world.floor, *(room.floor for room in world.rooms)], pattern)
    return world.model_copy(update={"textures": {**world.textures, **floors}})


def with_low_things(
    rng: np.random.Generator,
    world: WorldSpec,
    plan: SceneGeometry,
    view: MovingPose,
    what: SceneKind,
) -> WorldSpec:
    """``world`` with up to ``what.low`` boxes and discs of 3 to 9 cm ahead of the last pose."""
    boxes, cylinders, floor = list(world.boxes), list(world.cylinders), (world.x, world.y)
    for number in range(what.low):
        ahead = 0.5 + 0.3 * number + float(rng.uniform(-0.03, 0.03))  # none overlaps the next
        at = view.pose.to_parent(ahead, float(rng.uniform(-0.35, 0.35)))
        height, radius = float(rng.uniform(0.03, 0.09)), float(rng.uniform(0.025, 0.1))
        name, texture = f"low-{number}", str(rng.choice(["wood", "stone", "dark"]))
        inside = all(a + radius < x < b - radius for x, (a, b) in zip(at, floor, strict=True))
        if not inside or plan.clearance(*at) < 2.0 * radius:
            continue
        if number % 2:
            size = (2.0 * radius, radius, height)
            boxes.append(BoxSpec(name=name, at=at, size=size, texture=texture))
        else:
            disc = CylinderSpec(name=name, at=at, radius=radius, height=height, texture=texture)
            cylinders.append(disc)
    return world.model_copy(update={"boxes": tuple(boxes), "cylinders": tuple(cylinders)})


def _save(
    what: SceneKind, kind: str, images: Path, world: WorldSpec, robot: RobotModel, view: MovingPose
) -> list[FrameLabel]:
    """Drive to ``view``, save the ``images``, and return the labels."""
    walls, labels, dimmed = WallGeometry(world), [], LightChange(share=what.light)
    start, sensors = view.before(_IMAGES / RATE), SensorParams(supersample=_FINER)
    with Simulation(world, robot, start, 0, sensors) as simulation:
        for number in range(_IMAGES):
            frame, depth = simulation.read().frame, simulation.true_depth()
            assert frame is not None  # noqa: S101 - one is due at every step
            file = f"{number:03}.png"
            image = mirrored(frame.image, depth, robot.camera, what.gloss)
            cv2.imwrite(str(images / file), image)
            if number in _LABELLED:
                label = label_of(walls, simulation.true_pose(), depth, robot)
                labels.append(FrameLabel(kind, what.split, images.name, file, False, *label))
            if what.light < 1.0 and number in _DIMMED:
                (simulation.begin if number == _DIMMED[0] else simulation.end)(dimmed)
            simulation.drive(*robot.wheel_speeds(view.twist))
            simulation.advance(1.0 / RATE)
    return labels


def mirrored(image: Image, depth: DepthImage, camera: CameraModel, gloss: float) -> Image:
    """``image`` (height, width) with what its floor mirrors, as a share ``gloss`` of its light.

    A point at depth d in row y, from the horizon down, is mirrored in row 2 f h / d - y, seen from
    h above the floor. Only what is in the image is mirrored.
    """
    rows = len(image)
    y = np.arange(rows)[:, None] - 0.5 * (rows - 1)
    foot = camera.focal * camera.mount_height / np.maximum(depth, 1e-3)
    floor = np.abs(y - foot) < 0.02 * foot
    source, column = np.nonzero(np.isfinite(depth) & ~floor)
    far = np.argsort(-depth[source, column], kind="stable")  # what is nearer is written last
    source, column = source[far], column[far]
    target = np.rint(2.0 * foot[source, column] - y[source, 0] + 0.5 * (rows - 1)).astype(int)
    inside = (target >= 0) & (target < rows)
    light = image.copy()
    light[target[inside], column[inside]] = image[source[inside], column[inside]]
    shine = gloss * (light.astype(np.float64) - image)
    return np.where(floor, np.rint(image + shine), image).astype(np.uint8)


def label_of(
    walls: WallGeometry, pose: Pose, depth: DepthImage, robot: RobotModel
) -> tuple[frozenset[str], frozenset[str], str, str, frozenset[str]]:
    """The label of a view: ``nearest`` and ``nearest_also``, floor, ``front`` and ``front_also``.

    ``depth`` (height, width) [m] is _FINER than the truth's.
    """
    size = {"width": _WIDTH // _FINER, "height": _HEIGHT // _FINER}
    camera = robot.camera.model_copy(update=size)
    coarse = np.ascontiguousarray(depth[::_FINER, ::_FINER])
    truth = truth_of(walls, pose, 0.3, coarse, robot.model_copy(update={"camera": camera}))
    y = np.arange(camera.height)[:, None] - 0.5 * (camera.height - 1)
    high = 1.0 - coarse * (y / camera.focal) / camera.mount_height  # [camera heights]
    ceiling = (walls.height - 0.05) / camera.mount_height
    nearness = camera.mount_height / np.maximum(coarse, 1e-3)
    near = np.where((high > _FLAT) & (high < ceiling), nearness, 0.0)
    standing = np.where(high > _LOW, near, 0.0)
    third = camera.width // 3
    shown = (high[-camera.height // 4 :, third:-third] < _FLAT).mean()
    floor = "yes" if shown > 0.5 else "no" if shown < 0.25 else "unknown"
    return *_nearest(standing, near), floor, *_front(truth, standing[:, third:-third])


def _nearest(standing: Array, near: Array) -> tuple[frozenset[str], frozenset[str]]:
    """The quadrants of the nearest object that stands, and those that may be named as well."""
    large, small = (
        dict(zip(QUADRANTS.values(), view_truth.quadrant_nearness(of, area), strict=True))
        for of, area in ((standing, _LARGE), (near, _SMALL))
    )
    most = max(large.values())
    nearest = frozenset(name for name, n in large.items() if n >= view_truth.ALIKE * most)
    also = frozenset(name for name, n in small.items() if n >= view_truth.UNLIKE * most)
    if most < _IN_SIGHT:
        return frozenset({"none"}), also
    return nearest, also - nearest


def _front(truth: view_truth.ViewTruth, standing: Array) -> tuple[str, frozenset[str]]:
    """The front, and second answers, by the nearness of what is ``standing`` in the middle."""
    fronts, possible = (
        {name.rpartition(" ")[2] for name in of} - {"mixed", "hidden"}
        for of in (truth.situations, truth.possible_situations)
    )
    near, nearer = ((standing > n).any(axis=0).mean() for n in (_IN_SIGHT, 1.5 * _IN_SIGHT))
    if "corridor" not in fronts and near < _OPEN:
        front = "open"
    elif max(truth.hidden) > view_truth.HIDDEN:
        front = "object" if min(truth.hidden) > view_truth.HIDDEN else "unknown"
    else:
        order = ("corridor", "door", "corner", "wall")
        front = next((name for name in order if name in fronts), "unknown")
    return front, frozenset(fronts | possible | ({"open"} if nearer < _OPEN else set())) - {front}
