"""The family ``corridors``: bent and branching corridors with side doors and a few obstacles."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import networkx as nx
import numpy as np

from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.worldspec import DoorSpec, RoomSpec
from navfw.topomap import PlaceKind
from navfw.worldgen.partition import Area, Gap, Line, boundary_lines, walls_along
from navfw.worldgen.roadmap import Roadmap
from navfw.worldgen.world_draft import ROBOT, WALL, Point, Unsuitable, WorldDraft, blend

__all__ = ["build"]

Node = tuple[int, int]

_EDGE = 0.4
"""Floor [m] around the outermost walls."""
_SIDE = (1.8, 1.7)
"""Depth and width [m] of a side room."""
_APPROACH = 0.65


@dataclass(frozen=True)
class CorridorSegment:
    """A straight corridor between two nodes, ``width`` [m] between wall middles."""

    a: Node
    b: Node
    width: float

    @property
    def axis(self) -> int:
        """Along x (0) or y (1)."""
        return 0 if self.a[1] == self.b[1] else 1


@dataclass(frozen=True)
class SideDoor:
    """A door in a corridor's wall: middle [m], outward direction, width [m], open or closed."""

    name: str
    at: Point
    out: Point
    width: float
    is_open: bool
    run: CorridorSegment

    def beside(self, off: float) -> Point:
        """The point ``off`` [m] out of the corridor (negative: into it), square to the wall."""
        return self.at[0] + off * self.out[0], self.at[1] + off * self.out[1]


@dataclass
class Network:
    """Corridors on a lattice of uneven spacing: where its nodes are [m], and what joins them."""

    graph: nx.Graph
    way: list[Node]
    where: dict[Node, Point]
    runs: list[CorridorSegment]
    areas: list[Area] = field(default_factory=list)
    doors: list[SideDoor] = field(default_factory=list)


def build(rng: np.random.Generator, difficulty: float) -> WorldDraft:
    """Corridors 1.0 to 2.0 m wide; narrower, with more bends and obstacles, when difficult."""
    network = _plan_network(rng, difficulty)
    _add_side_doors(rng, network, difficulty)
    network, size = _shifted(network)
    draft = WorldDraft.begin(rng, *size)
    draft.description = "Bent and branching corridors 1.0 to 2.0 m wide with side doors."
    lines = boundary_lines(network.areas)
    _build_walls(draft, network, lines)
    start, goal = network.where[network.way[0]], network.where[network.way[-1]]
    draft.set_ends(start, goal, towards=network.where[network.way[1]])
    _add_obstacles(draft, network, difficulty)
    _chart(draft, network)
    return draft


# --- the network ------------------------------------------------------------------------------


def _plan_network(rng: np.random.Generator, difficulty: float) -> Network:
    """A way with bends from node to node, and branches off it."""
    across, down = 4, 4
    spacing = [np.cumsum(rng.uniform(3.0, 4.6, n)) for n in (across, down)]
    where = {
        (i, j): (round(float(spacing[0][i]), 3), round(float(spacing[1][j]), 3))
        for i in range(across)
        for j in range(down)
    }
    lattice = nx.grid_2d_graph(across, down)
    way = _bent_walk(rng, lattice, round(blend(4, 8, difficulty)))
    graph = nx.Graph(pairwise(way))
    for node in way[:-1]:
        for other in sorted(lattice[node]):
            if other not in graph and rng.random() < 0.35:
                graph.add_edge(node, other)
    low, high = blend(1.5, 1.1, difficulty), blend(2.1, 1.7, difficulty)
    runs = [
        CorridorSegment(a, b, _width(rng, low, high)) for a, b in sorted(map(sorted, graph.edges))
    ]
    runs = _same_width_straight_on(runs)
    network = Network(graph, way, {n: where[n] for n in graph}, runs)
    network.areas = [_area(network, run) for run in runs]
    return network


def _width(rng: np.random.Generator, low: float, high: float) -> float:
    """Between wall middles: the free width is a wall's thickness less."""
    return round(2 * round(float(rng.uniform(low, high)) / 2, 3), 3)


def _bent_walk(rng: np.random.Generator, lattice: nx.Graph, steps: int) -> list[Node]:
    """A walk that meets itself nowhere, not even beside itself, and bends at least once."""
    nodes = sorted(lattice.nodes)
    for _ in range(200):
        way = [nodes[int(rng.integers(len(nodes)))]]
        while len(way) <= steps:
            onward = [n for n in sorted(lattice[way[-1]]) if n not in way]
            if not onward:
                break
            way.append(onward[int(rng.integers(len(onward)))])
        bends = sum(a[0] != c[0] and a[1] != c[1] for a, c in zip(way[:-2], way[2:], strict=True))
        if len(way) == steps + 1 and bends >= 2:
            return way
    raise Unsuitable("no bent way")


def _same_width_straight_on(runs: list[CorridorSegment]) -> list[CorridorSegment]:
    """Corridors in one line have one width: a step in a wall would leave a sliver of wall."""
    widths: dict[tuple[int, int], float] = {}
    result = []
    for run in runs:
        line = (run.axis, run.a[1 - run.axis])
        result.append(CorridorSegment(run.a, run.b, widths.setdefault(line, run.width)))
    return result


def _area(network: Network, run: CorridorSegment) -> Area:
    """The floor of a corridor, as far as the far walls of those it meets."""
    half = 0.5 * run.width
    (ax, ay), (bx, by) = network.where[run.a], network.where[run.b]
    begin, end = (_reach(network, run, node) for node in (run.a, run.b))
    if run.axis == 0:
        x, y = (ax - begin, bx + end), (ay - half, ay + half)
    else:
        x, y = (ax - half, ax + half), (ay - begin, by + end)
    return Area((round(x[0], 3), round(x[1], 3)), (round(y[0], 3), round(y[1], 3)))


def _reach(network: Network, run: CorridorSegment, node: Node) -> float:
    """How far the corridor goes on beyond a node's middle: half the width of what it meets."""
    others = [r.width for r in network.runs if node in (r.a, r.b) and r.axis != run.axis]
    return 0.5 * max(others, default=run.width)


# --- side doors -------------------------------------------------------------------------------


def _add_side_doors(rng: np.random.Generator, network: Network, difficulty: float) -> None:
    """Doors in the corridors' walls: closed ones, and open ones with a small room behind."""
    for run in network.runs:
        for side in (-1.0, 1.0):
            if rng.random() > 0.6:
                continue
            (ax, ay), (bx, by) = network.where[run.a], network.where[run.b]
            begin, end = (ax, bx) if run.axis == 0 else (ay, by)
            low = begin + _reach(network, run, run.a) + 0.5 * _SIDE[1]
            high = end - _reach(network, run, run.b) - 0.5 * _SIDE[1]
            if low > high:
                continue
            along, off = float(rng.uniform(low, high)), side * 0.5 * run.width
            at, out = (
                ((along, ay + off), (0.0, side))
                if run.axis == 0
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
                run,
            )
            room = _room_behind(door, number + 1)
            if door.is_open and any(_touch(room, area) for area in network.areas):
                continue
            network.doors.append(door)
            if door.is_open:
                network.areas.append(room)


def _room_behind(door: SideDoor, region: int) -> Area:
    depth, width = _SIDE
    near, far = sorted((0.0, depth))
    x, y = door.at
    if door.out[0] == 0.0:
        low, high = sorted((y + near * door.out[1], y + far * door.out[1]))
        return Area(
            (round(x - width / 2, 3), round(x + width / 2, 3)),
            (round(low, 3), round(high, 3)),
            region,
        )
    low, high = sorted((x + near * door.out[0], x + far * door.out[0]))
    return Area(
        (round(low, 3), round(high, 3)), (round(y - width / 2, 3), round(y + width / 2, 3)), region
    )


def _touch(a: Area, b: Area) -> bool:
    """Whether two areas overlap, or leave less than a wall between them without sharing one."""
    apart = max(a.x[0] - b.x[1], b.x[0] - a.x[1], a.y[0] - b.y[1], b.y[0] - a.y[1])
    overlaps = apart < -1e-9
    return overlaps or 1e-9 < apart < 2 * WALL


def _shifted(network: Network) -> tuple[Network, tuple[float, float]]:
    """The same network with the world's corner at the origin, and the world's size [m]."""
    x0 = min(area.x[0] for area in network.areas) - _EDGE
    y0 = min(area.y[0] for area in network.areas) - _EDGE

    def move(point: Point) -> Point:
        return round(point[0] - x0, 3), round(point[1] - y0, 3)

    def moved(area: Area) -> Area:
        (left, low), (right, high) = (move((area.x[i], area.y[i])) for i in (0, 1))
        return Area((left, right), (low, high), area.region)

    areas = [moved(area) for area in network.areas]
    doors = [SideDoor(d.name, move(d.at), d.out, d.width, d.is_open, d.run) for d in network.doors]
    where = {node: move(point) for node, point in network.where.items()}
    size = max(area.x[1] for area in areas) + _EDGE, max(area.y[1] for area in areas) + _EDGE
    return Network(network.graph, network.way, where, network.runs, areas, doors), size


# --- the world --------------------------------------------------------------------------------


def _build_walls(draft: WorldDraft, network: Network, lines: list[Line]) -> None:
    palette = draft.palette
    draft.ceiling = palette.draw("ceiling")
    walls, floors = palette.draw_many("wall", 4), palette.draw_many("floor", 2)
    gaps = [Gap(door.name, door.at, door.width) for door in network.doors]
    for gap in gaps:
        if not any(line.holds(gap.at, 0.5 * gap.width + 0.1) for line in lines):
            raise Unsuitable("a door without a wall")
    draft.walls += [
        wall.model_copy(update={"texture": palette.pick(walls)})
        for wall in walls_along(lines, gaps, walls[0])
    ]
    leaf = palette.draw("thing")
    draft.doors += [
        DoorSpec(name=f"{door.name}-leaf", opening=door.name, texture=leaf)
        for door in network.doors
        if not door.is_open
    ]
    for area in network.areas:
        if area.region > 1:
            draft.rooms.append(
                RoomSpec(
                    name=f"side-room-{area.region - 1}",
                    x=area.x,
                    y=area.y,
                    floor=palette.pick(floors),
                )
            )


def _add_obstacles(draft: WorldDraft, network: Network, difficulty: float) -> None:
    """Things along the walls of wide corridors; what is left is wide enough to pass."""
    rng = draft.rng
    gap = blend(0.95, 0.78, difficulty)
    textures = draft.palette.draw_many("thing", 3)
    draft.keep_free(*draft.start[:2], 0.7)
    draft.keep_free(*draft.goal, 0.7)
    for door in network.doors:
        draft.keep_free(*door.at, 0.9)
    for run in network.runs:
        free = run.width - WALL
        for _ in range(2):
            if rng.random() > blend(0.35, 0.75, difficulty) or free - gap < 0.25:
                continue
            _try_obstacle(draft, network, run, free - gap, draft.palette.pick(textures))


def _try_obstacle(
    draft: WorldDraft, network: Network, run: CorridorSegment, deepest: float, texture: str
) -> None:
    rng = draft.rng
    begin, end = network.where[run.a], network.where[run.b]
    reach = 0.5 * run.width + 0.3
    depth = float(rng.uniform(0.22, min(deepest, 0.6)))
    length = float(rng.uniform(0.3, 0.9))
    low = begin[run.axis] + reach + 0.5 * length
    high = end[run.axis] - reach - 0.5 * length
    if low > high:
        return
    along = float(rng.uniform(low, high))
    side = 1.0 if rng.random() < 0.5 else -1.0
    off = begin[1 - run.axis] + side * (0.5 * (run.width - WALL - depth) - 0.01)
    at = (along, off) if run.axis == 0 else (off, along)
    number = len(draft.shapes) + 1
    if rng.random() < 0.35:
        circle = Circle(*at, 0.5 * depth)
        if draft.has_room(circle, 1.1):
            draft.add_cylinder(f"cylinder-{number}", circle, rng.uniform(0.5, 1.6), texture)
        return
    half = (0.5 * length, 0.5 * depth) if run.axis == 0 else (0.5 * depth, 0.5 * length)
    box = Rectangle(*at, *half)
    if draft.has_room(box, 1.1):
        draft.add_box(f"box-{number}", box, rng.uniform(0.5, 1.8), texture)


# --- the map ----------------------------------------------------------------------------------


def _chart(draft: WorldDraft, network: Network) -> None:
    """Places at nodes and before side doors; along each corridor they are joined in a row."""
    road = Roadmap(draft.plan())
    names = {node: _add_node(road, network, node) for node in sorted(network.graph)}
    for run in network.runs:
        stations = [(network.where[n][run.axis], names[n]) for n in (run.a, run.b)]
        for door in network.doors:
            if door.run == run and door.is_open:
                stations.append((door.at[run.axis], _add_door(road, network, door)))
        stations.sort()
        joined = _merge_near(road, [name for _, name in stations])
        for a, b in pairwise(joined):
            if not road.lead(a, b, "pass", _anywhere, run.width - WALL):
                raise Unsuitable("a corridor that is blocked")
    draft.goal_place = "goal"
    draft.topo_map = road.finish("generated-corridors")


def _anywhere(x: float, y: float) -> bool:
    """Corridors have no edges to leave by."""
    del x, y
    return True


def _add_node(road: Roadmap, network: Network, node: Node) -> str:
    beyond = sorted(network.graph[node])
    bent = len(beyond) == 2 and all(beyond[0][i] != beyond[1][i] for i in (0, 1))
    kind: PlaceKind = "junction" if len(beyond) > 2 else "corner" if bent else "corridor"
    if node == network.way[-1]:
        name = "goal"
    else:
        name = "start" if node == network.way[0] else road.number(kind)
    return road.add(name, *network.where[node], kind)


def _add_door(road: Roadmap, network: Network, door: SideDoor) -> str:
    """The door, the room behind it, and the place before it, which is returned."""
    before = road.add(f"{door.name}-corridor", *door.beside(-0.5 * door.run.width), "junction")
    middle = road.add(door.name, *door.at, "door")
    behind = road.add(f"{door.name}-room", *door.beside(max(_APPROACH, 0.5 * _SIDE[0])), "room")
    if not (road.link(before, middle, door.width) and road.link(middle, behind, door.width)):
        raise Unsuitable("a side door that is blocked")
    return before


def _merge_near(road: Roadmap, names: list[str]) -> list[str]:
    """Two doors across from each other have one place before them."""
    kept = [names[0]]
    for name in names[1:]:
        at, last = road.places[name], road.places[kept[-1]]
        if at.distance(last.x, last.y) < 2.2 * ROBOT.radius:
            road.link(kept[-1], name)
            continue
        kept.append(name)
    return kept
