"""The family ``corridors``: corridors with bends, branches, side doors and a few obstacles."""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar

import numpy as np

from navfw.interfaces import WorldFamily
from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.worldspec import DoorSpec, RoomSpec
from navfw.topomap import PlaceKind
from navfw.worldgen.corridor_network import (
    SIDE_ROOM,
    CorridorNetwork,
    CorridorSegment,
    Node,
    SideDoor,
    plan_network,
)
from navfw.worldgen.partition import DoorGap, WallLine, boundary_lines, walls_along
from navfw.worldgen.roadmap import Roadmap
from navfw.worldgen.world_draft import ROBOT, WALL, Unsuitable, WorldDraft, blend

_APPROACH = 0.65
"""Least distance of the place in a side room from its door [m]."""


class Corridors(WorldFamily):
    """Bent and branching corridors 1.0 to 2.0 m wide with side doors and obstacles."""

    name: ClassVar[str] = "corridors"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Corridors 1.0 to 2.0 m wide; narrower, longer and with more obstacles when difficult."""
        network, size = plan_network(rng, difficulty)
        draft = WorldDraft.empty(rng, *size)
        draft.description = "Bent and branching corridors 1.0 to 2.0 m wide with side doors."
        lines = boundary_lines(network.areas)
        _build_walls(draft, network, lines)
        start, goal = network.where[network.route[0]], network.where[network.route[-1]]
        draft.set_start_and_goal(start, goal, towards=network.where[network.route[1]])
        _add_obstacles(draft, network, difficulty)
        _add_map(draft, network)
        return draft


# --- the world --------------------------------------------------------------------------------


def _build_walls(draft: WorldDraft, network: CorridorNetwork, lines: list[WallLine]) -> None:
    palette = draft.palette
    draft.ceiling = palette.draw("ceiling")
    walls, floors = palette.draw_many("wall", 4), palette.draw_many("floor", 2)
    gaps = [DoorGap(door.name, door.at, door.width) for door in network.doors]
    for gap in gaps:
        if not any(line.contains(gap.at, 0.5 * gap.width + 0.1) for line in lines):
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
    at = (along, off) if segment.axis == 0 else (off, along)
    number = len(draft.shapes) + 1
    if rng.random() < 0.35:
        circle = Circle(*at, 0.5 * depth)
        if draft.fits(circle, 1.1):
            draft.add_cylinder(f"cylinder-{number}", circle, rng.uniform(0.5, 1.6), texture)
        return
    half = (0.5 * length, 0.5 * depth) if segment.axis == 0 else (0.5 * depth, 0.5 * length)
    box = Rectangle(*at, *half)
    if draft.fits(box, 1.1):
        draft.add_box(f"box-{number}", box, rng.uniform(0.5, 1.8), texture)


# --- the map ----------------------------------------------------------------------------------


def _add_map(draft: WorldDraft, network: CorridorNetwork) -> None:
    """Places at nodes and in front of side doors, connected in a row along each corridor."""
    roadmap = Roadmap(draft.geometry())
    names = {node: _add_node(roadmap, network, node) for node in sorted(network.graph)}
    for segment in network.segments:
        stations = [(network.where[n][segment.axis], names[n]) for n in (segment.a, segment.b)]
        for door in network.doors:
            if door.segment == segment and door.is_open:
                stations.append((door.at[segment.axis], _add_door(roadmap, network, door)))
        stations.sort()
        joined = _drop_close(roadmap, [name for _, name in stations])
        for a, b in pairwise(joined):
            if not roadmap.connect(a, b, "pass", _anywhere, segment.width - WALL):
                raise Unsuitable("a blocked corridor")
    draft.goal_place = "goal"
    draft.topo_map = roadmap.build("generated-corridors")


def _anywhere(x: float, y: float) -> bool:
    """Accept every point: walls bound the corridors."""
    del x, y
    return True


def _add_node(roadmap: Roadmap, network: CorridorNetwork, node: Node) -> str:
    beyond = sorted(network.graph[node])
    bent = len(beyond) == 2 and all(beyond[0][i] != beyond[1][i] for i in (0, 1))
    kind: PlaceKind = "junction" if len(beyond) > 2 else "corner" if bent else "corridor"
    if node == network.route[-1]:
        name = "goal"
    else:
        name = "start" if node == network.route[0] else roadmap.numbered(kind)
    return roadmap.add(name, *network.where[node], kind)


def _add_door(roadmap: Roadmap, network: CorridorNetwork, door: SideDoor) -> str:
    """Add the door, the room behind it and the place in front of it; returns the last one."""
    before = roadmap.add(
        f"{door.name}-corridor", *door.beside(-0.5 * door.segment.width), "junction"
    )
    middle = roadmap.add(door.name, *door.at, "door")
    behind = roadmap.add(
        f"{door.name}-room", *door.beside(max(_APPROACH, 0.5 * SIDE_ROOM[0])), "room"
    )
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
