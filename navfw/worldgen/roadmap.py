"""Topological map of a known geometry: places, and passages that are free.

A passage is straight and has clearance for the robot. Where a solid is between two places, the
corners of the shortest path around it become places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, pairwise

import networkx as nx
import numpy as np

from navfw.errors import WorldError
from navfw.numerics import Array
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.worldspec import RoomSpec
from navfw.topomap import Passage, Place, PlaceKind, TopoMap
from navfw.worldgen.world_draft import Point, Unsuitable

_CLEARANCES = (0.45, 0.38, 0.32, 0.27)
"""Clearances [m] tried in turn, down to the least one that lets the robot pass."""

_MERGE_DISTANCE = 0.35
"""A corner closer to an existing place than this [m] is replaced by it."""
_DETOUR = 1.25
"""Ratio of path length to distance above which two places of a room get a direct passage."""


class Roadmap:
    """Builder of the map of a scene: collects places and passages."""

    def __init__(self, plan: SceneGeometry) -> None:
        self.plan = plan
        self.places: dict[str, Place] = {}
        self.passages: dict[frozenset[str], Passage] = {}
        self._counts: dict[str, int] = {}

    def add(self, name: str, x: float, y: float, kind: PlaceKind = "room") -> str:
        """Add a place at a point [m]; returns its name."""
        self.places[name] = Place(name, round(float(x), 3), round(float(y), 3), kind)
        return name

    def numbered(self, stem: str) -> str:
        """The next unused name ``stem-1``, ``stem-2`` and so on."""
        self._counts[stem] = self._counts.get(stem, 0) + 1
        return f"{stem}-{self._counts[stem]}"

    def clearance_between(self, a: Place, b: Place) -> float:
        """Clearance of the straight line between two places [m]."""
        count = max(int(a.distance(b.x, b.y) / 0.04), 2)
        line = np.linspace((a.x, a.y), (b.x, b.y), count)
        return float(self.plan.clearances(line).min())

    def add_passage(self, a: str, b: str, width: float = math.inf) -> bool:
        """Add a straight passage, at most ``width`` [m] wide, if it is free; returns whether."""
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

        Returns False when no path stays inside of the ``room``, if one is given.
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
        """The path with as few corners as the clearance allows."""
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
        """Connect all places of one room: directly where the line is free, else around solids.

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

    def central_point(self, low: Point, high: Point, away: float = 0.8) -> Point:
        """A central point of a rectangle with a clearance of ``away`` [m], or as large as possible.

        Raises:
            Unsuitable: no point is free for a robot.

        """
        (x0, y0), (x1, y1) = low, high
        xs, ys = np.arange(x0 + 0.3, x1 - 0.29, 0.2), np.arange(y0 + 0.3, y1 - 0.29, 0.2)
        points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        free = self.plan.clearances(points)
        off = np.linalg.norm(points - (0.5 * (x0 + x1), 0.5 * (y0 + y1)), axis=1)
        best = int(np.argmax(np.minimum(free, away) - 0.1 * off))
        if free[best] < _CLEARANCES[-1]:
            raise Unsuitable("a room without a free point")
        return float(points[best, 0]), float(points[best, 1])

    def build(self, name: str) -> TopoMap:
        """The map.

        Raises:
            Unsuitable: it is not connected.

        """
        topo_map = TopoMap(name, self.places.values(), self.passages.values())
        if len(topo_map.parts) > 1:
            raise Unsuitable("the map is not connected")
        return topo_map
