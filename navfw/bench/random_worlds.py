"""Random worlds for measuring perception: a corridor with two rooms and doors on either side."""

from __future__ import annotations

import math

import numpy as np

from navfw.sim.shapes import Circle, Rectangle
from navfw.sim.worldspec import OpeningSpec, RoomSpec, WallSpec, WorldSpec
from navfw.worldgen.world_draft import WALL, WorldDraft

_CLEAR_OF_DOORS = 0.8
"""Least distance [m] of furniture from the middle of a door."""

_MAX_SIDE, _MAX_SIDE_IN_CORRIDOR = 0.8, 0.4
"""Largest side or diameter [m] of furniture; the corridor stays passable."""

_GAP = 0.02
"""Least gap [m] between furniture and anything else."""


def random_world(rng: np.random.Generator, name: str) -> WorldSpec:
    """A corridor 1.3 to 2.4 m wide, the first of the world's rooms, with two rooms on either side.

    Half of the worlds have a wall that slants across a room's corner, and half have furniture.
    """
    low, north = rng.uniform(3.5, 8.0, 2).tolist()
    high = low + float(rng.uniform(1.3, 2.4))
    draft = WorldDraft.empty(rng, float(rng.uniform(9.0, 16.0)), high + north)
    (x0, x1), (y0, y1) = ((a + 0.5 * WALL, b - 0.5 * WALL) for a, b in (draft.x, draft.y))
    split = float(rng.uniform(0.4, 0.6)) * x1
    split_south = split + float(rng.uniform(-1.0, 1.0))
    if rng.random() < 0.5:
        draft.ceiling = draft.palette.draw("ceiling")
    textures = draft.palette.draw_many("wall", 4)
    draft.enclose(draft.palette.pick(textures))
    walls = [
        WallSpec(name="south-room-wall", points=((split_south, y0), (split_south, low))),
        WallSpec(name="north-room-wall", points=((split, high), (split, y1))),
    ]
    for side, y in (("south", low), ("north", high)):
        spans = enumerate(((0.0, split - 1.0), (split + 1.0, x1)))
        doors = tuple(_door(rng, f"{side}-door-{k}", y, *span) for k, span in spans)
        walls.append(WallSpec(name=f"{side}-wall", points=((x0, y), (x1, y)), openings=doors))
    if rng.random() < 0.5:
        cut = float(rng.uniform(1.0, 2.2))
        run = min(cut * math.tan(float(rng.uniform(0.5, 1.07))), split_south - 1.2)
        walls.append(WallSpec(name="slanting-wall", points=((run, y0), (x0, cut))))
    draft.walls += [
        wall.model_copy(update={"texture": draft.palette.pick(textures)}) for wall in walls
    ]
    for room, x, y_span in (
        ("corridor", (x0, x1), (low, high)),
        ("south-west", (x0, split_south), (y0, low)),
        ("south-east", (split_south, x1), (y0, low)),
        ("north-west", (x0, split), (high, y1)),
        ("north-east", (split, x1), (high, y1)),
    ):
        floor, faces = draft.palette.draw("floor"), draft.palette.pick(textures)
        draft.rooms.append(RoomSpec(name=room, x=x, y=y_span, floor=floor, walls=faces))
    if rng.random() < 0.5:
        _furnish(rng, draft)
    return draft.world(name)


def _door(rng: np.random.Generator, name: str, y: float, start: float, end: float) -> OpeningSpec:
    width = float(rng.uniform(0.8, 1.1))
    x = float(rng.uniform(start + 0.5 * width + 0.4, end - 0.5 * width - 0.4))
    return OpeningSpec(name=name, at=(x, y), width=width)


def _furnish(rng: np.random.Generator, draft: WorldDraft) -> None:
    """Add up to seven boxes and cylinders a room, half of them low, clear of doors and walls."""
    for wall in draft.walls:
        for opening in wall.openings:
            draft.keep_free(*opening.at, _CLEAR_OF_DOORS)
    draft.shapes += [solid.shape for solid in draft.geometry().solids]
    textures = draft.palette.draw_many("thing", 4)
    for room in draft.rooms:
        largest = _MAX_SIDE_IN_CORRIDOR if room is draft.rooms[0] else _MAX_SIDE
        for _ in range(int(rng.integers(1, 8))):
            x, y = float(rng.uniform(*room.x)), float(rng.uniform(*room.y))
            height = float(rng.choice([rng.uniform(0.15, 0.5), rng.uniform(0.5, 1.7)]))
            half_x, half_y = (0.5 * rng.uniform(0.2, largest, 2)).tolist()
            name, texture = f"thing-{len(draft.shapes)}", draft.palette.pick(textures)
            box = Rectangle(x, y, half_x, half_y, float(rng.uniform(-math.pi, math.pi)))
            if rng.random() < 0.5 and draft.fits(box, _GAP):
                draft.add(name, box, height, texture)
            elif draft.fits(cylinder := Circle(x, y, half_x), _GAP):
                draft.add(name, cylinder, height, texture)
