"""Imports floor plans as worlds with maps and missions, and exports worlds as floor plans."""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import networkx as nx
import numpy as np

from navfw.assumption import Assumption
from navfw.errors import InputError, MapError
from navfw.missions.missionspec import MissionSpec
from navfw.numerics import Array
from navfw.process.atomic import atomic_file
from navfw.process.work_progress import ProgressCallback, silent
from navfw.signals import Pose
from navfw.sim.plan_walls import wall_rectangles
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Rectangle
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import WallSpec, WorldSpec
from navfw.topomap import Place, TopoMap
from navfw.topomap.clearance_grid import ClearanceGrid
from navfw.topomap.map_builder import MARGIN, Point, build_map
from navfw.topomap.occupancy_map import (
    FREE,
    IMAGE_SUFFIXES,
    MAX_CELLS,
    OCCUPIED,
    OccupancyMap,
    RosMapSpec,
    load_ros_map,
    plan_of_image,
)
from navfw.worldgen.looks import Palette
from navfw.worldgen.plan_cleaning import GAP, SPECKLE, CleanedPlan, cleaned
from navfw.worldgen.world_draft import MAP_FILE, MIN_PATH, ROBOT, MadeWorld

RESOLUTION = 0.05
"""Edge of a cell [m], as usual for maps of Nav2."""


def exported_plan(
    world: WorldSpec, resolution: float = RESOLUTION, *, walls_only: bool = False
) -> OccupancyMap:
    """Make the plan of ``world``: cells whose centre is in a solid, or over a drop, are occupied.

    With ``walls_only`` it has neither furniture nor drops, and all doors are open, like an
    architect's plan; otherwise it is what a robot would have mapped.

    Raises:
        InputError: ``resolution`` is out of range, or the plan would have too many cells.

    """
    if not 0.001 <= resolution <= 10.0:
        raise InputError(f"expected 0.001 to 10 m, got {resolution:g}", key="resolution")
    width, depth = world.x[1] - world.x[0], world.y[1] - world.y[0]
    if width * depth / resolution**2 > MAX_CELLS:
        raise InputError(
            f"the world has {width:g} x {depth:g} m, more than {MAX_CELLS} cells of "
            f"{resolution:g} m; choose a larger resolution",
        )
    plan = SceneGeometry.from_world(world)
    if walls_only:
        walls = tuple(solid for solid in plan.solids if solid.kind == "wall")
        plan = SceneGeometry(plan.bounds, walls)
    grid = plan.configuration_space(cell=resolution)
    cells = np.where(grid.occupied, OCCUPIED, FREE).astype(np.int8)
    return OccupancyMap(cells, resolution, Pose(*grid.origin, 0.0))


PIECES_FILE = "pieces.png"
"""File name of the picture of a plan's pieces, in the folder of its world."""

_MAX_CELL = 0.25
"""Largest edge of a cell [m]: in coarser plans doors and the robot are a few cells wide."""

_EDGE = 0.5
"""Width [m] of the floor around the walls."""

_MAX_MISSIONS = 8
"""Largest number of missions that are written."""

_LONG = 15.0
"""Length [m] above which a path is long; half of the missions have long paths, if there are any."""

_MIN_THICKNESS, _MAX_THICKNESS = 0.02, 5.0
"""Limits of a wall's thickness [m] in a world file."""


_ENDS = ("room", "corridor", "junction")
"""Kinds of places at which missions begin and end."""


_Way = tuple[float, str, str]
"""A path on the map: its length [m], and the places at its ends."""


@dataclass(frozen=True, kw_only=True)
class ImportedPlan(MadeWorld):
    """The world of a floor plan, whose map includes the cleaned plan.

    ``lengths`` [m] are those of the missions' paths, ``size`` [m] is that of the free ground.
    """

    clean: CleanedPlan
    lengths: Mapping[str, float]
    size: tuple[float, float]
    assumed: tuple[Assumption, ...]

    def write(self, folder: str | Path) -> Path:
        """Write the folder like ``MadeWorld.write``, with the picture as ``PIECES_FILE``."""
        folder = super().write(folder)
        (folder / PIECES_FILE).unlink(missing_ok=True)
        if self.clean.picture is not None:
            with atomic_file(folder / PIECES_FILE) as target:
                target.write_bytes(cv2.imencode(".png", self.clean.picture)[1].tobytes())
        return folder


def read_plan(file: str | Path, resolution: float | None = None) -> OccupancyMap:
    """Read the floor plan in a yaml file, or in an image with pixels of ``resolution`` [m].

    The lower left corner of a bare image is the origin of the frame ``map``.

    Raises:
        InputError: a file cannot be read or is invalid, or ``resolution`` is missing or out of
            range.

    """
    file = Path(file)
    if file.suffix.lower() not in IMAGE_SUFFIXES:
        return load_ros_map(file)
    if resolution is None:
        raise InputError("a bare image has no scale: give --resolution, metres a pixel", file=file)
    if not 0.001 <= resolution <= 10.0:
        raise InputError(f"expected 0.001 to 10 m, got {resolution:g}", key="--resolution")
    spec = RosMapSpec(image=file.name, resolution=resolution, origin=(0.0, 0.0, 0.0))
    return plan_of_image(file, spec, file)


def import_plan(
    plan: OccupancyMap,
    name: str,
    report: ProgressCallback = silent,
    speckle: float = SPECKLE,
    gap: float = GAP,
    inside: Point | None = None,
    named: Mapping[str, Point] | None = None,
) -> ImportedPlan:
    """Import a floor plan as a world called ``name``; ``report`` is called with each step.

    Spots up to ``speckle`` [m] are removed, openings below ``gap`` [m] are closed. The piece of
    free ground with the point ``inside`` (x, y) [m] is imported, by default the largest that is not
    the white around a drawing. ``named`` names the places nearest to points (x, y) [m].

    Raises:
        InputError: it has no free ground, its resolution or origin is implausible, a value is out
            of range, or a point is not free, or not in the imported piece.
        MapError: it has no path for the robot.

    """
    if plan.resolution > _MAX_CELL:
        raise InputError(
            f"cells of {plan.resolution:g} m are too coarse, at most {_MAX_CELL:g} m: a door is a "
            f"few cells wide; give metres per pixel (for centimetres {plan.resolution / 100.0:g})",
            file=plan.file,
            key="resolution",
        )
    if not plan.free.any():
        raise InputError(
            "the plan has no free ground: free cells are white (black with negate: 1) and not "
            "transparent, and their occupancy is below free_thresh",
            file=plan.file,
        )
    report("walls")
    clean = cleaned(plan, speckle, gap, inside)
    assumed, plan = plan.assumed + clean.assumed, clean.plan
    rows, columns = np.nonzero(plan.free)
    width, depth = (float(np.ptp(cells) + 1) * plan.resolution for cells in (columns, rows))
    size = round(width, 2), round(depth, 2)
    walls = [_in_map(plan, wall) for wall in wall_rectangles(plan.free, plan.resolution)]
    world = _world(name, plan, walls, size)
    check_world(world, file=plan.file)
    topo_map = _renamed(_topological_map(world, clean, size, report), clean, named or {})
    ways = {f"{start}-to-{goal}": (length, start, goal) for length, start, goal in _ways(topo_map)}
    missions = {name: _mission(topo_map, *way) for name, way in ways.items()}
    lengths = {name: way[0] for name, way in ways.items()}
    if not ways:
        to = f"to-{next(iter(topo_map.places))}"
        missions[to], lengths[to] = _from_afar(world, clean.ground, topo_map)
    return ImportedPlan(
        world=world,
        missions=missions,
        topo_map=topo_map,
        clean=clean,
        lengths=lengths,
        size=size,
        assumed=assumed,
    )


def _in_map(plan: OccupancyMap, wall: Rectangle) -> Rectangle:
    """Return a rectangle given from the plan's corner, in the frame ``map``."""
    x, y = plan.origin.to_parent(wall.x, wall.y)
    return Rectangle(x, y, wall.half_x, wall.half_y, plan.origin.yaw + wall.yaw)


def _world(
    name: str, plan: OccupancyMap, walls: list[Rectangle], size: tuple[float, float]
) -> WorldSpec:
    corners = np.vstack([wall.corners for wall in walls])
    (x0, y0), (x1, y1) = corners.min(axis=0) - _EDGE, corners.max(axis=0) + _EDGE
    if min(x0, y0) < -500.0 or max(x1, y1) > 500.0:
        raise InputError(
            f"the plan spans x {x0:.0f} to {x1:.0f} and y {y0:.0f} to {y1:.0f} m; a world lies "
            "within -500 to 500 m: check origin, and that the resolution is in metres per pixel",
            file=plan.file,
            key="origin" if max(size) < 900.0 else "resolution",
        )
    palette = Palette(np.random.default_rng(zlib.crc32(name.encode())))
    floor, textures = palette.draw("floor"), palette.draw_many("wall", 4)
    return WorldSpec(
        name=name[:60],
        description=f"{len(walls)} walls, {size[0]:g} x {size[1]:g} m, from a floor plan.",
        x=(round(float(x0), 3), round(float(x1), 3)),
        y=(round(float(y0), 3), round(float(y1), 3)),
        floor=floor,
        walls=tuple(
            _wall(f"wall-{number}", wall, palette.pick(textures))
            for number, wall in enumerate(walls, 1)
        ),
        textures=palette.textures,
        may_overlap=True,
    )


def _wall(name: str, shape: Rectangle, texture: str) -> WallSpec:
    """Return a straight wall along the longer side of a rectangle."""
    half, thick, yaw = shape.half_x, shape.half_y, shape.yaw
    if thick > half:
        half, thick, yaw = thick, half, yaw + 0.5 * math.pi
    x, y = half * math.cos(yaw), half * math.sin(yaw)
    ends = ((shape.x - x, shape.y - y), (shape.x + x, shape.y + y))
    return WallSpec(
        name=name,
        points=tuple((round(px, 3), round(py, 3)) for px, py in ends),
        thickness=round(min(max(2.0 * thick, _MIN_THICKNESS), _MAX_THICKNESS), 3),
        texture=texture,
    )


def _topological_map(
    world: WorldSpec,
    clean: CleanedPlan,
    size: tuple[float, float],
    report: ProgressCallback,
) -> TopoMap:
    solids, plan = SceneGeometry.from_world(world), clean.plan

    def near_clearances(x: Array, y: Array, reach: float) -> Array:
        near = solids.near_clearances(x, y, reach)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        behind = (clean.ground.state(points) != FREE).reshape(near.shape) & (near > 0.1)
        return np.where(behind, -0.01, near)  # the floor outside of the walls is not for driving

    try:
        report("clearances")
        grid = ClearanceGrid.of(solids.bounds, near_clearances)
        drafted = build_map(world.name, grid, report=report)
    except MapError as error:
        raise MapError(
            f"{error}: the free ground is {size[0]:g} x {size[1]:g} m; is the resolution of "
            f"{plan.resolution:g} m per pixel right?",
            file=plan.file,
        ) from None
    return TopoMap(world.name, drafted.places.values(), drafted.passages, floor_plan=plan)


def _renamed(topo_map: TopoMap, clean: CleanedPlan, named: Mapping[str, Point]) -> TopoMap:
    """The map with the names of the places nearest to points [m] of the ground, doors excepted."""
    names: dict[str, str] = {}
    for name, point in named.items():
        if clean.ground.state(np.array([point])) != FREE:
            what = f"{name!r}: ({point[0]:g}, {point[1]:g}) is not in the free ground that is taken"
            raise InputError(what, file=clean.plan.file, key="--name")
        places = (place for place in topo_map.places.values() if place.kind != "door")
        nearest = min(places, key=lambda place: _blocked_distance(clean.ground, place, point))
        if nearest.name in names:
            other = names[nearest.name]
            raise InputError(f"{other!r} and {name!r} are one place", key="--name")
        names[nearest.name] = name
    return topo_map.renamed(names)


def _blocked_distance(ground: OccupancyMap, place: Place, point: Point) -> tuple[bool, float]:
    """Whether a wall is between the two, and their distance [m]."""
    away = place.distance(*point)
    line = np.linspace(point, (place.x, place.y), 2 + int(away / ground.resolution))
    return bool((ground.state(line) != FREE).any()), away


def _ways(topo_map: TopoMap) -> list[_Way]:
    """Ways between rooms, halls and corridors: the longest ones, and long ones of other lengths.

    None is shorter than ``MIN_PATH``.
    """
    lengths = dict(nx.all_pairs_dijkstra_path_length(topo_map.graph, weight="length"))
    ends = [p.name for p in topo_map.places.values() if p.kind in _ENDS]
    ways = [(lengths[a][b], a, b) for a, b in itertools.combinations(ends, 2)]
    ways = sorted((way for way in ways if way[0] >= MIN_PATH), key=lambda way: -way[0])
    long = [way for way in ways if way[0] >= _LONG]
    short = [way for way in ways if way[0] < _LONG]
    half = _MAX_MISSIONS // 2
    return [*_with_new_ends(long, half), *_with_new_ends(short, half)]


def _with_new_ends(ways: list[_Way], count: int) -> list[_Way]:
    """Return the first ``count`` of the ways that have no end in common with those before."""
    chosen: list[_Way] = []
    for way in ways:
        used = {end for _, *ends in chosen for end in ends}
        if len(chosen) < count and not used.intersection(way[1:]):
            chosen.append(way)
    return chosen


def _mission(topo_map: TopoMap, length: float, start: str, goal: str) -> MissionSpec:
    """Return the mission to drive a way, facing along it at its start."""
    route = nx.dijkstra_path(topo_map.graph, start, goal, weight="length")
    at, then = (topo_map.places[name] for name in route[:2])
    yaw = math.atan2(then.y - at.y, then.x - at.x)
    return _mission_spec(start, goal, length, {"place": start, "yaw": round(yaw, 3)})


def _from_afar(
    world: WorldSpec, ground: OccupancyMap, topo_map: TopoMap
) -> tuple[MissionSpec, float]:
    """For a map without long ways: to its first place from afar in the free ground; the length."""
    goal, solids = next(iter(topo_map.places.values())), SceneGeometry.from_world(world)
    centres = ground.centres(*np.nonzero(ground.free))
    centres = centres[solids.clearances(centres) >= ROBOT.radius + 2.0 * MARGIN]
    start = centres[np.argmax(np.hypot(centres[:, 0] - goal.x, centres[:, 1] - goal.y))].round(2)
    length, path = solids.shortest_path((start[0], start[1]), (goal.x, goal.y), ROBOT.radius)
    yaw = math.atan2(path[1, 1] - start[1], path[1, 0] - start[0])
    at = [*start.tolist(), round(yaw, 3)]
    return _mission_spec(f"({start[0]:g}, {start[1]:g})", goal.name, length, at), length


def _mission_spec(start: str, goal: str, length: float, at: object) -> MissionSpec:
    """Return the mission of a way, from the start ``at``."""
    return MissionSpec.model_validate(
        {
            "description": f"From {start} to {goal}, {length:.1f} m.",
            "map": f"../{MAP_FILE}",
            "start": at,
            "goals": [goal],
            "timeout": float(round(60.0 + 5.0 * length)),
        }
    )
