"""A world under construction: its solids so far, and whether another one fits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from navfw.robot import RobotModel
from navfw.sim import worldspec
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle, Shape, gap_between
from navfw.topomap import TopoMap
from navfw.worldgen.looks import Palette

Point = tuple[float, float]

WALL = 0.1
"""Thickness of walls [m]."""

MARGIN = 0.06
"""Least clearance of the robot on either side of a generated passage [m]."""

ROBOT = RobotModel()
"""The robot for which worlds are traversable."""

FAST_ROBOT = ROBOT.model_copy(update={"max_v": 1.2})
"""The robot for fields of poles: BARN's score is relative to the time of a robot at 2 m/s."""

POLES_STACK = "poles"
"""The stack for fields of poles."""


_DRAWN = (
    *("x", "y", "floor", "ceiling", "rooms", "walls", "doors", "boxes", "cylinders", "movers"),
    *("light", "hazards"),
)
"""What a draft has of a world, by its keys."""


class Unsuitable(Exception):  # noqa: N818 - not an error: the next sub-seed is tried
    """The random draws gave no suitable world."""


def blend(easy: float, hard: float, difficulty: float) -> float:
    """Linear interpolation: ``easy`` at difficulty 0, ``hard`` at 1."""
    return easy + (hard - easy) * difficulty


def rounded(*values: float) -> tuple[float, ...]:
    """Values rounded to three decimals, as in the files."""
    return tuple(round(float(value), 3) for value in values)


@dataclass
class WorldDraft:
    """A world under construction, within x and y [m]; ``start`` (x, y, yaw), ``goal`` (x, y).

    The circles ``free`` stay clear of solids; ``events`` are the mission's.
    """

    rng: np.random.Generator
    x: tuple[float, float]
    y: tuple[float, float]
    palette: Palette
    description: str = ""
    floor: str = "carpet"
    ceiling: str | None = None
    rooms: list[worldspec.RoomSpec] = field(default_factory=list)
    walls: list[worldspec.WallSpec] = field(default_factory=list)
    doors: list[worldspec.DoorSpec] = field(default_factory=list)
    boxes: list[worldspec.BoxSpec] = field(default_factory=list)
    cylinders: list[worldspec.CylinderSpec] = field(default_factory=list)
    movers: list[worldspec.WalkerSpec] = field(default_factory=list)
    light: worldspec.LightSpec = field(default_factory=worldspec.LightSpec)
    hazards: list[str] = field(default_factory=list)
    events: list[Mapping[str, object]] = field(default_factory=list)
    free: list[Circle] = field(default_factory=list)
    shapes: list[Shape] = field(default_factory=list)
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    goal: Point = (0.0, 0.0)
    goal_place: str | None = None
    topo_map: TopoMap | None = None
    clearance: float = ROBOT.radius + MARGIN
    time_allowance: float = 30.0
    robot: RobotModel = ROBOT
    stack: str | None = None

    @classmethod
    def empty(cls, rng: np.random.Generator, width: float, depth: float) -> WorldDraft:
        """An empty floor of ``width`` (x) and ``depth`` (y) [m]."""
        palette = Palette(rng)
        width, depth = rounded(width, depth)
        draft = cls(rng, (0.0, width), (0.0, depth), palette)
        draft.floor = palette.draw("floor")
        return draft

    def enclose(self, texture: str, height: float = 2.4) -> None:
        """Add an outer wall along the edge of the floor."""
        (x0, x1), (y0, y1) = self.x, self.y
        x0, y0, x1, y1 = rounded(x0 + WALL / 2, y0 + WALL / 2, x1 - WALL / 2, y1 - WALL / 2)
        corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))
        self.walls.append(
            worldspec.WallSpec(name="outer-wall", points=corners, height=height, texture=texture)
        )

    def keep_free(self, x: float, y: float, radius: float) -> None:
        """Keep solids at least ``radius`` [m] from a point."""
        self.free.append(Circle(x, y, radius))

    def set_start_and_goal(self, start: Point, goal: Point, towards: Point | None = None) -> None:
        """Set the mission's start, facing ``towards`` or the goal, and its goal [m]."""
        facing = goal if towards is None else towards
        yaw = math.atan2(facing[1] - start[1], facing[0] - start[0])
        x, y, yaw = rounded(*start, yaw)
        self.start = (x, y, yaw)
        gx, gy = rounded(*goal)
        self.goal = (gx, gy)

    # --- solids -------------------------------------------------------------------------------

    def fits(self, shape: Shape, gap: float) -> bool:
        """Whether a solid may be added: ``gap`` [m] from the others, outside kept-free circles."""
        for circle in self.free:
            if shape.distance(np.array([[circle.x, circle.y]]))[0] < circle.radius:
                return False
        return all(gap_between(shape, other) >= gap for other in self.shapes)

    def add(self, name: str, shape: Shape, height: float, texture: str) -> None:
        """Add a box or cylinder with this outline."""
        self.shapes.append(shape)
        x, y, yaw, tall = rounded(shape.x, shape.y, shape.yaw, height)
        if isinstance(shape, Circle):
            (radius,) = rounded(shape.radius)
            self.cylinders.append(
                worldspec.CylinderSpec(
                    name=name, at=(x, y), radius=radius, height=tall, texture=texture
                )
            )
        else:
            width, depth = rounded(2 * shape.half_x, 2 * shape.half_y)
            size = (width, depth, tall)
            self.boxes.append(
                worldspec.BoxSpec(name=name, at=(x, y), size=size, yaw=yaw, texture=texture)
            )

    def world(self, name: str) -> worldspec.WorldSpec:
        """The specification of the world so far."""
        return worldspec.WorldSpec(
            name=name,
            description=self.description,
            textures=dict(self.palette.textures),
            **{key: getattr(self, key) for key in _DRAWN},
        )

    def geometry(self) -> SceneGeometry:
        """The geometry of the world so far."""
        return SceneGeometry.from_world(self.world("draft"), ROBOT.height)
