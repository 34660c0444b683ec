"""Drops, holes in the floor: stairs down and pits, the remaining floor, the robot's fall.

A drop is a row of treads, each deeper than the one before; a pit has one tread only. Where two
treads, or a tread and the floor, differ in height there is a wall that faces the lower one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navfw.numerics import Array
from navfw.sim.shapes import OVERLAP_TOLERANCE, Rectangle, Shape, overlap_depth
from navfw.sim.worldspec import DropSpec, WorldSpec

_FALL_DEPTH = 0.02
"""The robot falls when one of its support points is deeper below the floor than this [m]."""

_FALL_MARGIN = 0.1
"""Distance [m] around a drop within which a support point below the floor counts for it."""

Corner = tuple[float, float]
Level = tuple[float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Tread:
    """A level part of a drop: x and y from, to [m] and its depth below the floor [m].

    ``rims`` are the heights [m] (negative: below the floor) of the surfaces next to it: west, east,
    south, north.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    depth: float
    rims: tuple[float, float, float, float]

    @property
    def rectangle(self) -> Rectangle:
        """Its outline in the plane."""
        return _rectangle(self.x, self.y)

    def walls(self) -> Iterator[tuple[Corner, Corner, float]]:
        """The vertical faces around it, seen from it: (left end, right end, upper edge [m])."""
        (x0, x1), (y0, y1) = self.x, self.y
        sides = (
            ((x0, y0), (x0, y1)),
            ((x1, y1), (x1, y0)),
            ((x1, y0), (x0, y0)),
            ((x0, y1), (x1, y1)),
        )
        for (start, end), rim in zip(sides, self.rims, strict=True):
            if rim > -self.depth:
                yield start, end, rim


def drop_rectangle(drop: DropSpec) -> Rectangle:
    """The outline of a drop in the plane."""
    return _rectangle(drop.x, drop.y)


def _rectangle(x: tuple[float, float], y: tuple[float, float]) -> Rectangle:
    half = 0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0])
    return Rectangle(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), *half)


def treads_of(drop: DropSpec) -> list[Tread]:
    """The treads of a drop, from the uppermost down."""
    count = max(drop.steps, 1)
    along, across = (drop.x, drop.y) if drop.down in ("east", "west") else (drop.y, drop.x)
    cuts = np.linspace(*along, count + 1).tolist()
    spans = list(pairwise(cuts))
    if drop.down in ("west", "south"):
        spans.reverse()
    treads = []
    for i, span in enumerate(spans):
        upper = -drop.depth * i / count
        lower = -drop.depth * (i + 2) / count if i + 1 < count else 0.0
        ends = (upper, lower) if drop.down in ("east", "north") else (lower, upper)
        depth = drop.depth * (i + 1) / count
        if drop.down in ("east", "west"):
            treads.append(Tread(span, across, depth, (*ends, 0.0, 0.0)))
        else:
            treads.append(Tread(across, span, depth, (0.0, 0.0, *ends)))
    return treads


def floor_pieces(world: WorldSpec) -> list[Rectangle]:
    """The floor of a world without its drops, as adjacent rectangles."""
    if not world.drops:
        return [_rectangle(world.x, world.y)]
    edges = sorted({*world.x, *(x for drop in world.drops for x in drop.x)})
    pieces = []
    for span in pairwise(edges):
        middle = 0.5 * (span[0] + span[1])
        holes = sorted(drop.y for drop in world.drops if drop.x[0] < middle < drop.x[1])
        bounds = [world.y[0], *(y for hole in holes for y in hole), world.y[1]]
        pieces += [
            _rectangle(span, (low, high))
            for low, high in zip(bounds[::2], bounds[1::2], strict=True)
            if high - low > 1e-6
        ]
    return pieces


def drop_at(world: WorldSpec, x: float, y: float) -> DropSpec | None:
    """The drop that contains a point [m], if any."""
    for drop in world.drops:
        if drop.x[0] < x < drop.x[1] and drop.y[0] < y < drop.y[1]:
            return drop
    return None


def drop_under(world: WorldSpec, shape: Shape) -> DropSpec | None:
    """The drop that overlaps this outline, if any."""
    for drop in world.drops:
        if overlap_depth(shape, drop_rectangle(drop)) > OVERLAP_TOLERANCE:
            return drop
    return None


def fallen_into(world: WorldSpec, points: Array) -> str | None:
    """Name of the drop that the robot has fallen into; None while it stands.

    ``points`` (N, 3) [m] are the robot's support points: below wheels and casters.
    """
    for drop in world.drops:
        inside = drop_rectangle(drop).distance(points[:, :2]) < _FALL_MARGIN
        if bool((inside & (points[:, 2] < -_FALL_DEPTH)).any()):
            return drop.name
    return None
