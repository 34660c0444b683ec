"""The family ``rooms``: a floor divided into furnished rooms with doors; the goal is in another."""

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

__all__ = ["build"]

_SMALLEST = 2.9
"""No side of a room is shorter than this [m], measured between walls' middles."""
_APPROACH = 0.65
"""The places before and behind a door are this far [m] from it."""


@dataclass(frozen=True)
class Room:
    """A rectangle between walls' middle lines [m]."""

    name: str
    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and depth [m]."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0]

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies inside."""
        return self.x[0] < x < self.x[1] and self.y[0] < y < self.y[1]


@dataclass(frozen=True)
class Cut:
    """A wall that divides a rectangle: at ``at`` [m] on ``axis`` (0: x), between low and high."""

    axis: int
    at: float
    low: float
    high: float


@dataclass(frozen=True)
class Door:
    """A door in a cut, between two rooms."""

    name: str
    cut: Cut
    along: float
    width: float
    rooms: tuple[str, str]

    def point(self, off: float = 0.0) -> Point:
        """The door's middle, or the point ``off`` [m] beside it, square to the wall."""
        at = self.cut.at + off
        return (at, self.along) if self.cut.axis == 0 else (self.along, at)


@dataclass
class House:
    """Rooms, the walls between them, and doors."""

    rooms: list[Room]
    cuts: list[Cut]
    doors: list[Door] = field(default_factory=list)


def build(rng: np.random.Generator, difficulty: float) -> WorldDraft:
    """Two to six rooms; more of them, more furniture and narrower doors when difficult."""
    count = int(np.clip(round(blend(2.5, 5.5, difficulty) + rng.uniform(-1.2, 1.2)), 2, 6))
    area = count * rng.uniform(14.0, 19.0)
    aspect = rng.uniform(1.0, 1.7)
    draft = WorldDraft.begin(rng, math.sqrt(area * aspect), math.sqrt(area / aspect))
    house = _divide(draft, count)
    _add_doors(rng, house, difficulty)
    _build_walls(draft, house)
    draft.description = f"{count} furnished rooms joined by doors 0.8 to 1.0 m wide."
    start_room, goal_room = _far_apart(house, rng)
    _keep_doors_free(draft, house)
    start, goal = (_free_point(draft, room) for room in (start_room, goal_room))
    draft.set_ends(start, goal, towards=_exit(house, start_room))
    for point in (start, goal):
        draft.keep_free(*point, 0.55)
    furnish(
        draft,
        [(room.name, *_faces(draft, room)) for room in house.rooms],
        density=blend(0.16, 0.34, difficulty),
        gap=blend(0.95, 0.8, difficulty),
    )
    _chart(draft, house, start_room, goal_room)
    return draft


# --- rooms and walls --------------------------------------------------------------------------


def _divide(draft: WorldDraft, count: int) -> House:
    """Halve the largest room again and again, across its longer side."""
    rng = draft.rng
    parts = [(draft.x, draft.y)]
    cuts: list[Cut] = []
    while len(parts) < count:
        parts.sort(key=lambda part: -(part[0][1] - part[0][0]) * (part[1][1] - part[1][0]))
        part = parts.pop(0)
        sides = [part[0][1] - part[0][0], part[1][1] - part[1][0]]
        axis = int(sides[1] > sides[0])
        if sides[axis] < 2 * _SMALLEST:
            raise Unsuitable("rooms too small")
        share = rng.uniform(0.38, 0.62)
        low, high = part[axis]
        at = min(max(low + share * sides[axis], low + _SMALLEST), high - _SMALLEST)
        at = round(float(at), 3)
        cuts.append(Cut(axis, at, *part[1 - axis]))
        for side in ((low, at), (at, high)):
            parts.append((side, part[1]) if axis == 0 else (part[0], side))
    rooms = [Room(f"room-{i}", *part) for i, part in enumerate(parts, start=1)]
    return House(rooms, cuts)


def _shared(house: House) -> Iterator[tuple[Room, Room, Cut, float, float]]:
    """Pairs of rooms with the wall between them, and where along it a door may be."""
    for a, b in combinations(house.rooms, 2):
        for cut in house.cuts:
            sides = [(a.x, a.y)[cut.axis], (b.x, b.y)[cut.axis]]
            if {sides[0][1], sides[1][1]} & {cut.at} and {sides[0][0], sides[1][0]} & {cut.at}:
                spans = [(a.x, a.y)[1 - cut.axis], (b.x, b.y)[1 - cut.axis]]
                low = max(cut.low, spans[0][0], spans[1][0]) + 0.85
                high = min(cut.high, spans[0][1], spans[1][1]) - 0.85
                if low <= high:
                    yield a, b, cut, low, high


def _add_doors(rng: np.random.Generator, house: House, difficulty: float) -> None:
    """Doors so that every room can be reached, and a few more."""
    walls = list(_shared(house))
    graph = nx.Graph()
    graph.add_nodes_from(room.name for room in house.rooms)
    for i in rng.permutation(len(walls)):
        a, b, cut, low, high = walls[i]
        needed = not nx.has_path(graph, a.name, b.name)
        if not needed and rng.random() > 0.35:
            continue
        graph.add_edge(a.name, b.name)
        width = round(float(rng.uniform(blend(0.9, 0.8, difficulty), 1.0)), 2)
        along = round(float(rng.uniform(low, high)), 3)
        name = f"door-{len(house.doors) + 1}"
        first, second = sorted((a, b), key=lambda room: (room.x, room.y)[cut.axis][0])
        house.doors.append(Door(name, cut, along, width, (first.name, second.name)))
    if not nx.is_connected(graph):
        raise Unsuitable("a room without a door")


def _build_walls(draft: WorldDraft, house: House) -> None:
    palette = draft.palette
    draft.enclose(palette.draw("wall"))
    draft.ceiling = palette.draw("ceiling")
    floors = palette.draw_many("floor", 2)
    walls = palette.draw_many("wall", 3)
    for room in house.rooms:
        draft.rooms.append(
            RoomSpec(
                name=room.name,
                x=room.x,
                y=room.y,
                floor=palette.pick(floors),
                walls=palette.pick(walls),
            )
        )
    for i, cut in enumerate(house.cuts, start=1):
        low = max(cut.low, (draft.y if cut.axis == 0 else draft.x)[0] + WALL / 2)
        high = min(cut.high, (draft.y if cut.axis == 0 else draft.x)[1] - WALL / 2)
        ends = (round(low, 3), round(high, 3))
        points = tuple((cut.at, end) if cut.axis == 0 else (end, cut.at) for end in ends)
        openings = tuple(
            OpeningSpec(name=door.name, at=door.point(), width=door.width)
            for door in house.doors
            if door.cut is cut
        )
        draft.walls.append(
            WallSpec(name=f"wall-{i}", points=points, openings=openings, texture=walls[0])
        )


# --- start, goal, furniture -------------------------------------------------------------------


def _far_apart(house: House, rng: np.random.Generator) -> tuple[Room, Room]:
    """A room, and one of those the most doors away from it."""
    graph = nx.Graph(door.rooms for door in house.doors)
    start = house.rooms[int(rng.integers(len(house.rooms)))]
    doors = nx.single_source_shortest_path_length(graph, start.name)
    most = max(doors.values())
    farthest = [room for room in house.rooms if doors[room.name] == most]
    return start, farthest[int(rng.integers(len(farthest)))]


def _keep_doors_free(draft: WorldDraft, house: House) -> None:
    for door in house.doors:
        draft.keep_free(*door.point(), 1.0)
        for off in (-_APPROACH, _APPROACH):
            draft.keep_free(*door.point(off), 0.5)


def _free_point(draft: WorldDraft, room: Room) -> Point:
    """Somewhere in the room, off its walls."""
    x, y = (draft.rng.uniform(low + 0.75, high - 0.75) for low, high in (room.x, room.y))
    return float(x), float(y)


def _faces(draft: WorldDraft, room: Room) -> tuple[tuple[float, float], tuple[float, float]]:
    """The room's x and y [m] between the faces of its walls; outer walls stand on its edge."""

    def inner(span: tuple[float, float], edge: tuple[float, float]) -> tuple[float, float]:
        low, high = (WALL if at == end else 0.5 * WALL for at, end in zip(span, edge, strict=True))
        return span[0] + low, span[1] - high

    return inner(room.x, draft.x), inner(room.y, draft.y)


def _exit(house: House, room: Room) -> Point:
    """The first door of a room: the start looks there, as people leave a robot."""
    return next(door.point() for door in house.doors if room.name in door.rooms)


def _chart(draft: WorldDraft, house: House, start_room: Room, goal_room: Room) -> None:
    """The map: doors with a place on either side, a middle for each room, start and goal."""
    road = Roadmap(draft.plan())
    members: dict[str, list[str]] = {room.name: [] for room in house.rooms}
    for door in house.doors:
        middle = road.add(door.name, *door.point(), "door")
        for name, off in zip(door.rooms, (-_APPROACH, _APPROACH), strict=True):
            before = road.add(f"{door.name}-{name}", *door.point(off), "room")
            members[name].append(before)
            if not road.link(middle, before, door.width):
                raise Unsuitable("a door that is blocked")
    members[start_room.name].append(road.add("start", *draft.start[:2]))
    members[goal_room.name].append(road.add("goal", *draft.goal))
    draft.goal_place = "goal"
    for room in house.rooms:
        (x0, x1), (y0, y1) = _faces(draft, room)
        point = road.middle_of((x0, y0), (x1, y1))
        if all(road.places[name].distance(*point) > 0.6 for name in members[room.name]):
            members[room.name].append(road.add(room.name, *point))
        road.join(members[room.name], f"{room.name}-corner", room.contains)
    draft.topo_map = road.finish("generated-rooms")
