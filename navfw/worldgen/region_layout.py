"""Walls around regions of rectangles, such as corridors, and the map of a known geometry.

A passage of the map is straight and has clearance for the robot. If a solid is between two places,
the corners of the shortest path around it become places.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import numpy.typing as npt

from navfw.errors import WorldError
from navfw.numerics import Array
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.worldspec import OpeningSpec, RoomSpec, WallSpec
from navfw.topomap import Passage, Place, PlaceKind, TopoMap
from navfw.worldgen.looks import Palette
from navfw.worldgen.world_draft import WALL, Point, Unsuitable, by_axis

_FILL = 0.4 * WALL
"""Extension of a wall's ends into the wall that they meet [m], so that faces are not coplanar."""


@dataclass(frozen=True, slots=True)
class FloorArea:
    """A rectangle of free floor [m]; areas of one region have no wall between them."""

    x: tuple[float, float]
    y: tuple[float, float]
    region: int = 1


@dataclass(frozen=True, slots=True)
class WallLine:
    """A wall's centre line: at ``at`` [m] on ``axis`` (0: x), from ``low`` to ``high`` [m]."""

    axis: int
    at: float
    low: float
    high: float

    def contains(self, point: tuple[float, float], half: float) -> bool:
        """Whether a gap of half width ``half`` [m] around ``point`` is within the line."""
        along = point[1 - self.axis]
        on = abs(point[self.axis] - self.at) < 1e-6
        return on and self.low + half <= along <= self.high - half


def boundary_lines(areas: Sequence[FloorArea]) -> list[WallLine]:
    """Return the wall lines between regions, and between regions and their surroundings."""
    xs = np.unique([edge for area in areas for edge in area.x])
    ys = np.unique([edge for area in areas for edge in area.y])
    region = np.zeros((xs.size + 1, ys.size + 1), dtype=np.int64)  # with a border of region 0
    for area in areas:
        i, j = np.searchsorted(xs, area.x), np.searchsorted(ys, area.y)
        region[i[0] + 1 : i[1] + 1, j[0] + 1 : j[1] + 1] = area.region
    lines = [WallLine(0, *numbers) for numbers in _boundary_intervals(region, xs, ys)]
    lines += [WallLine(1, *numbers) for numbers in _boundary_intervals(region.T, ys, xs)]
    return lines


def _boundary_intervals(
    region: npt.NDArray[np.int64],
    at: npt.NDArray[np.float64],
    along: npt.NDArray[np.float64],
) -> Iterator[tuple[float, float, float]]:
    """(at, low, high) of maximal intervals in which the region changes across ``at``."""
    differ = region[:-1] != region[1:]
    for i, row in enumerate(differ):
        for begin, end in runs(row[1:-1]):
            yield float(at[i]), float(along[begin]), float(along[end])


def runs(row: npt.ArrayLike) -> Iterator[tuple[int, int]]:
    """Yield the first and end index (exclusive) of each run of true values."""
    changes = np.flatnonzero(np.diff(np.asarray(row, dtype=int), prepend=0, append=0))
    yield from zip(changes[::2].tolist(), changes[1::2].tolist(), strict=True)


def walls_along(
    lines: Sequence[WallLine],
    gaps: Sequence[OpeningSpec],
    palette: Palette,
    textures: Sequence[str],
) -> list[WallSpec]:
    """Make a wall on every line, with its gaps; its ends extend into the walls that they meet.

    Each has one of ``textures`` of ``palette``, at random.
    """
    walls = []
    for number, line in enumerate(lines, start=1):
        low, high = round(line.low - _FILL, 3), round(line.high + _FILL, 3)
        points = tuple(by_axis(line.axis, line.at, end) for end in (low, high))
        openings = tuple(gap for gap in gaps if line.contains(gap.at, 0.5 * gap.width))
        walls.append(
            WallSpec(
                name=f"wall-{number}",
                points=points,
                openings=openings,
                texture=palette.pick(textures),
            )
        )
    return walls


_CLEARANCES = (0.45, 0.38, 0.32, 0.27)
"""Clearances [m] tried in turn, down to the smallest one with which the robot can pass."""

_MERGE_DISTANCE = 0.35
"""Distance [m] of a corner from an existing place below which the place is used instead."""
_DETOUR = 1.25
"""Ratio of path length to distance above which two places of a room get a direct passage."""


class Roadmap:
    """Builds the map of a scene from places and passages."""

    def __init__(self, plan: SceneGeometry) -> None:
        self.plan = plan
        self.places: dict[str, Place] = {}
        self.passages: dict[frozenset[str], Passage] = {}
        self._counts: dict[str, int] = {}

    def add(self, name: str, x: float, y: float, kind: PlaceKind = "room") -> str:
        """Add a place at x, y [m]; return its name."""
        self.places[name] = Place(name, round(float(x), 3), round(float(y), 3), kind)
        return name

    def numbered(self, stem: str) -> str:
        """Return the next unused name ``stem-1``, ``stem-2`` and so on."""
        self._counts[stem] = self._counts.get(stem, 0) + 1
        return f"{stem}-{self._counts[stem]}"

    def clearance_between(self, a: Place, b: Place) -> float:
        """Smallest clearance along the straight line between two places [m]."""
        count = max(int(a.distance(b.x, b.y) / 0.04), 2)
        line = np.linspace((a.x, a.y), (b.x, b.y), count)
        return float(self.plan.clearances(line).min())

    def add_passage(self, a: str, b: str, width: float = math.inf) -> bool:
        """Add a straight passage, at most ``width`` [m] wide; return False if it is not free."""
        start, end = self.places[a], self.places[b]
        free = self.clearance_between(start, end)
        if free < _CLEARANCES[-1]:
            return False
        passage = Passage(
            a=a,
            b=b,
            length=round(max(start.distance(end.x, end.y), 0.01), 3),
            width=round(min(2.0 * free, width), 2),
            doorness=float("door" in (start.kind, end.kind)),
        )
        self.passages.setdefault(passage.ends, passage)
        return True

    def connect(
        self, a: str, b: str, stem: str, room: RoomSpec | None = None, width: float = math.inf
    ) -> bool:
        """Connect a and b: directly, or around solids through new places named after ``stem``.

        Returns False if no path is free, or none stays inside of the ``room`` if that is given.
        """
        if self.add_passage(a, b, width):
            return True
        start, end = self.places[a], self.places[b]
        for clearance in _CLEARANCES:
            try:
                path = self.plan.shortest_path((start.x, start.y), (end.x, end.y), clearance)[1]
            except WorldError:
                continue
            if room is not None:
                low, high = np.array([room.x, room.y]).T
                if not ((path > low) & (path < high)).all():
                    continue
            return self._add_path(a, b, self._simplified(path), stem, width)
        return False

    def _simplified(self, path: Array) -> Array:
        """Return the path with as few corners as the clearance allows."""
        kept = [path[0]]
        i = 0
        while i < len(path) - 1:
            ahead = range(len(path) - 1, i, -1)
            i = next(
                (
                    j
                    for j in ahead
                    if self.plan.straight_path_free(path[i], path[j], _CLEARANCES[-1] + 0.005)
                ),
                i + 1,
            )
            kept.append(path[i])
        return np.array(kept)

    def _add_path(self, a: str, b: str, path: Array, stem: str, width: float) -> bool:
        names = [a]
        for x, y in path[1:-1]:
            near = [p for p in self.places.values() if p.distance(x, y) < _MERGE_DISTANCE]
            if near and near[0].name not in (*names, b):
                names.append(near[0].name)
            else:
                names.append(self.add(self.numbered(stem), x, y, "corner"))
        links = [self.add_passage(c, d, width) for c, d in pairwise([*names, b])]
        return all(links)

    def connect_all(self, names: Sequence[str], room: RoomSpec) -> None:
        """Connect all places of one room: directly if the line is free, else around solids.

        Raises:
            Unsuitable: a place cannot be reached inside the room.

        """
        stem = f"{room.name}-corner"
        pairs = sorted(combinations(names, 2), key=lambda pair: self._distance(*pair))
        for a, b in pairs:
            if self.clearance_between(self.places[a], self.places[b]) < _CLEARANCES[0]:
                continue  # narrow passages only where needed, below
            if self._path_length(a, b) > 1.1 * self._distance(a, b):
                self.add_passage(a, b)
        for a, b in pairs:
            if math.isinf(self._path_length(a, b)) and not self.connect(a, b, stem, room):
                raise Unsuitable(f"no path from {a} to {b}")
        for a, b in pairs:
            if self._path_length(a, b) > _DETOUR * self._distance(a, b):
                self.add_passage(a, b)

    def _distance(self, a: str, b: str) -> float:
        end = self.places[b]
        return self.places[a].distance(end.x, end.y)

    def _path_length(self, a: str, b: str) -> float:
        graph = nx.Graph()
        graph.add_nodes_from(self.places)
        graph.add_weighted_edges_from((p.a, p.b, p.length) for p in self.passages.values())
        try:
            return float(nx.dijkstra_path_length(graph, a, b))
        except nx.NetworkXNoPath:
            return math.inf

    def central_point(self, low: Point, high: Point) -> Point:
        """A central point of a rectangle with a clearance of 0.8 m, or the largest possible.

        Raises:
            Unsuitable: no point is free for a robot.

        """
        (x0, y0), (x1, y1) = low, high
        xs, ys = np.arange(x0 + 0.3, x1 - 0.29, 0.2), np.arange(y0 + 0.3, y1 - 0.29, 0.2)
        points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        free = self.plan.clearances(points)
        off = np.linalg.norm(points - (0.5 * (x0 + x1), 0.5 * (y0 + y1)), axis=1)
        best = int(np.argmax(np.minimum(free, 0.8) - 0.1 * off))
        if free[best] < _CLEARANCES[-1]:
            raise Unsuitable("a room without a free point")
        return float(points[best, 0]), float(points[best, 1])

    def build(self, name: str) -> TopoMap:
        """Make the topological map.

        Raises:
            Unsuitable: the map is not connected.

        """
        topo_map = TopoMap(name, self.places.values(), self.passages.values())
        if len(topo_map.parts) > 1:
            raise Unsuitable("the map is not connected")
        return topo_map
