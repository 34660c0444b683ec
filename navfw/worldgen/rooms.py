"""The family ``rooms``: furnished rooms with doors; start and goal are in different rooms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, count
from typing import ClassVar

import networkx as nx
import numpy as np

from navfw.interfaces import WorldFamily
from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.worldspec import OpeningSpec, RoomSpec, WallSpec
from navfw.worldgen.region_layout import Roadmap, WallLine
from navfw.worldgen.world_draft import WALL, Point, Unsuitable, WorldDraft, blend, by_axis, rounded

Interval = tuple[float, float]

_ALONG_WALLS = (
    ("desk", (1.2, 1.6), (0.65, 0.8), (0.72, 0.76)),
    ("shelf", (0.8, 1.5), (0.3, 0.45), (1.4, 2.0)),
    ("cupboard", (0.8, 1.4), (0.45, 0.6), (0.9, 1.9)),
    ("sofa", (1.4, 1.8), (0.7, 0.8), (0.7, 0.85)),
    ("fridge", (0.6, 0.7), (0.6, 0.65), (1.5, 1.8)),
)
"""Boxes along walls: name, intervals of length along the wall, depth and height [m]."""
_FREE_BOXES = (
    ("crate", (0.25, 0.4), (0.25, 0.4), (0.5, 0.9)),
    ("table", (0.5, 0.8), (0.35, 0.5), (0.7, 0.76)),
)
"""Free-standing boxes: name, intervals of half length, half depth and height [m]."""
_FREE_ROUND = (
    ("plant", (0.17, 0.27), (0.8, 1.4)),
    ("column", (0.15, 0.25), (2.4, 2.4)),
    ("stool", (0.18, 0.24), (0.45, 0.6)),
    ("bin", (0.15, 0.22), (0.5, 0.8)),
    ("round-table", (0.35, 0.5), (0.72, 0.76)),
)
"""Free-standing cylinders: name, intervals of radius and height [m]."""
_TO_WALL = 0.02
"""Distance of furniture along a wall from the wall [m]."""


def furnish(
    draft: WorldDraft,
    rooms: Sequence[tuple[str, Interval, Interval]],
    density: float,
    gap: float,
) -> None:
    """Add furniture to rooms (name, x and y between wall faces [m]).

    There are ``density`` pieces per square metre, at least ``gap`` [m] apart. Pieces along a wall
    are almost in contact with it; the others are at least ``gap`` from the walls as well.
    """
    textures = draft.palette.draw_many("thing", 6)
    for name, x, y in rooms:
        wanted = round((x[1] - x[0]) * (y[1] - y[0]) * density)
        placed = 0
        for _ in range(25 * wanted):
            if placed >= wanted:
                break
            if draft.rng.random() < 0.6:
                placed += _along_wall(draft, name, x, y, gap, textures)
            else:
                placed += _standing_free(draft, name, x, y, gap, textures)


def _pick(rng: np.random.Generator, interval: Interval) -> float:
    return float(rng.uniform(*interval))


def _named(draft: WorldDraft, kind: str, room: str) -> str:
    taken = {box.name for box in draft.boxes} | {round_.name for round_ in draft.cylinders}
    names = (f"{room}-{kind}-{number}" for number in count(1))
    return next(name for name in names if name not in taken)


def _along_wall(
    draft: WorldDraft, room: str, x: Interval, y: Interval, gap: float, textures: tuple[str, ...]
) -> bool:
    """Try a box with its back to a wall: in a corner, or at least ``gap`` [m] from it."""
    rng = draft.rng
    kind, lengths, depths, heights = _ALONG_WALLS[int(rng.integers(len(_ALONG_WALLS)))]
    length, depth, height = _pick(rng, lengths), _pick(rng, depths), _pick(rng, heights)
    axis, far = int(rng.integers(2)), bool(rng.integers(2))
    across, along = by_axis(axis, x, y)
    low, high = along[0] + _TO_WALL + 0.5 * length, along[1] - _TO_WALL - 0.5 * length
    if low >= high:
        return False
    at = rng.uniform(low, high)
    if min(at - low, high - at) < gap:  # no passable gap to the corner: move it there
        at = low if at - low < high - at else high
    back = across[1] - _TO_WALL - 0.5 * depth if far else across[0] + _TO_WALL + 0.5 * depth
    box = Rectangle(*by_axis(axis, back, at), *by_axis(axis, 0.5 * depth, 0.5 * length))
    if not (across[1] - across[0] - depth - 2 * _TO_WALL >= gap and draft.fits(box, gap)):
        return False
    draft.add(_named(draft, kind, room), box, height, draft.palette.pick(textures))
    return True


def _standing_free(
    draft: WorldDraft, room: str, x: Interval, y: Interval, gap: float, textures: tuple[str, ...]
) -> bool:
    """Try a box or cylinder in the middle, with a passable gap on all sides."""
    rng = draft.rng
    at = float(rng.uniform(*x)), float(rng.uniform(*y))
    texture = draft.palette.pick(textures)
    shape: Circle | Rectangle
    if rng.random() < 0.6:
        kind, radii, heights = _FREE_ROUND[int(rng.integers(len(_FREE_ROUND)))]
        shape = Circle(*at, _pick(rng, radii))
    else:
        kind, lengths, depths, heights = _FREE_BOXES[int(rng.integers(len(_FREE_BOXES)))]
        yaw = _pick(rng, (0.0, math.pi))
        shape = Rectangle(*at, _pick(rng, lengths), _pick(rng, depths), yaw)
    height = _pick(rng, heights)
    x0, y0, x1, y1 = shape.bounds
    if min(x0 - x[0], x[1] - x1, y0 - y[0], y[1] - y1) < gap or not draft.fits(shape, gap):
        return False
    draft.add(_named(draft, kind, room), shape, height, texture)
    return True


_MIN_SIDE = 2.9
"""Smallest side of a room between wall centre lines [m]."""
_APPROACH = 0.65
"""Distance from a door of the places on both sides of it [m]."""
DOOR_TO_CORNER = 0.85
"""Smallest distance of a door's centre from the centre lines of the walls beside it [m]."""


@dataclass(frozen=True)
class RoomDoor:
    """A door in a dividing wall, between two rooms; lengths in metres."""

    name: str
    cut: WallLine
    along: float
    width: float
    rooms: tuple[str, str]

    def point(self, off: float = 0.0) -> Point:
        """The door's centre, or the point at distance ``off`` [m] from it, normal to the wall."""
        return by_axis(self.cut.axis, self.cut.at + off, self.along)


@dataclass
class RoomLayout:
    """Rooms between wall centre lines, the walls between them, and their doors."""

    rooms: list[RoomSpec]
    cuts: list[WallLine]
    doors: list[RoomDoor] = field(default_factory=list)


class Rooms(WorldFamily):
    """Two to six furnished rooms, joined by doors 0.8 to 1.0 m wide."""

    name: ClassVar[str] = "rooms"
    loops: ClassVar[float] = 0.35
    """Probability of a door that is not needed to reach a room."""

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw two to six rooms; more rooms and furniture, and narrower doors, when difficult."""
        count = int(np.clip(round(blend(2.5, 5.5, difficulty) + rng.uniform(-1.2, 1.2)), 2, 6))
        area = count * rng.uniform(14.0, 19.0)
        aspect = rng.uniform(1.0, 1.7)
        draft = WorldDraft.empty(rng, math.sqrt(area * aspect), math.sqrt(area / aspect))
        layout = _divide(draft, count)
        _add_doors(rng, layout, difficulty, self.loops)
        _build_walls(draft, layout)
        draft.description = f"{count} furnished rooms joined by doors 0.8 to 1.0 m wide."
        start_room, goal_room = _far_apart(layout, rng)
        for door in layout.doors:
            draft.keep_free(*door.point(), 1.0)
            for off in (-_APPROACH, _APPROACH):
                draft.keep_free(*door.point(off), 0.5)
        start, goal = (_free_point(draft, room) for room in (start_room, goal_room))
        # the robot faces its room's first door
        exit_ = next(door.point() for door in layout.doors if start_room.name in door.rooms)
        draft.set_start_and_goal(start, goal, towards=exit_)
        for point in (start, goal):
            draft.keep_free(*point, 0.55)
        furnish(
            draft,
            [(room.name, *inner_spans(draft, room)) for room in layout.rooms],
            density=blend(0.16, 0.34, difficulty),
            gap=blend(0.95, 0.8, difficulty),
        )
        _add_map(draft, layout, start_room, goal_room)
        return draft


# --- rooms and walls --------------------------------------------------------------------------


def _divide(draft: WorldDraft, count: int) -> RoomLayout:
    """Divide the largest room across its longer side until there are ``count``."""
    rng = draft.rng
    parts = [(draft.x, draft.y)]
    cuts: list[WallLine] = []
    while len(parts) < count:
        parts.sort(key=lambda area: -(area[0][1] - area[0][0]) * (area[1][1] - area[1][0]))
        area = parts.pop(0)
        sides = [area[0][1] - area[0][0], area[1][1] - area[1][0]]
        axis = int(sides[1] > sides[0])
        if sides[axis] < 2 * _MIN_SIDE:
            raise Unsuitable("rooms too small")
        share = rng.uniform(0.38, 0.62)
        low, high = area[axis]
        at = min(max(low + share * sides[axis], low + _MIN_SIDE), high - _MIN_SIDE)
        at = round(float(at), 3)
        cuts.append(WallLine(axis, at, *area[1 - axis]))
        parts += [by_axis(axis, side, area[1 - axis]) for side in ((low, at), (at, high))]
    rooms = [RoomSpec(name=f"room-{i}", x=x, y=y) for i, (x, y) in enumerate(parts, start=1)]
    return RoomLayout(rooms, cuts)


def _shared(
    layout: RoomLayout,
) -> Iterator[tuple[RoomSpec, RoomSpec, WallLine, float, float]]:
    """Adjacent rooms, the wall between them, and the interval [m] along it for a door."""
    for a, b in combinations(layout.rooms, 2):
        for cut in layout.cuts:
            sides = [(a.x, a.y)[cut.axis], (b.x, b.y)[cut.axis]]
            if {sides[0][1], sides[1][1]} & {cut.at} and {sides[0][0], sides[1][0]} & {cut.at}:
                spans = [(a.x, a.y)[1 - cut.axis], (b.x, b.y)[1 - cut.axis]]
                low = max(cut.low, spans[0][0], spans[1][0]) + DOOR_TO_CORNER
                high = min(cut.high, spans[0][1], spans[1][1]) - DOOR_TO_CORNER
                if low <= high:
                    yield a, b, cut, low, high


def _add_doors(
    rng: np.random.Generator, layout: RoomLayout, difficulty: float, loops: float
) -> None:
    """Doors that connect all rooms, and a few more."""
    walls = list(_shared(layout))
    graph = nx.Graph()
    graph.add_nodes_from(room.name for room in layout.rooms)
    for i in rng.permutation(len(walls)):
        a, b, cut, low, high = walls[i]
        needed = not nx.has_path(graph, a.name, b.name)
        if not needed and rng.random() > loops:
            continue
        graph.add_edge(a.name, b.name)
        width = round(float(rng.uniform(blend(0.9, 0.8, difficulty), 1.0)), 2)
        along = round(float(rng.uniform(low, high)), 3)
        name = f"door-{len(layout.doors) + 1}"
        first, second = sorted((a, b), key=lambda room: (room.x, room.y)[cut.axis][0])
        layout.doors.append(RoomDoor(name, cut, along, width, (first.name, second.name)))
    if not nx.is_connected(graph):
        raise Unsuitable("rooms that are not connected")


def _build_walls(draft: WorldDraft, layout: RoomLayout) -> None:
    palette = draft.palette
    draft.enclose(palette.draw("wall"))
    draft.ceiling = palette.draw("ceiling")
    floors = palette.draw_many("floor", 2)
    walls = palette.draw_many("wall", 3)
    draft.rooms += [
        room.model_copy(update={"floor": palette.pick(floors), "walls": palette.pick(walls)})
        for room in layout.rooms
    ]
    for i, cut in enumerate(layout.cuts, start=1):
        edge = draft.y if cut.axis == 0 else draft.x
        ends = rounded(max(cut.low, edge[0] + WALL / 2), min(cut.high, edge[1] - WALL / 2))
        points = tuple(by_axis(cut.axis, cut.at, end) for end in ends)
        openings = tuple(
            OpeningSpec(name=door.name, at=door.point(), width=door.width)
            for door in layout.doors
            if door.cut is cut
        )
        draft.walls.append(
            WallSpec(name=f"wall-{i}", points=points, openings=openings, texture=walls[0])
        )


# --- start, goal, furniture -------------------------------------------------------------------


def _far_apart(layout: RoomLayout, rng: np.random.Generator) -> tuple[RoomSpec, RoomSpec]:
    """Return a random room, and one of those with the most doors between."""
    graph = nx.Graph(door.rooms for door in layout.doors)
    start = layout.rooms[int(rng.integers(len(layout.rooms)))]
    doors = nx.single_source_shortest_path_length(graph, start.name)
    most = max(doors.values())
    farthest = [room for room in layout.rooms if doors[room.name] == most]
    return start, farthest[int(rng.integers(len(farthest)))]


def _free_point(draft: WorldDraft, room: RoomSpec) -> Point:
    """Return a random point of the room, away from its walls."""
    x, y = (draft.rng.uniform(low + 0.75, high - 0.75) for low, high in (room.x, room.y))
    return float(x), float(y)


def inner_spans(draft: WorldDraft, room: RoomSpec) -> tuple[Interval, Interval]:
    """Return the room's x and y [m] between wall faces; outer walls are on the floor's edge."""

    def inner(span: Interval, edge: Interval) -> Interval:
        low, high = (WALL if at == end else 0.5 * WALL for at, end in zip(span, edge, strict=True))
        return span[0] + low, span[1] - high

    return inner(room.x, draft.x), inner(room.y, draft.y)


def _add_map(
    draft: WorldDraft, layout: RoomLayout, start_room: RoomSpec, goal_room: RoomSpec
) -> None:
    """The map: doors with a place on either side, a centre of each room, start and goal."""
    roadmap = Roadmap(draft.geometry())
    members: dict[str, list[str]] = {room.name: [] for room in layout.rooms}
    for door in layout.doors:
        middle = roadmap.add(door.name, *door.point(), "door")
        for name, off in zip(door.rooms, (-_APPROACH, _APPROACH), strict=True):
            before = roadmap.add(f"{door.name}-{name}", *door.point(off), "room")
            members[name].append(before)
            if not roadmap.add_passage(middle, before, door.width):
                raise Unsuitable("a blocked door")
    members[start_room.name].append(roadmap.add("start", *draft.start[:2]))
    members[goal_room.name].append(roadmap.add("goal", *draft.goal))
    draft.goal_place = "goal"
    for room in layout.rooms:
        (x0, x1), (y0, y1) = inner_spans(draft, room)
        point = roadmap.central_point((x0, y0), (x1, y1))
        if all(roadmap.places[name].distance(*point) > 0.6 for name in members[room.name]):
            members[room.name].append(roadmap.add(room.name, *point))
        roadmap.connect_all(members[room.name], room)
    draft.topo_map = roadmap.build("generated-rooms")
