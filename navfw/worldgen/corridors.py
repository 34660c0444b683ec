"""The family ``corridors``: corridors with bends, branches, side doors and a few obstacles.

The world is built from a network of corridors.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import ClassVar

import networkx as nx
import numpy as np

from navfw.interfaces import WorldFamily
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.worldspec import DoorSpec, OpeningSpec, RoomSpec
from navfw.topomap import PlaceKind
from navfw.worldgen.region_layout import FloorArea, Roadmap, WallLine, boundary_lines, walls_along
from navfw.worldgen.world_draft import ROBOT, WALL, Point, Unsuitable, WorldDraft, blend, by_axis

Node = tuple[int, int]

_NODES = 4
"""Number of nodes along each side of the lattice."""
_EDGE = 0.4
"""Width of the floor outside of the outermost walls [m]."""
_SIDE_ROOM = (1.8, 1.7)
"""Depth and width [m] of a side room."""


@dataclass(frozen=True)
class CorridorSegment:
    """A straight corridor between two nodes; ``width`` [m] is between wall centre lines."""

    a: Node
    b: Node
    width: float

    @property
    def axis(self) -> int:
        """Direction of the corridor: along x (0) or y (1)."""
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
        """The point at distance ``off`` [m] outward from the door (negative: into the corridor)."""
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


class Corridors(WorldFamily):
    """Bent and branching corridors 1.0 to 2.0 m wide with side doors and obstacles."""

    name: ClassVar[str] = "corridors"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw corridors 1.0 to 2.0 m wide; narrower, longer, with more obstacles when hard."""
        network = _routes_and_branches(rng, difficulty)
        _add_side_doors(rng, network, difficulty)
        network, size = _shifted(network)
        draft = WorldDraft.empty(rng, *size)
        draft.description = "Bent and branching corridors 1.0 to 2.0 m wide with side doors."
        lines = boundary_lines(network.areas)
        _build_walls(draft, network, lines)
        start, goal = network.where[network.route[0]], network.where[network.route[-1]]
        draft.set_start_and_goal(start, goal, towards=network.where[network.route[1]])
        _add_obstacles(draft, network, difficulty)
        _add_map(draft, network)
        return draft


# --- the network ------------------------------------------------------------------------------


def _routes_and_branches(rng: np.random.Generator, difficulty: float) -> CorridorNetwork:
    """Return a route with bends, and branches off it."""
    xs, ys = (np.cumsum(rng.uniform(3.0, 4.6, _NODES)) for _ in range(2))
    lattice = nx.grid_2d_graph(_NODES, _NODES)
    where = {(i, j): (round(float(xs[i]), 3), round(float(ys[j]), 3)) for i, j in lattice}
    route = _bent_walk(rng, lattice, round(blend(4, 8, difficulty)))
    graph = nx.Graph(pairwise(route))
    for node in route[:-1]:
        for other in sorted(lattice[node]):
            if other not in graph and rng.random() < 0.35:
                graph.add_edge(node, other)
    low, high = blend(1.5, 1.1, difficulty), blend(2.1, 1.7, difficulty)
    # half a width is a whole number of millimetres
    segments = [
        CorridorSegment(a, b, round(2 * round(float(rng.uniform(low, high)) / 2, 3), 3))
        for a, b in sorted(map(sorted, graph.edges))
    ]
    # collinear corridors have the same width: a step would leave a thin piece of wall
    widths: dict[tuple[int, int], float] = {}
    segments = [
        replace(s, width=widths.setdefault((s.axis, s.a[1 - s.axis]), s.width)) for s in segments
    ]
    network = CorridorNetwork(graph, route, {n: where[n] for n in graph}, segments)
    network.areas = [_area(network, segment) for segment in segments]
    return network


def _bent_walk(rng: np.random.Generator, lattice: nx.Graph, steps: int) -> list[Node]:
    """Return a walk of ``steps`` edges that visits no node twice and has at least two bends."""
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


def _area(network: CorridorNetwork, segment: CorridorSegment) -> FloorArea:
    """Return the floor of a corridor, up to the far walls of the corridors that it meets."""
    half, axis = 0.5 * segment.width, segment.axis
    first, last = network.where[segment.a], network.where[segment.b]
    begin, end = (_reach(network, segment, node) for node in (segment.a, segment.b))
    along = round(first[axis] - begin, 3), round(last[axis] + end, 3)
    across = round(first[1 - axis] - half, 3), round(first[1 - axis] + half, 3)
    return FloorArea(*by_axis(axis, along, across))


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
            axis, first = segment.axis, network.where[segment.a]
            begin, end = first[axis], network.where[segment.b][axis]
            low = begin + _reach(network, segment, segment.a) + 0.5 * _SIDE_ROOM[1]
            high = end - _reach(network, segment, segment.b) - 0.5 * _SIDE_ROOM[1]
            if low > high:
                continue
            along, off = float(rng.uniform(low, high)), side * 0.5 * segment.width
            at = by_axis(axis, round(along, 3), round(first[1 - axis] + off, 3))
            number = len(network.doors) + 1
            width = round(float(rng.uniform(blend(0.9, 0.8, difficulty), 1.0)), 2)
            door = SideDoor(
                f"door-{number}",
                at,
                by_axis(axis, 0.0, side),
                width,
                bool(rng.random() < 0.6),
                segment,
            )
            room = _room_behind(door, number + 1)
            # overlapping areas, or such as have less than two walls between them
            apart = [
                max(room.x[0] - b.x[1], b.x[0] - room.x[1], room.y[0] - b.y[1], b.y[0] - room.y[1])
                for b in network.areas
            ]
            if door.is_open and any(a < -1e-9 or 1e-9 < a < 2 * WALL for a in apart):
                continue
            network.doors.append(door)
            if door.is_open:
                network.areas.append(room)


def _room_behind(door: SideDoor, region: int) -> FloorArea:
    depth, width = _SIDE_ROOM
    axis = 0 if door.out[0] else 1
    near, along = door.at[axis], door.at[1 - axis]
    low, high = sorted((near, near + depth * door.out[axis]))
    outward = round(low, 3), round(high, 3)
    across = round(along - width / 2, 3), round(along + width / 2, 3)
    return FloorArea(*by_axis(axis, outward, across), region)


def _shifted(network: CorridorNetwork) -> tuple[CorridorNetwork, tuple[float, float]]:
    """Return the same network with the world's corner at the origin, and the world's size [m]."""
    x0 = min(area.x[0] for area in network.areas) - _EDGE
    y0 = min(area.y[0] for area in network.areas) - _EDGE

    def move(point: Point) -> Point:
        return round(point[0] - x0, 3), round(point[1] - y0, 3)

    def moved(area: FloorArea) -> FloorArea:
        (left, low), (right, high) = (move((area.x[i], area.y[i])) for i in (0, 1))
        return FloorArea((left, right), (low, high), area.region)

    areas = [moved(area) for area in network.areas]
    doors = [replace(door, at=move(door.at)) for door in network.doors]
    where = {node: move(point) for node, point in network.where.items()}
    size = max(area.x[1] for area in areas) + _EDGE, max(area.y[1] for area in areas) + _EDGE
    return replace(network, where=where, areas=areas, doors=doors), size


# --- the world --------------------------------------------------------------------------------


def _build_walls(draft: WorldDraft, network: CorridorNetwork, lines: list[WallLine]) -> None:
    palette = draft.palette
    draft.ceiling = palette.draw("ceiling")
    walls, floors = palette.draw_many("wall", 4), palette.draw_many("floor", 2)
    gaps = [OpeningSpec(name=door.name, at=door.at, width=door.width) for door in network.doors]
    for gap in gaps:
        if not any(line.contains(gap.at, 0.5 * gap.width + 0.1) for line in lines):
            raise Unsuitable("a door without a wall")
    draft.walls += walls_along(lines, gaps, palette, walls)
    leaf = palette.draw("thing")
    draft.doors += [
        DoorSpec(name=f"{door.name}-leaf", opening=door.name, texture=leaf)
        for door in network.doors
        if not door.is_open
    ]
    draft.rooms += [
        RoomSpec(
            name=f"side-room-{area.region - 1}", x=area.x, y=area.y, floor=palette.pick(floors)
        )
        for area in network.areas
        if area.region > 1
    ]


def _add_obstacles(draft: WorldDraft, network: CorridorNetwork, difficulty: float) -> None:
    """Obstacles along the walls of wide corridors, with a passable gap beside them."""
    rng = draft.rng
    gap = blend(0.95, 0.78, difficulty)
    textures = draft.palette.draw_many("thing", 3)
    draft.keep_free(*draft.start[:2], 0.7)
    draft.keep_free(*draft.goal, 0.7)
    for door in network.doors:
        draft.keep_free(*door.at, 0.9)
    for segment in network.segments:
        free = segment.width - WALL
        for _ in range(2):
            if rng.random() > blend(0.35, 0.75, difficulty) or free - gap < 0.25:
                continue
            _try_obstacle(draft, network, segment, free - gap, draft.palette.pick(textures))


def _try_obstacle(
    draft: WorldDraft,
    network: CorridorNetwork,
    segment: CorridorSegment,
    deepest: float,
    texture: str,
) -> None:
    rng = draft.rng
    begin, end = network.where[segment.a], network.where[segment.b]
    reach = 0.5 * segment.width + 0.3
    depth = float(rng.uniform(0.22, min(deepest, 0.6)))
    length = float(rng.uniform(0.3, 0.9))
    low = begin[segment.axis] + reach + 0.5 * length
    high = end[segment.axis] - reach - 0.5 * length
    if low > high:
        return
    along = float(rng.uniform(low, high))
    side = 1.0 if rng.random() < 0.5 else -1.0
    off = begin[1 - segment.axis] + side * (0.5 * (segment.width - WALL - depth) - 0.01)
    at = by_axis(segment.axis, along, off)
    number = len(draft.shapes) + 1
    shape: Shape
    if rng.random() < 0.35:
        kind, tallest = "cylinder", 1.6
        shape = Circle(*at, 0.5 * depth)
    else:
        kind, tallest = "box", 1.8
        shape = Rectangle(*at, *by_axis(segment.axis, 0.5 * length, 0.5 * depth))
    if draft.fits(shape, 1.1):
        draft.add(f"{kind}-{number}", shape, rng.uniform(0.5, tallest), texture)


# --- the map ----------------------------------------------------------------------------------


def _add_map(draft: WorldDraft, network: CorridorNetwork) -> None:
    """Places at nodes and in front of side doors, connected in a row along each corridor."""
    roadmap = Roadmap(draft.geometry())
    names = {node: _add_node(roadmap, network, node) for node in sorted(network.graph)}
    for segment in network.segments:
        stations = [(network.where[n][segment.axis], names[n]) for n in (segment.a, segment.b)]
        for door in network.doors:
            if door.segment == segment and door.is_open:
                stations.append((door.at[segment.axis], _add_door(roadmap, door)))
        stations.sort()
        joined = _drop_close(roadmap, [name for _, name in stations])
        for a, b in pairwise(joined):
            if not roadmap.connect(a, b, "pass", width=segment.width - WALL):
                raise Unsuitable("a blocked corridor")
    draft.goal_place = "goal"
    draft.topo_map = roadmap.build("generated-corridors")


def _add_node(roadmap: Roadmap, network: CorridorNetwork, node: Node) -> str:
    beyond = sorted(network.graph[node])
    bent = len(beyond) == 2 and all(beyond[0][i] != beyond[1][i] for i in (0, 1))
    kind: PlaceKind = "junction" if len(beyond) > 2 else "corner" if bent else "corridor"
    if node == network.route[-1]:
        name = "goal"
    else:
        name = "start" if node == network.route[0] else roadmap.numbered(kind)
    return roadmap.add(name, *network.where[node], kind)


def _add_door(roadmap: Roadmap, door: SideDoor) -> str:
    """Add the door, the room behind it and the place in front of it; returns the last one."""
    before = roadmap.add(
        f"{door.name}-corridor", *door.beside(-0.5 * door.segment.width), "junction"
    )
    middle = roadmap.add(door.name, *door.at, "door")
    behind = roadmap.add(f"{door.name}-room", *door.beside(0.5 * _SIDE_ROOM[0]), "room")
    if not (
        roadmap.add_passage(before, middle, door.width)
        and roadmap.add_passage(middle, behind, door.width)
    ):
        raise Unsuitable("a blocked side door")
    return before


def _drop_close(roadmap: Roadmap, names: list[str]) -> list[str]:
    """Drop places close to the one before; a passage connects them to it."""
    kept = [names[0]]
    for name in names[1:]:
        at, last = roadmap.places[name], roadmap.places[kept[-1]]
        if at.distance(last.x, last.y) < 2.2 * ROBOT.radius:
            roadmap.add_passage(kept[-1], name)
            continue
        kept.append(name)
    return kept
