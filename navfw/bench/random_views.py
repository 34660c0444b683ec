"""Random worlds and random views of them, for measuring perception.

A world is a corridor with two rooms on either side and doors. Half of the worlds have a wall that
slants across a room's corner, and half have furniture. A view is a pose of the robot with the
motion that led to it, drawn so that it shows a wanted situation (a door, a corner, ...) or without
such a condition. ``navfw.bench.view_truth`` finds the true situation from the geometry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from navfw.robot import RobotModel
from navfw.signals import Pose, Twist, wrap_angle
from navfw.sim.floorplan import FloorPlan
from navfw.sim.shapes import Circle, Rectangle, Shape, overlap_depth
from navfw.sim.solids import opening_segment, wall_segments
from navfw.sim.worldspec import (
    BoxSpec,
    CylinderSpec,
    OpeningSpec,
    RoomSpec,
    TextureSpec,
    WallSpec,
    WorldSpec,
)

_AIMS = ("corridor", "door", "corner", "wall", "slope wall", "anywhere")
"""The situations that views are drawn for; ``anywhere`` sets no condition."""

MARGIN = 0.1
"""Least clearance [m] of the robot's body in every view."""

YARD = 1.2
"""Width [m] of the strip of floor outside the walls for the body of the simulated robot.

Views are rendered from other poses than the body's; it must not appear in them."""

_CLEAR_OF_DOORS = 0.8
"""Least distance [m] of furniture from the middle of a door."""

_TRIES = 200
"""Number of draws for a view; the second half accepts views without the wanted situation."""

_STRAIGHT_SHARE = 0.5
"""Share of the views on a straight path; the others are on an arc."""


@dataclass(frozen=True, slots=True)
class RandomView:
    """``pose`` of the robot in the map while it drives with ``twist``; ``aim`` is one of _AIMS."""

    pose: Pose
    twist: Twist
    aim: str

    def before(self, seconds: float) -> Pose:
        """The robot's pose ``seconds`` [s] earlier on the same arc."""
        way, turn = -self.twist.v * seconds, -self.twist.w * seconds
        chord = way * np.sinc(turn / (2.0 * math.pi))
        step = Pose(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), wrap_angle(turn))
        return self.pose.compose(step)


Box = tuple[float, float, float, float]  # x from, x to, y from, y to [m]


def random_world(rng: np.random.Generator, name: str) -> WorldSpec:
    """Two rooms on either side of a corridor 1.3 to 2.4 m wide; half of them with furniture."""
    length = float(rng.uniform(9.0, 16.0))
    south, north = rng.uniform(3.5, 8.0, 2).tolist()
    width = float(rng.uniform(1.3, 2.4))
    low, high = south, south + width
    top = high + north
    split = float(rng.uniform(0.4, 0.6)) * length
    outline = ((0.05, 0.05), (length - 0.05, 0.05), (length - 0.05, top - 0.05), (0.05, top - 0.05))
    walls = [
        WallSpec(name="outer", points=(*outline, outline[0]), texture=_pick(rng)),
        _wall_with_doors(rng, "south", low, length, split),
        _wall_with_doors(rng, "north", high, length, split),
    ]
    split_south = split + float(rng.uniform(-1.0, 1.0))
    for side, at, y in (("south", split_south, (0.05, low)), ("north", split, (high, top - 0.05))):
        walls.append(
            WallSpec(name=f"{side} room wall", points=((at, y[0]), (at, y[1])), texture=_pick(rng))
        )
    if rng.random() < 0.5:  # a slanting wall across a corner of a southern room
        cut = float(rng.uniform(1.0, 2.2))
        run = cut * math.tan(float(rng.uniform(0.5, 1.07)))
        points = ((min(run, split_south - 1.2), 0.05), (0.05, cut))
        walls.append(WallSpec(name="slanting", points=points, texture=_pick(rng)))
    boxes: dict[str, Box] = {
        "corridor": (0.1, length - 0.1, low, high),
        "south west": (0.1, split_south, 0.1, low),
        "south east": (split_south, length - 0.1, 0.1, low),
        "north west": (0.1, split, high, top - 0.1),
        "north east": (split, length - 0.1, high, top - 0.1),
    }
    rooms = tuple(
        RoomSpec(
            name=room, x=(b[0], b[1]), y=(b[2], b[3]), floor=_pick(rng, "carpet"), walls=_pick(rng)
        )
        for room, b in boxes.items()
    )
    world = WorldSpec(
        name=name,
        x=(-YARD, length),
        y=(0.0, top),
        ceiling="ceiling" if rng.random() < 0.5 else None,
        rooms=rooms,
        walls=tuple(walls),
        textures=_TEXTURES,
    )
    return _furnished(rng, world, boxes) if rng.random() < 0.5 else world


def _wall_with_doors(
    rng: np.random.Generator, name: str, y: float, length: float, split: float
) -> WallSpec:
    doors = []
    for i, (start, end) in enumerate(((0.0, split - 1.0), (split + 1.0, length))):
        width = float(rng.uniform(0.8, 1.1))
        at = float(rng.uniform(start + 0.5 * width + 0.4, end - 0.5 * width - 0.4))
        doors.append(OpeningSpec(name=f"{name} door {i}", at=(at, y), width=width))
    points = ((0.05, y), (length - 0.05, y))
    return WallSpec(name=name, points=points, openings=tuple(doors), texture=_pick(rng))


def _furnished(rng: np.random.Generator, world: WorldSpec, boxes: dict[str, Box]) -> WorldSpec:
    """``world`` with up to seven boxes and cylinders a room, clear of doors and each other."""
    plan = FloorPlan.from_world(world)
    taken: list[Shape] = [solid.shape for solid in plan.solids]
    doors = [Circle(*o.at, _CLEAR_OF_DOORS) for wall in world.walls for o in wall.openings]
    made: list[BoxSpec | CylinderSpec] = []
    for room, (x0, x1, y0, y1) in boxes.items():
        # small objects only, so that the corridor stays passable
        narrow = room == "corridor"
        for _ in range(int(rng.integers(1, 8))):
            x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
            largest = 0.4 if narrow else 0.8
            height = float(rng.choice([rng.uniform(0.15, 0.5), rng.uniform(0.5, 1.7)]))
            shape: Shape
            if rng.random() < 0.5:
                size = rng.uniform(0.2, largest, 2)
                yaw = float(rng.uniform(-math.pi, math.pi))
                shape = Rectangle(x, y, 0.5 * float(size[0]), 0.5 * float(size[1]), yaw)
            else:
                shape = Circle(x, y, 0.5 * float(rng.uniform(0.2, largest)))
            if any(overlap_depth(shape, other) > -0.02 for other in [*taken, *doors]):
                continue
            taken.append(shape)
            made.append(_thing(shape, f"thing {len(made)}", height, _pick(rng)))
    return world.model_copy(
        update={
            "boxes": tuple(thing for thing in made if isinstance(thing, BoxSpec)),
            "cylinders": tuple(thing for thing in made if isinstance(thing, CylinderSpec)),
        }
    )


def _thing(shape: Shape, name: str, height: float, texture: str) -> BoxSpec | CylinderSpec:
    at = (shape.x, shape.y)
    if isinstance(shape, Circle):
        return CylinderSpec(name=name, at=at, radius=shape.radius, height=height, texture=texture)
    size = (2.0 * shape.half_x, 2.0 * shape.half_y, height)
    return BoxSpec(name=name, at=at, size=size, yaw=shape.yaw, texture=texture)


Style = Literal["plaster", "wood", "stone", "panels"]
_STYLES: tuple[Style, ...] = ("plaster", "wood", "stone", "panels")
_TEXTURES = {
    **{
        f"{style} {i}": TextureSpec(
            style=style, seed=40 + 7 * i + k, contrast=30.0 + 10.0 * i, brightness=120.0 + 10.0 * i
        )
        for k, style in enumerate(_STYLES)
        for i in range(3)
    },
    **{
        f"carpet {i}": TextureSpec(style="carpet", seed=90 + i, finest=0.045, contrast=35.0 + 5 * i)
        for i in range(3)
    },
}


def _pick(rng: np.random.Generator, style: str | None = None) -> str:
    return f"{style or rng.choice(_STYLES)} {rng.integers(3)}"


# --- views -----------------------------------------------------------------------------------


def random_views(
    rng: np.random.Generator,
    world: WorldSpec,
    robot: RobotModel,
    count: int,
    situations: Callable[[Pose], Sequence[str]],
) -> list[RandomView]:
    """At most ``count`` views of ``world``, for the _AIMS in turn, with MARGIN to everything.

    ``situations`` gives the elementary situations that the walls form at a pose. Speeds are
    uniform in 0.1 to 0.4 m/s; half of the views are on a straight path, the others turn at up to
    0.6 rad/s. Fewer views are returned if the world has too little free space.
    """
    plan = FloorPlan.from_world(world, robot.height)
    first = int(rng.integers(len(_AIMS)))
    views: list[RandomView] = []
    for i in range(count):
        aim = _AIMS[(first + i) % len(_AIMS)]
        for attempt in range(_TRIES):
            pose = _aimed(rng, world, aim)
            turning = rng.random() >= _STRAIGHT_SHARE
            rate = float(rng.uniform(-0.6, 0.6)) if turning else 0.0
            view = RandomView(pose, Twist(float(rng.uniform(0.1, 0.4)), rate), aim)
            if not _is_free(plan, view, robot):
                continue
            shown = aim == "anywhere" or any(
                found.removeprefix("left ").removeprefix("right ") == aim
                for found in situations(pose)
            )
            if shown or attempt > _TRIES // 2:
                views.append(view)
                break
    return views


def _aimed(rng: np.random.Generator, world: WorldSpec, aim: str) -> Pose:
    if aim == "corridor":
        return _along_corridor(rng, world)
    if aim == "door":
        return _towards(rng, _door(rng, world), (0.7, 3.2), 0.9, 0.12)
    if aim == "corner":
        return _towards(rng, _corner(rng, world), (0.8, 5.0), 0.75, 0.12)
    if aim == "wall":
        return _towards(rng, _wall_point(rng, world), (0.5, 5.0), 0.28, 0.0)
    if aim == "slope wall":
        return _towards(rng, _wall_point(rng, world), (0.5, 5.0), 1.0, 0.0)
    x0, x1 = world.rooms[0].x
    y0, y1 = world.y
    return Pose(
        float(rng.uniform(x0, x1)),
        float(rng.uniform(y0, y1)),
        float(rng.uniform(-math.pi, math.pi)),
    )


def _along_corridor(rng: np.random.Generator, world: WorldSpec) -> Pose:
    corridor = world.rooms[0]
    yaw = float(rng.uniform(-0.35, 0.35)) + float(rng.choice([0.0, math.pi]))
    return Pose(float(rng.uniform(*corridor.x)), float(rng.uniform(*corridor.y)), wrap_angle(yaw))


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
    return Pose(
        x + distance * math.cos(direction), y + distance * math.sin(direction), wrap_angle(yaw)
    )


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
    x = segment.start[0] + along * math.cos(segment.yaw)
    y = segment.start[1] + along * math.sin(segment.yaw)
    return x, y, segment.yaw + float(rng.choice([-0.5, 0.5])) * math.pi


def _is_free(plan: FloorPlan, view: RandomView, robot: RobotModel) -> bool:
    """Whether the robot keeps MARGIN at its pose and on the last second of its path."""
    poses = [view.before(seconds) for seconds in (0.0, 0.25, 0.5, 0.75, 1.0)]
    points = np.array([(pose.x, pose.y) for pose in poses])
    _, y0, x1, y1 = plan.bounds
    inside = (points > (0.0, y0)).all() and (points < (x1, y1)).all()
    return bool(inside) and float(plan.clearances(points).min()) > robot.radius + MARGIN
