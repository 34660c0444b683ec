"""A draft map derived from a world's geometry, for a person to name and edit.

The skeleton of the free space gives the lines. A short narrow gap on a line is a door. The doors
divide the free space into regions: corridors, which are long for their width, and rooms. Lines meet
at junctions and bend at corners. Each door gets a place straight before and behind it, so that
robots cross it at a right angle.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping

import cv2
import networkx as nx
import numpy as np

from navfw.errors import MapError
from navfw.robot import RobotModel
from navfw.signals import Array
from navfw.topomap.clearance_grid import ClearanceGrid
from navfw.topomap.elements import Passage, Place, PlaceKind
from navfw.topomap.skeleton import skeleton_graph
from navfw.topomap.topological_map import TopoMap

__all__ = ["build_map"]

Point = tuple[float, float]
Bounds = tuple[float, float, float, float]

MARGIN = 0.07
"""Clearance [m] that passages keep beyond the robot's radius."""

DOOR_WIDTH = 1.5
"""Largest width of a door [m]."""

BEFORE_DOOR = 0.8
"""Distance [m] from a door to the places before and behind it."""

CORRIDOR_RATIO = 4.0
"""A region whose area exceeds this many times the square of its width is a corridor."""

MERGE_DISTANCE = 0.6
"""Places nearer than this [m] are merged, where the straight line between them is free."""

DETOUR_RATIO = 1.5
"""Length of a line over its straight distance from which it leads round an obstacle."""

ENOUGH_CLEARANCE = 0.45
"""Clearance [m] that always suffices for a straight passage."""


def build_map(
    name: str,
    grid: ClearanceGrid,
    robot: RobotModel | None = None,
    rooms: Mapping[str, tuple[float, float, float, float]] | None = None,
) -> TopoMap:
    """The map of the free space in ``grid`` for ``robot`` (default: ``RobotModel()``).

    ``rooms`` (x0, x1, y0, y1) [m] by name, where given, provide the names of places.

    Raises:
        MapError: there is no free space for the robot.

    """
    robot = robot or RobotModel()
    need = robot.radius + MARGIN
    graph = skeleton_graph(grid, need)
    if not graph:
        raise MapError(f"no space is free for a robot of radius {robot.radius:g} m", key=name)
    lines = _StraightLines(grid, need)
    for a, b, data in list(graph.edges(data=True)):
        lines.add_line(graph, min(a, b), max(a, b), data["line"])
    for node in nx.isolates(graph):
        lines.point_of(graph, node)
    lines.merge()
    return lines.finish(name, rooms or {})


class _StraightLines:
    """The skeleton's lines as points and free straight segments between them."""

    def __init__(self, grid: ClearanceGrid, need: float) -> None:
        self.grid = grid
        self.need = need
        self.graph = nx.Graph()
        self.doors: dict[int, Point] = {}  # by point: the direction through the door
        self._point_of_node: dict[int, int] = {}
        self._count = 0

    def point_of(self, skeleton: nx.MultiGraph, node: int) -> int:
        """The point at a node of the skeleton."""
        if node not in self._point_of_node:
            self._point_of_node[node] = self._point(skeleton.nodes[node]["at"])
        return self._point_of_node[node]

    def add_line(self, skeleton: nx.MultiGraph, a: int, b: int, line: Array) -> None:
        """Add a line of the skeleton between two of its nodes, with its doors."""
        last, begin = self.point_of(skeleton, a), 0
        for index, through in _doors(self.grid, line):
            before, behind = (self._beside_door(line[index], through, sign) for sign in (-1, 1))
            door = self._point((float(line[index, 0]), float(line[index, 1])), door=through)
            start = _beyond_door(line, index, -1)
            end = _beyond_door(line, index, 1)
            if before is not None and start > begin:
                last = self._follow(last, before, line[begin : start + 1])
            elif index > begin:
                last = self._follow(last, None, line[begin:index])
            self.graph.add_edge(last, door)
            last, begin = door, index
            if behind is not None and end < len(line) - 1:
                self.graph.add_edge(door, behind)
                last, begin = behind, end
        self._follow(last, self.point_of(skeleton, b), line[begin:])

    def _beside_door(self, at: Array, through: Point, sign: int) -> int | None:
        x = float(at[0]) + sign * BEFORE_DOOR * through[0]
        y = float(at[1]) + sign * BEFORE_DOOR * through[1]
        if self.grid.along((float(at[0]), float(at[1])), (x, y)) < self.need:
            return None
        return self._point((x, y))

    def _follow(self, start: int, end: int | None, line: Array) -> int:
        """Add straight segments along ``line`` from one point to another; returns the last."""
        points = [self._at(start), *((float(x), float(y)) for x, y in line[1:-1])]
        if end is not None:
            points.append(self._at(end))
        last, here = start, 0
        while here < len(points) - 1:
            ahead = self._farthest(points, here)
            final = ahead == len(points) - 1 and end is not None
            point = end if final and end is not None else self._point(points[ahead])
            if point != last:
                self.graph.add_edge(last, point)
            last, here = point, ahead
        return last

    def _farthest(self, points: list[Point], here: int) -> int:
        """The last of the points in a straight line from ``here`` with enough clearance."""
        low, walked, best = math.inf, 0.0, here + 1
        for ahead in range(here + 1, len(points)):
            low = min(low, self.grid.at(*points[ahead]))
            walked += math.dist(points[ahead - 1], points[ahead])
            if walked > DETOUR_RATIO * math.dist(points[here], points[ahead]) + MERGE_DISTANCE:
                break  # the line leads round an obstacle
            wanted = min(0.8 * low, ENOUGH_CLEARANCE)
            if self.grid.along(points[here], points[ahead]) >= max(wanted, self.need - 0.03):
                best = ahead
        return best

    def merge(self) -> None:
        """Merge points near each other, except doors and their neighbours."""
        fixed = set(self.doors)
        for door in self.doors:
            fixed.update(self.graph[door])
        if self.graph.number_of_edges():  # places beside doors without a line
            self.graph.remove_nodes_from(list(nx.isolates(self.graph)))
        # keep the largest connected part only: the others cannot be reached from it
        kept = max(nx.connected_components(self.graph), key=len)
        self.graph.remove_nodes_from([point for point in self.graph if point not in kept])
        self.doors = {point: d for point, d in self.doors.items() if point in kept}
        changed = True
        while changed:
            changed = False
            for a, b in list(self.graph.edges):
                if math.dist(self._at(a), self._at(b)) >= MERGE_DISTANCE or {a, b} <= fixed:
                    continue
                kept, gone = (a, b) if a in fixed or b not in fixed else (b, a)
                if gone in fixed or not self._can_replace(kept, gone):
                    continue
                self.graph.add_edges_from(
                    (kept, other) for other in list(self.graph[gone]) if other != kept
                )
                self.graph.remove_node(gone)
                changed = True
                break

    def _can_replace(self, kept: int, gone: int) -> bool:
        """Whether the lines from ``kept`` to all neighbours of ``gone`` are free."""
        return all(
            self.grid.along(self._at(kept), self._at(other)) >= self.need - 0.03
            for other in self.graph[gone]
            if other != kept
        )

    def finish(self, name: str, rooms: Mapping[str, Bounds]) -> TopoMap:
        """The map of all points, named after ``rooms``."""
        names = _Names(rooms)
        doors = ((self._at(point), through) for point, through in self.doors.items())
        regions = _Regions(self.grid, doors)
        places: dict[int, Place] = {}
        centres = {
            region: max(points, key=lambda point: self.grid.at(*self._at(point)))
            for region, points in self._by_region(regions).items()
            if not regions.is_corridor(region)
        }
        chosen = set(centres.values())
        # the centres of rooms first: they get the names without numbers
        for point in sorted(self.graph, key=lambda point: (point not in chosen, point)):
            at = self._at(point)
            kind = self._kind(point, regions, point in chosen)
            if point in self.doors:
                label = names.door(at, self.doors[point])
            else:
                label = (names.centre if point in chosen else names.place)(at, kind)
            places[point] = Place(label, round(at[0], 2), round(at[1], 2), kind)
        passages = [
            passage
            for a, b in self.graph.edges
            if (passage := self._passage(places[a], places[b])) is not None
        ]
        return TopoMap(name, places.values(), passages)

    def _passage(self, a: Place, b: Place) -> Passage | None:
        length = a.distance(b.x, b.y)
        if length == 0.0:
            return None
        width = math.floor(40.0 * self.grid.along((a.x, a.y), (b.x, b.y))) / 20.0
        doorness = float("door" in (a.kind, b.kind))
        return Passage(a.name, b.name, length, max(width, 0.05), doorness=doorness)

    def _by_region(self, regions: _Regions) -> dict[int, list[int]]:
        found: dict[int, list[int]] = {}
        for point in self.graph:
            region = regions.at(*self._at(point))
            if point not in self.doors and region:
                found.setdefault(region, []).append(point)
        return found

    def _kind(self, point: int, regions: _Regions, centre: bool) -> PlaceKind:
        if point in self.doors:
            return "door"
        around = [self._at(other) for other in self.graph[point]]
        x, y = self._at(point)
        bent = False
        if len(around) == 2:
            a, b = (math.atan2(at[1] - y, at[0] - x) for at in around)
            bent = abs(math.pi - abs(a - b) % (2.0 * math.pi)) > math.radians(40.0)
        if not regions.is_corridor(regions.at(x, y)):
            return "corner" if bent and not centre else "room"
        if len(around) > 2:
            return "junction"
        return "corner" if bent else "corridor"

    def _point(self, at: Point, door: Point | None = None) -> int:
        self._count += 1
        self.graph.add_node(self._count, at=(float(at[0]), float(at[1])))
        if door is not None:
            self.doors[self._count] = door
        return self._count

    def _at(self, point: int) -> Point:
        at: Point = self.graph.nodes[point]["at"]
        return at


class _Regions:
    """The regions of free space between the doors: 0 where occupied, else a region's number."""

    def __init__(self, grid: ClearanceGrid, doors: Iterable[tuple[Point, Point]]) -> None:
        self._grid = grid
        free = (grid.clearance > 0.1).astype(np.uint8)
        half = 0.5 * DOOR_WIDTH / grid.cell
        for at, through in doors:
            row, column = self._index(*at)
            ends = [
                (round(column - sign * half * through[1]), round(row + sign * half * through[0]))
                for sign in (-1, 1)
            ]
            cv2.line(free, ends[0], ends[1], 0, 2)
        _, self._labels = cv2.connectedComponents(free, connectivity=4)
        self._corridors: dict[int, bool] = {}

    def at(self, x: float, y: float) -> int:
        """The region at a point [m]."""
        return int(self._labels[self._index(x, y)])

    def is_corridor(self, region: int) -> bool:
        """Whether the region is long for its width (``CORRIDOR_RATIO``)."""
        if region not in self._corridors:
            mine = self._labels == region
            width = 2.0 * float(self._grid.clearance[mine].max())
            area = float(mine.sum()) * self._grid.cell**2
            self._corridors[region] = region > 0 and area > CORRIDOR_RATIO * width * width
        return self._corridors[region]

    def _index(self, x: float, y: float) -> tuple[int, int]:
        cell, (x0, y0) = self._grid.cell, self._grid.origin
        return round((y - y0) / cell), round((x - x0) / cell)


class _Names:
    """Unique names for places, after the rooms that contain them."""

    def __init__(self, rooms: Mapping[str, Bounds]) -> None:
        # smallest first: of nested rooms the inner one gives the name
        self._rooms = sorted(rooms.items(), key=lambda room: _area(room[1]))
        self._taken: set[str] = set()

    def centre(self, at: Point, kind: str) -> str:
        """The name of the place that represents a room."""
        return self._free(self._room(*at) or kind, first=True)

    def place(self, at: Point, kind: str) -> str:
        """The name of any other place."""
        return self._free(self._room(*at) or kind, first=False)

    def door(self, at: Point, through: Point) -> str:
        """The name of a door: that of the rooms on its sides."""
        sides = []
        for sign in (-1, 1):
            room = self._room(at[0] + sign * 0.5 * through[0], at[1] + sign * 0.5 * through[1])
            if room is not None and room not in sides:
                sides.append(room)
        return self._free("-".join([*sorted(sides), "door"]), first=True)

    def _room(self, x: float, y: float) -> str | None:
        inside = (n for n, (x0, x1, y0, y1) in self._rooms if x0 <= x <= x1 and y0 <= y <= y1)
        return next(inside, None)

    def _free(self, stem: str, first: bool) -> str:
        names = itertools.chain(
            [stem] if first else [], (f"{stem}-{n}" for n in itertools.count(1))
        )
        name = next(name for name in names if name not in self._taken)
        self._taken.add(name)
        return name


def _area(bounds: Bounds) -> float:
    x0, x1, y0, y1 = bounds
    return (x1 - x0) * (y1 - y0)


def _doors(grid: ClearanceGrid, line: Array) -> list[tuple[int, Point]]:
    """The doors on ``line``: index of each, and the unit direction through it.

    A door is the narrowest point of a gap that widens shortly on both sides.
    """
    clearance = np.array([grid.at(*point) for point in line])
    found: list[tuple[int, Point]] = []
    for index in range(1, len(line) - 1):
        here = clearance[index]
        around = slice(max(index - 10, 0), index + 11)
        if here > 0.5 * DOOR_WIDTH or here > clearance[around].min() + 1e-9:
            continue
        through = _direction(line, index)
        at = line[index]
        opens = [
            grid.at(at[0] + sign * 0.4 * through[0], at[1] + sign * 0.4 * through[1])
            for sign in (-1, 1)
        ]
        jambs = [
            grid.at(at[0] - sign * reach * through[1], at[1] + sign * reach * through[0])
            for sign in (-1, 1)
            for reach in (here + 0.05,)
        ]
        beyond = found and np.linalg.norm(line[found[-1][0]] - at) < BEFORE_DOOR
        if min(opens) >= here + 0.06 and max(jambs) < 0.12 and not beyond:
            found.append((index, through))
    return found


def _direction(line: Array, index: int) -> Point:
    """The unit direction of ``line`` at a point; along an axis if within 15 degrees of it."""
    step = line[min(index + 6, len(line) - 1)] - line[max(index - 6, 0)]
    angle = math.atan2(step[1], step[0])
    square = 0.5 * math.pi * round(angle / (0.5 * math.pi))
    if abs(angle - square) < math.radians(15.0):
        angle = square
    return math.cos(angle), math.sin(angle)


def _beyond_door(line: Array, index: int, step: int) -> int:
    """Index of the first point of ``line`` at least ``BEFORE_DOOR`` from ``index``."""
    here = index
    while 0 < here < len(line) - 1 and np.linalg.norm(line[here] - line[index]) < BEFORE_DOOR:
        here += step
    return here
