"""Furniture along the walls and in the middle of rooms, with passable gaps."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from navfw.sim.shapes import Circle, Rectangle
from navfw.worldgen.world_draft import WorldDraft

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
    stem = f"{room}-{kind}"
    number = 1
    while f"{stem}-{number}" in taken:
        number += 1
    return f"{stem}-{number}"


def _along_wall(
    draft: WorldDraft, room: str, x: Interval, y: Interval, gap: float, textures: tuple[str, ...]
) -> bool:
    """Try a box with its back to a wall: in a corner, or at least ``gap`` [m] from it."""
    rng = draft.rng
    kind, lengths, depths, heights = _ALONG_WALLS[int(rng.integers(len(_ALONG_WALLS)))]
    length, depth, height = _pick(rng, lengths), _pick(rng, depths), _pick(rng, heights)
    axis, far = int(rng.integers(2)), bool(rng.integers(2))
    across, along = ((x, y), (y, x))[axis]
    inset = _TO_WALL
    low, high = along[0] + inset + 0.5 * length, along[1] - inset - 0.5 * length
    if low >= high:
        return False
    at = rng.uniform(low, high)
    if min(at - low, high - at) < gap:  # no passable gap to the corner: move it there
        at = low if at - low < high - at else high
    back = across[1] - inset - 0.5 * depth if far else across[0] + inset + 0.5 * depth
    if axis == 0:
        box = Rectangle(back, at, 0.5 * depth, 0.5 * length)
    else:
        box = Rectangle(at, back, 0.5 * length, 0.5 * depth)
    if not (across[1] - across[0] - depth - 2 * inset >= gap and draft.fits(box, gap)):
        return False
    draft.add_box(_named(draft, kind, room), box, height, draft.palette.pick(textures))
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
    if isinstance(shape, Circle):
        draft.add_cylinder(_named(draft, kind, room), shape, height, texture)
    else:
        draft.add_box(_named(draft, kind, room), shape, height, texture)
    return True
