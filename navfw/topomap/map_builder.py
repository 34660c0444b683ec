"""A draft map derived from a world's geometry, for a person to name and edit.

The skeleton of the free space gives the lines. A short narrow gap on a line is a door. The doors
divide the free space into regions: corridors, which are long for their width, and rooms. Lines meet
at junctions and bend at corners. Each door gets a place straight before and behind it, so that
robots cross it at a right angle. Where the lines lead round wide ground, shortcuts are added.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import networkx as nx

from navfw.errors import MapError
from navfw.numerics import Array
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.robot import RobotModel
from navfw.topomap.clearance_grid import ClearanceGrid, skeleton_graph
from navfw.topomap.elements import Passage, Place, PlaceKind
from navfw.topomap.map_regions import BEFORE_DOOR, DOOR_WIDTH, Bounds, PlaceNames, Regions, doors_on
from navfw.topomap.shortcuts import spanner
from navfw.topomap.topological_map import TopoMap

Point = tuple[float, float]
MARGIN = 0.07  # chosen
"""Clearance [m] that passages keep beyond the robot's radius."""

MERGE_DISTANCE = 0.6  # chosen
"""Places nearer than this [m] are merged, where the straight line between them is free."""

_MIN_ROOM_AREA = 2.5  # chosen
"""Least area [m^2] on both sides of a door."""

SPACING = 2.0  # chosen
"""Points of one region that are no doors, nor beside one, have at least this distance [m]."""

_WIDE_SPACING = 1.5  # chosen
"""In wide ground their distance is at least this many times the clearance."""

_DETOUR_RATIO = 1.5  # chosen
"""Length of a line over its straight distance from which it leads round an obstacle."""

_ENOUGH_CLEARANCE = 0.45  # chosen
"""Clearance [m] that always suffices for a straight passage."""


def build_map(
    name: str,
    grid: ClearanceGrid,
    rooms: Mapping[str, Bounds] | None = None,
    report: ProgressCallback = silent,
    radius: float | None = None,
    roughness: float = 0.0,
) -> TopoMap:
    """Derive a map of the free space in ``grid`` for a robot of ``radius`` [m].

    Without ``radius`` it is the default robot. Only its largest connected part is mapped. ``rooms``
    (x0, x1, y0, y1) [m] by name, if given, provide the names of places; else they are room, hall or
    corridor, numbered. Walls of an observed map are uneven by ``roughness`` [m]: a narrowing
    by less is no door.

    Raises:
        MapError: there is no free space for the robot.

    """
    radius = RobotModel().radius if radius is None else radius
    need = radius + MARGIN
    report("skeleton of the free space")
    graph = skeleton_graph(grid, need)
    if not graph:
        raise MapError(f"no space is free for a robot of radius {radius:g} m", key=name)
    lines = _StraightLines(grid, need, roughness)
    for a, b, data in with_progress(list(graph.edges(data=True)), "lines", report):
        lines.add_line(graph, min(a, b), max(a, b), data["line"])
    for node in nx.isolates(graph):
        lines.point_of(graph, node)
    report("doors")
    lines.merge()
    lines.drop_false_doors()
    report("shortcuts")
    lines.shorten()
    report("places")
    return lines.finish(name, rooms or {})


class _StraightLines:
    """The skeleton's lines as points and free straight segments between them."""

    def __init__(self, grid: ClearanceGrid, need: float, roughness: float) -> None:
        self.grid = grid
        self.open = grid.without_columns()
        self.need, self._roughness = need, roughness
        self.graph = nx.Graph()
        self.doors: dict[int, Point] = {}  # by point: the direction through the door
        self.centres: set[int] = set()  # the points that represent rooms and halls
        self._point_of_node: dict[int, int] = {}
        self._count = 0

    def point_of(self, skeleton: nx.MultiGraph, node: int) -> int:
        """Return the point at a node of the skeleton, added if it is new."""
        if node not in self._point_of_node:
            self._point_of_node[node] = self._point(skeleton.nodes[node]["at"])
        return self._point_of_node[node]

    def add_line(self, skeleton: nx.MultiGraph, a: int, b: int, line: Array) -> None:
        """Add a line of the skeleton between two of its nodes, with its doors."""
        last, begin = self.point_of(skeleton, a), 0
        for door in doors_on(self.open, line, self._roughness):
            index = door.index
            before, behind = (self._beside_door(door.at, door.through, s) for s in (-1, 1))
            middle = self._point(door.at, door=door.through)
            start = _beyond_door(line, index, -1)
            end = _beyond_door(line, index, 1)
            if before is not None and start > begin:
                last = self._follow(last, before, line[begin : start + 1])
            elif index > begin:
                last = self._follow(last, None, line[begin:index])
            self.graph.add_edge(last, middle)
            last, begin = middle, index
            if behind is not None and end < len(line) - 1:
                self.graph.add_edge(middle, behind)
                last, begin = behind, end
        self._follow(last, self.point_of(skeleton, b), line[begin:])

    def _beside_door(self, at: Point, through: Point, sign: int) -> int | None:
        x, y = at[0] + sign * BEFORE_DOOR * through[0], at[1] + sign * BEFORE_DOOR * through[1]
        return None if self.grid.along(at, (x, y)) < self.need else self._point((x, y))

    def _follow(self, start: int, end: int | None, line: Array) -> int:
        """Add straight segments along ``line`` from one point to another; return the last."""
        points = [self._at(start), *((float(x), float(y)) for x, y in line[1:-1])]
        if end is not None:
            points.append(self._at(end))
        last, begin = start, 0
        while begin < len(points) - 1:
            ahead = self._farthest(points, begin)
            final = ahead == len(points) - 1 and end is not None
            point = end if final and end is not None else self._point(points[ahead])
            if point != last:
                self.graph.add_edge(last, point)
            last, begin = point, ahead
        return last

    def _farthest(self, points: list[Point], begin: int) -> int:
        """Return the last of the points in a straight line from ``begin`` with enough clearance."""
        low, walked, best = math.inf, 0.0, begin + 1
        for ahead in range(begin + 1, len(points)):
            low = min(low, self.grid.at(*points[ahead]))
            walked += math.dist(points[ahead - 1], points[ahead])
            if walked > _DETOUR_RATIO * math.dist(points[begin], points[ahead]) + MERGE_DISTANCE:
                break  # the line leads round an obstacle
            wanted = min(0.8 * low, _ENOUGH_CLEARANCE)
            if self.grid.along(points[begin], points[ahead]) >= max(wanted, self.need - 0.03):
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
        """Return whether the lines from ``kept`` to all neighbours of ``gone`` are free."""
        return all(
            self.grid.along(self._at(kept), self._at(other)) >= self.need - 0.03
            for other in self.graph[gone]
            if other != kept
        )

    def drop_false_doors(self) -> None:
        """Keep the doors between two rooms: a gap between furniture has one region on both sides.

        Columns in rows enclose regions too small for a room.
        """
        regions = self._regions()
        beyond = 0.9 * BEFORE_DOOR
        false = []
        for door, (dx, dy) in self.doors.items():
            x, y = self._at(door)
            sides = [regions.at(x + s * beyond * dx, y + s * beyond * dy) for s in (-1, 1)]
            if sides[0] == sides[1] or min(map(regions.area, sides)) < _MIN_ROOM_AREA:
                false.append(door)
        for door in false:
            del self.doors[door]
        if false:
            self.drop_false_doors()

    def shorten(self) -> None:
        """Keep the points that matter, and straight lines between them that cross no door."""
        half = 0.5 * DOOR_WIDTH
        closed = {}
        for point, (dx, dy) in self.doors.items():
            x, y = self._at(point)
            closed[point] = ((x - half * dy, y + half * dx), (x + half * dy, y - half * dx))
        regions = self._regions()
        keys = self._key_points(regions)
        self.graph = spanner(
            self.graph, keys, self.grid, closed, lambda at: regions.is_hall(regions.at(*at))
        )

    def _key_points(self, regions: Regions) -> list[int]:
        """Choose doors and the points beside them, centres of rooms, and others ``SPACING`` apart.

        Of the others in a region, junctions come first, and those in wide ground before those near
        walls. In a hall only those count that none of its points sees past the columns.
        """
        keys = [point for door in self.doors for point in (door, *self.graph[door])]
        self.centres = set(self._centres(regions).values())
        keys = list(dict.fromkeys([*keys, *sorted(self.centres)]))
        others = [point for point in self.graph if point not in set(keys)]
        clearance = {point: self.grid.at(*self._at(point)) for point in others}
        others.sort(key=lambda p: (self.graph.degree(p) < 3, -round(clearance[p], 1), p))
        for point in others:
            at = self._at(point)
            mine = regions.at(*at)
            same = [self._at(key) for key in keys if regions.at(*self._at(key)) == mine]
            spacing = max(SPACING, _WIDE_SPACING * clearance[point])
            if regions.is_hall(mine):
                covered = any(self.open.along(at, other) >= self.need for other in same)
            else:
                covered = any(math.dist(at, other) < spacing for other in same)
            if not covered:
                keys.append(point)
        return keys

    def _regions(self) -> Regions:
        doors = ((self._at(point), through) for point, through in self.doors.items())
        return Regions(self.open, doors)

    def finish(self, name: str, rooms: Mapping[str, Bounds]) -> TopoMap:
        """Make the map of all points, named after ``rooms``."""
        regions = self._regions()
        names = PlaceNames(rooms, regions)
        places: dict[int, Place] = {}
        # the centres of rooms first: they get the names without numbers
        for point in sorted(self.graph, key=lambda point: (point not in self.centres, point)):
            at = self._at(point)
            kind = self._kind(point, regions, point in self.centres)
            if point in self.doors:
                label = names.door(at, self.doors[point])
            else:
                label = (names.centre if point in self.centres else names.place)(at, kind)
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

    def _centres(self, regions: Regions) -> dict[int, int]:
        """Choose the point that represents each region, in its widest ground; none in corridors."""
        points: dict[int, list[int]] = {}
        for point in self.graph:
            region = regions.at(*self._at(point))
            if point not in self.doors and region and not regions.is_corridor(region):
                points.setdefault(region, []).append(point)
        return {
            region: self._hall_centre(members)
            if regions.is_hall(region)
            else max(members, key=lambda point: self.grid.at(*self._at(point)))
            for region, members in points.items()
        }

    def _hall_centre(self, members: list[int]) -> int:
        """Choose the point in the wide part of a hall with free lines to most of its doors."""
        beside = {point for door in self.doors for point in self.graph[door]}.intersection(members)
        wide = {point: self.open.at(*self._at(point)) for point in members}

        def rank(point: int) -> tuple[int, float]:
            lines = (self.grid.along(self._at(point), self._at(other)) for other in beside)
            return sum(line >= _ENOUGH_CLEARANCE for line in lines), self.grid.at(*self._at(point))

        least = 0.5 * max(wide.values())
        return max((point for point in members if wide[point] >= least), key=rank)

    def _kind(self, point: int, regions: Regions, centre: bool) -> PlaceKind:
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


def _beyond_door(line: Array, index: int, step: int) -> int:
    """Return the index of the first point of ``line`` at least ``BEFORE_DOOR`` from ``index``."""
    beyond = index
    while 0 < beyond < len(line) - 1 and math.dist(line[beyond], line[index]) < BEFORE_DOOR:
        beyond += step
    return beyond
