"""The family ``rooms``: furnished rooms with doors; start and goal are in different rooms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import networkx as nx
import numpy as np

from navfw.sim.worldspec import OpeningSpec, RoomSpec, WallSpec
from navfw.worldgen.furniture import furnish
from navfw.worldgen.roadmap import Roadmap
from navfw.worldgen.world_draft import WALL, Point, Unsuitable, WorldDraft, blend

_MIN_SIDE = 2.9
"""Least side of a room between wall centre lines [m]."""
_APPROACH = 0.65
"""Distance of the places on both sides of a door from it [m]."""


@dataclass(frozen=True)
class FloorRoom:
    """A rectangle between wall centre lines [m]."""

    name: str
    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and depth [m]."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0]

    def contains(self, x: float, y: float) -> bool:
        """Whether the point is inside."""
        return self.x[0] < x < self.x[1] and self.y[0] < y < self.y[1]


@dataclass(frozen=True)
class DividingWall:
    """A wall that divides a rectangle: at ``at`` [m] on ``axis`` (0: x), from low to high [m]."""

    axis: int
    at: float
    low: float
    high: float


@dataclass(frozen=True)
class RoomDoor:
    """A door in a dividing wall, between two rooms."""

    name: str
    cut: DividingWall
    along: float
    width: float
    rooms: tuple[str, str]

    def point(self, off: float = 0.0) -> Point:
        """The door's centre, or the point at distance ``off`` [m] from it, normal to the wall."""
        at = self.cut.at + off
        return (at, self.along) if self.cut.axis == 0 else (self.along, at)


@dataclass
class RoomLayout:
    """Rooms, the walls between them, and their doors."""

    rooms: list[FloorRoom]
    cuts: list[DividingWall]
    doors: list[RoomDoor] = field(default_factory=list)


def build(rng: np.random.Generator, difficulty: float) -> WorldDraft:
    """Two to six rooms; more rooms and furniture, and narrower doors, when difficult."""
    count = int(np.clip(round(blend(2.5, 5.5, difficulty) + rng.uniform(-1.2, 1.2)), 2, 6))
    area = count * rng.uniform(14.0, 19.0)
    aspect = rng.uniform(1.0, 1.7)
    draft = WorldDraft.empty(rng, math.sqrt(area * aspect), math.sqrt(area / aspect))
    layout = _divide(draft, count)
    _add_doors(rng, layout, difficulty)
    _build_walls(draft, layout)
    draft.description = f"{count} furnished rooms joined by doors 0.8 to 1.0 m wide."
    start_room, goal_room = _far_apart(layout, rng)
    _keep_doors_free(draft, layout)
    start, goal = (_free_point(draft, room) for room in (start_room, goal_room))
    draft.set_start_and_goal(start, goal, towards=_exit(layout, start_room))
    for point in (start, goal):
        draft.keep_free(*point, 0.55)
    furnish(
        draft,
        [(room.name, *_faces(draft, room)) for room in layout.rooms],
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
    cuts: list[DividingWall] = []
    while len(parts) < count:
        parts.sort(key=lambda part: -(part[0][1] - part[0][0]) * (part[1][1] - part[1][0]))
        part = parts.pop(0)
        sides = [part[0][1] - part[0][0], part[1][1] - part[1][0]]
        axis = int(sides[1] > sides[0])
        if sides[axis] < 2 * _MIN_SIDE:
            raise Unsuitable("rooms too small")
        share = rng.uniform(0.38, 0.62)
        low, high = part[axis]
        at = min(max(low + share * sides[axis], low + _MIN_SIDE), high - _MIN_SIDE)
        at = round(float(at), 3)
        cuts.append(DividingWall(axis, at, *part[1 - axis]))
        for side in ((low, at), (at, high)):
            parts.append((side, part[1]) if axis == 0 else (part[0], side))
    rooms = [FloorRoom(f"room-{i}", *part) for i, part in enumerate(parts, start=1)]
    return RoomLayout(rooms, cuts)


def _shared(
    layout: RoomLayout,
) -> Iterator[tuple[FloorRoom, FloorRoom, DividingWall, float, float]]:
    """Adjacent rooms, the wall between them, and the interval [m] along it for a door."""
    for a, b in combinations(layout.rooms, 2):
        for cut in layout.cuts:
            sides = [(a.x, a.y)[cut.axis], (b.x, b.y)[cut.axis]]
            if {sides[0][1], sides[1][1]} & {cut.at} and {sides[0][0], sides[1][0]} & {cut.at}:
                spans = [(a.x, a.y)[1 - cut.axis], (b.x, b.y)[1 - cut.axis]]
                low = max(cut.low, spans[0][0], spans[1][0]) + 0.85
                high = min(cut.high, spans[0][1], spans[1][1]) - 0.85
                if low <= high:
                    yield a, b, cut, low, high


def _add_doors(rng: np.random.Generator, layout: RoomLayout, difficulty: float) -> None:
    """Doors that connect all rooms, and a few more."""
    walls = list(_shared(layout))
    graph = nx.Graph()
    graph.add_nodes_from(room.name for room in layout.rooms)
    for i in rng.permutation(len(walls)):
        a, b, cut, low, high = walls[i]
        needed = not nx.has_path(graph, a.name, b.name)
        if not needed and rng.random() > 0.35:
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
    for room in layout.rooms:
        draft.rooms.append(
            RoomSpec(
                name=room.name,
                x=room.x,
                y=room.y,
                floor=palette.pick(floors),
                walls=palette.pick(walls),
            )
        )
    for i, cut in enumerate(layout.cuts, start=1):
        low = max(cut.low, (draft.y if cut.axis == 0 else draft.x)[0] + WALL / 2)
        high = min(cut.high, (draft.y if cut.axis == 0 else draft.x)[1] - WALL / 2)
        ends = (round(low, 3), round(high, 3))
        points = tuple((cut.at, end) if cut.axis == 0 else (end, cut.at) for end in ends)
        openings = tuple(
            OpeningSpec(name=door.name, at=door.point(), width=door.width)
            for door in layout.doors
            if door.cut is cut
        )
        draft.walls.append(
            WallSpec(name=f"wall-{i}", points=points, openings=openings, texture=walls[0])
        )


# --- start, goal, furniture -------------------------------------------------------------------


def _far_apart(layout: RoomLayout, rng: np.random.Generator) -> tuple[FloorRoom, FloorRoom]:
    """A random room, and one of those with the most doors between."""
    graph = nx.Graph(door.rooms for door in layout.doors)
    start = layout.rooms[int(rng.integers(len(layout.rooms)))]
    doors = nx.single_source_shortest_path_length(graph, start.name)
    most = max(doors.values())
    farthest = [room for room in layout.rooms if doors[room.name] == most]
    return start, farthest[int(rng.integers(len(farthest)))]


def _keep_doors_free(draft: WorldDraft, layout: RoomLayout) -> None:
    for door in layout.doors:
        draft.keep_free(*door.point(), 1.0)
        for off in (-_APPROACH, _APPROACH):
            draft.keep_free(*door.point(off), 0.5)


def _free_point(draft: WorldDraft, room: FloorRoom) -> Point:
    """A random point of the room, away from its walls."""
    x, y = (draft.rng.uniform(low + 0.75, high - 0.75) for low, high in (room.x, room.y))
    return float(x), float(y)


def _faces(draft: WorldDraft, room: FloorRoom) -> tuple[tuple[float, float], tuple[float, float]]:
    """The room's x and y [m] between wall faces; outer walls are on the floor's edge."""

    def inner(span: tuple[float, float], edge: tuple[float, float]) -> tuple[float, float]:
        low, high = (WALL if at == end else 0.5 * WALL for at, end in zip(span, edge, strict=True))
        return span[0] + low, span[1] - high

    return inner(room.x, draft.x), inner(room.y, draft.y)


def _exit(layout: RoomLayout, room: FloorRoom) -> Point:
    """Centre of the room's first door, which the robot faces at the start."""
    return next(door.point() for door in layout.doors if room.name in door.rooms)


def _add_map(
    draft: WorldDraft, layout: RoomLayout, start_room: FloorRoom, goal_room: FloorRoom
) -> None:
    """The map: doors with a place on either side, a centre of each room, start and goal."""
    roadmap = Roadmap(draft.floor_plan())
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
        (x0, x1), (y0, y1) = _faces(draft, room)
        point = roadmap.central_point((x0, y0), (x1, y1))
        if all(roadmap.places[name].distance(*point) > 0.6 for name in members[room.name]):
            members[room.name].append(roadmap.add(room.name, *point))
        roadmap.connect_all(members[room.name], f"{room.name}-corner", room.contains)
    draft.topo_map = roadmap.build("generated-rooms")
