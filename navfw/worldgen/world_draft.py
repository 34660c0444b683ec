"""Worlds in the making: a draft under construction, and the result of a generator with its files.

A draft has the solids so far, and checks whether another one fits. The result is world, mission and
map.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from navfw.config.input_file import is_file, is_folder, open_input
from navfw.config.yaml_text import write_yaml_text
from navfw.errors import ConfigError, InputError
from navfw.missions.missionspec import MissionSpec
from navfw.process.atomic import AtomicFolder
from navfw.robot import RobotModel
from navfw.sim import worldspec
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle, Shape, gap_between
from navfw.sim.worldspec import WorldSpec
from navfw.topomap import Passage, TopoMap
from navfw.topomap.mapfile import map_data
from navfw.topomap.occupancy_map import save_ros_map
from navfw.worldgen.looks import Palette

Point = tuple[float, float]
_T = TypeVar("_T")

WALL = 0.1
"""Thickness of walls [m]."""

MARGIN = 0.06
"""Smallest clearance of the robot on either side of a generated passage [m]."""

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
"""The keys of a world that a draft has."""


class Unsuitable(Exception):  # noqa: N818 - not an error: the next sub-seed is tried
    """The random draws gave no suitable world; the generator tries the next sub-seed."""


def blend(easy: float, hard: float, difficulty: float) -> float:
    """Interpolate linearly: ``easy`` at difficulty 0, ``hard`` at 1."""
    return easy + (hard - easy) * difficulty


def rounded(*values: float) -> tuple[float, ...]:
    """Round values to three decimals, as in the files."""
    return tuple(round(float(value), 3) for value in values)


def by_axis(axis: int, along: _T, across: _T) -> tuple[_T, _T]:
    """Order values ``along`` an axis (0: x) and ``across`` it as (for x, for y)."""
    return (along, across) if axis == 0 else (across, along)


@dataclass
class WorldDraft:
    """A world under construction, within x and y [m]; ``start`` (x, y, yaw), ``goal`` (x, y).

    The circles ``free`` are kept clear of solids; ``events`` are the mission's.
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
        """Make an empty floor of ``width`` (x) and ``depth`` (y) [m]."""
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
        """Keep solids that are added later at least ``radius`` [m] from x, y [m]."""
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
        """Add a box or cylinder of that outline and ``height`` [m], without checking it."""
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
        """Make the specification of the world so far."""
        return worldspec.WorldSpec(
            name=name,
            description=self.description,
            textures=dict(self.palette.textures),
            **{key: getattr(self, key) for key in _DRAWN},
        )

    def geometry(self) -> SceneGeometry:
        """Make the geometry of the world so far."""
        return SceneGeometry.from_world(self.world("draft"), ROBOT.height)


MISSION = "cross"
"""Name of the mission in a generated folder."""

MIN_PATH = 5.0
"""Smallest length [m] of the path of a mission that is made with a world."""

MAP_FILE = "map.yaml"
"""Name of the map file in a generated folder, beside ``world.yaml``."""

_PLAN_FILE = "plan.yaml"
"""Name of the file of a map's floor plan in a generated folder, beside the map."""

_HEADER = "# Made by navfw"
"""Beginning of generated files, by which they are recognised."""
_NOTICE = f"{_HEADER}; generating it again overwrites changes.\n"


@dataclass(frozen=True, kw_only=True)
class MadeWorld:
    """A world with its missions by name, each of which is feasible, and their map.

    If no mission names a map file, the map has only start and goal, and is not written.
    """

    world: WorldSpec
    missions: Mapping[str, MissionSpec]
    topo_map: TopoMap

    @property
    def mission(self) -> MissionSpec:
        """The only mission of a world that was generated, or imported from Gazebo."""
        return self.missions[MISSION]

    @property
    def has_map(self) -> bool:
        """Whether ``write`` writes a map file."""
        return any(mission.map is not None for mission in self.missions.values())

    def write(self, folder: str | Path) -> Path:
        """Write a folder for ``navfw run FOLDER MISSION``, and return it.

        Generated files in it are replaced; other files, such as further missions, are kept. A map's
        floor plan is written beside it.

        Raises:
            InputError: the folder cannot be written, or its world was not made by navfw.

        """
        folder = Path(folder)
        _check_target(folder)
        with AtomicFolder(folder, re.compile(".*", re.DOTALL), "--out") as target:
            if is_folder(folder):
                shutil.copytree(folder, target.path, symlinks=True, dirs_exist_ok=True)
            (target.path / "missions").mkdir(exist_ok=True)
            _write_yaml(target.path / "world.yaml", _plain(self.world))
            for name, mission in self.missions.items():
                _write_yaml(target.path / "missions" / f"{name}.yaml", _plain(mission))
            if self.has_map:
                self._write_map(target.path)
            else:
                (target.path / MAP_FILE).unlink(missing_ok=True)
        return folder

    def _write_map(self, folder: Path) -> None:
        topo_map, plan = self.topo_map, self.topo_map.floor_plan
        if plan is not None:
            save_ros_map(plan, folder / _PLAN_FILE)
        passages = [_rounded(topo_map, passage) for passage in topo_map.passages]
        written = TopoMap(topo_map.name, topo_map.places.values(), passages)
        _write_yaml(folder / MAP_FILE, map_data(written, None if plan is None else _PLAN_FILE))


def _check_target(folder: Path) -> None:
    """Refuse to overwrite anything but a generated folder."""
    if not is_folder(folder):
        if is_file(folder):
            raise InputError("is a file; choose a folder to write the world to", file=folder)
        return
    if not any(folder.iterdir()):
        return
    try:
        with open_input(folder / "world.yaml") as stream:
            made_here = stream.readline(len(_HEADER)) == _HEADER.encode()
    except ConfigError:
        made_here = False
    if not made_here:
        raise InputError(
            "is not empty, and its files were not made by navfw; choose another folder",
            file=folder,
        )


def _rounded(topo_map: TopoMap, passage: Passage) -> Passage:
    """Return the passage with rounded width and length; straight, if it is so within 5 mm."""
    end = topo_map.places[passage.b]
    straight = topo_map.places[passage.a].distance(end.x, end.y)
    far = abs(passage.length - straight) > 0.005
    length = round(passage.length, 3) if far else straight
    return replace(passage, length=length, width=round(passage.width, 3))


def _plain(spec: WorldSpec | MissionSpec) -> dict[str, Any]:
    return spec.model_dump(mode="json", by_alias=True, exclude_defaults=True)


def _write_yaml(path: Path, data: Mapping[str, Any]) -> None:
    """Write YAML with one line for each entry of a list."""
    path.write_text(_NOTICE + write_yaml_text(dict(data)), encoding="utf-8")
