"""Network of corridors with side doors, as a plan from which the world is built."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import networkx as nx
import numpy as np

from navfw.worldgen.partition import FloorArea
from navfw.worldgen.world_draft import WALL, Point, Unsuitable, blend

Node = tuple[int, int]

_EDGE = 0.4
"""Width of the floor around the outermost walls [m]."""
SIDE_ROOM = (1.8, 1.7)
"""Depth and width [m] of a side room."""


@dataclass(frozen=True)
class CorridorSegment:
    """A straight corridor between two nodes; ``width`` [m] is that between wall centre lines."""

    a: Node
    b: Node
    width: float

    @property
    def axis(self) -> int:
        """Direction: along x (0) or y (1)."""
        return 0 if self.a[1] == self.b[1] else 1


@dataclass(frozen=True)
class SideDoor:
    """A door in a corridor's wall: centre [m], outward direction, width [m], open or closed."""

    name: str
    at: Point
    out: Point
    width: float
    is_open: bool
    segment: CorridorSegment

    def beside(self, off: float) -> Point:
        """The point ``off`` [m] outward from the wall (negative: into the corridor)."""
        return self.at[0] + off * self.out[0], self.at[1] + off * self.out[1]


@dataclass
class CorridorNetwork:
    """Corridors on a lattice of uneven spacing.

    ``graph`` joins lattice nodes, ``route`` leads from start to goal, ``where`` has the nodes'
    positions [m].
    """

    graph: nx.Graph
    route: list[Node]
    where: dict[Node, Point]
    segments: list[CorridorSegment]
    areas: list[FloorArea] = field(default_factory=list)
    doors: list[SideDoor] = field(default_factory=list)


def plan_network(
    rng: np.random.Generator, difficulty: float
) -> tuple[CorridorNetwork, tuple[float, float]]:
    """A random network with side doors, and the size [m] of the floor around it."""
    network = _routes_and_branches(rng, difficulty)
    _add_side_doors(rng, network, difficulty)
    return _shifted(network)


# --- the network ------------------------------------------------------------------------------


def _routes_and_branches(rng: np.random.Generator, difficulty: float) -> CorridorNetwork:
    """A route with bends, and branches off it."""
    across, down = 4, 4
    spacing = [np.cumsum(rng.uniform(3.0, 4.6, n)) for n in (across, down)]
    where = {
        (i, j): (round(float(spacing[0][i]), 3), round(float(spacing[1][j]), 3))
        for i in range(across)
        for j in range(down)
    }
    lattice = nx.grid_2d_graph(across, down)
    route = _bent_walk(rng, lattice, round(blend(4, 8, difficulty)))
    graph = nx.Graph(pairwise(route))
    for node in route[:-1]:
        for other in sorted(lattice[node]):
            if other not in graph and rng.random() < 0.35:
                graph.add_edge(node, other)
    low, high = blend(1.5, 1.1, difficulty), blend(2.1, 1.7, difficulty)
    segments = [
        CorridorSegment(a, b, _width(rng, low, high)) for a, b in sorted(map(sorted, graph.edges))
    ]
    segments = _equal_collinear_widths(segments)
    network = CorridorNetwork(graph, route, {n: where[n] for n in graph}, segments)
    network.areas = [_area(network, segment) for segment in segments]
    return network


def _width(rng: np.random.Generator, low: float, high: float) -> float:
    """Width between wall centre lines [m]: the free width plus a wall's thickness."""
    return round(2 * round(float(rng.uniform(low, high)) / 2, 3), 3)


def _bent_walk(rng: np.random.Generator, lattice: nx.Graph, steps: int) -> list[Node]:
    """A walk of ``steps`` edges that visits no node twice and has at least two bends."""
    nodes = sorted(lattice.nodes)
    for _ in range(200):
        route = [nodes[int(rng.integers(len(nodes)))]]
        while len(route) <= steps:
            onward = [n for n in sorted(lattice[route[-1]]) if n not in route]
            if not onward:
                break
            route.append(onward[int(rng.integers(len(onward)))])
        bends = sum(
            a[0] != c[0] and a[1] != c[1] for a, c in zip(route[:-2], route[2:], strict=True)
        )
        if len(route) == steps + 1 and bends >= 2:
            return route
    raise Unsuitable("no route with two bends")


def _equal_collinear_widths(segments: list[CorridorSegment]) -> list[CorridorSegment]:
    """Give collinear corridors the same width: a step would leave a thin piece of wall."""
    widths: dict[tuple[int, int], float] = {}
    result = []
    for segment in segments:
        line = (segment.axis, segment.a[1 - segment.axis])
        result.append(CorridorSegment(segment.a, segment.b, widths.setdefault(line, segment.width)))
    return result


def _area(network: CorridorNetwork, segment: CorridorSegment) -> FloorArea:
    """The floor of a corridor, up to the far walls of the corridors that it meets."""
    half = 0.5 * segment.width
    (ax, ay), (bx, by) = network.where[segment.a], network.where[segment.b]
    begin, end = (_reach(network, segment, node) for node in (segment.a, segment.b))
    if segment.axis == 0:
        x, y = (ax - begin, bx + end), (ay - half, ay + half)
    else:
        x, y = (ax - half, ax + half), (ay - begin, by + end)
    return FloorArea((round(x[0], 3), round(x[1], 3)), (round(y[0], 3), round(y[1], 3)))


def _reach(network: CorridorNetwork, segment: CorridorSegment, node: Node) -> float:
    """Extension of the corridor beyond a node [m]: half the width of the corridor that it meets."""
    others = [r.width for r in network.segments if node in (r.a, r.b) and r.axis != segment.axis]
    return 0.5 * max(others, default=segment.width)


# --- side doors -------------------------------------------------------------------------------


def _add_side_doors(rng: np.random.Generator, network: CorridorNetwork, difficulty: float) -> None:
    """Doors in the corridors' walls: closed ones, and open ones with a small room behind."""
    for segment in network.segments:
        for side in (-1.0, 1.0):
            if rng.random() > 0.6:
                continue
            (ax, ay), (bx, by) = network.where[segment.a], network.where[segment.b]
            begin, end = (ax, bx) if segment.axis == 0 else (ay, by)
            low = begin + _reach(network, segment, segment.a) + 0.5 * SIDE_ROOM[1]
            high = end - _reach(network, segment, segment.b) - 0.5 * SIDE_ROOM[1]
            if low > high:
                continue
            along, off = float(rng.uniform(low, high)), side * 0.5 * segment.width
            at, out = (
                ((along, ay + off), (0.0, side))
                if segment.axis == 0
                else ((ax + off, along), (side, 0.0))
            )
            number = len(network.doors) + 1
            width = round(float(rng.uniform(blend(0.9, 0.8, difficulty), 1.0)), 2)
            door = SideDoor(
                f"door-{number}",
                (round(at[0], 3), round(at[1], 3)),
                out,
                width,
                bool(rng.random() < 0.6),
                segment,
            )
            room = _room_behind(door, number + 1)
            if door.is_open and any(_too_close(room, area) for area in network.areas):
                continue
            network.doors.append(door)
            if door.is_open:
                network.areas.append(room)


def _room_behind(door: SideDoor, region: int) -> FloorArea:
    depth, width = SIDE_ROOM
    near, far = sorted((0.0, depth))
    x, y = door.at
    if door.out[0] == 0.0:
        low, high = sorted((y + near * door.out[1], y + far * door.out[1]))
        return FloorArea(
            (round(x - width / 2, 3), round(x + width / 2, 3)),
            (round(low, 3), round(high, 3)),
            region,
        )
    low, high = sorted((x + near * door.out[0], x + far * door.out[0]))
    return FloorArea(
        (round(low, 3), round(high, 3)), (round(y - width / 2, 3), round(y + width / 2, 3)), region
    )


def _too_close(a: FloorArea, b: FloorArea) -> bool:
    """Whether two areas overlap, or are less than two walls apart without sharing an edge."""
    apart = max(a.x[0] - b.x[1], b.x[0] - a.x[1], a.y[0] - b.y[1], b.y[0] - a.y[1])
    overlaps = apart < -1e-9
    return overlaps or 1e-9 < apart < 2 * WALL


def _shifted(network: CorridorNetwork) -> tuple[CorridorNetwork, tuple[float, float]]:
    """The same network with the world's corner at the origin, and the world's size [m]."""
    x0 = min(area.x[0] for area in network.areas) - _EDGE
    y0 = min(area.y[0] for area in network.areas) - _EDGE

    def move(point: Point) -> Point:
        return round(point[0] - x0, 3), round(point[1] - y0, 3)

    def moved(area: FloorArea) -> FloorArea:
        (left, low), (right, high) = (move((area.x[i], area.y[i])) for i in (0, 1))
        return FloorArea((left, right), (low, high), area.region)

    areas = [moved(area) for area in network.areas]
    doors = [
        SideDoor(d.name, move(d.at), d.out, d.width, d.is_open, d.segment) for d in network.doors
    ]
    where = {node: move(point) for node, point in network.where.items()}
    size = max(area.x[1] for area in areas) + _EDGE, max(area.y[1] for area in areas) + _EDGE
    return CorridorNetwork(
        network.graph, network.route, where, network.segments, areas, doors
    ), size
