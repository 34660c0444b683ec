"""Checks of a world's drops: on the floor, apart from each other, under no solid and no mover."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from navfw.config.document import KeyPath
from navfw.sim.drop_geometry import drop_rectangle
from navfw.sim.shapes import OVERLAP_TOLERANCE, Circle, overlap_depth
from navfw.sim.solids import solids_of
from navfw.sim.worldspec import WorldSpec

_ON_FLOOR = 0.05
"""A solid whose underside is lower than this [m] needs floor under it."""
_STEP = 0.05
"""Spacing [m] of the points at which a mover's path is tested."""

Point = tuple[float, float]


def drop_problems(world: WorldSpec) -> Iterator[tuple[KeyPath, str]]:
    """Problems of the drops of a world whose solids are valid: (key, message) of each."""
    solids = [s for s in solids_of(world) if s.bottom < _ON_FLOOR] if world.drops else []
    for i, drop in enumerate(world.drops):
        for axis, span, bounds in (("x", drop.x, world.x), ("y", drop.y, world.y)):
            if span[0] < bounds[0] or span[1] > bounds[1]:
                yield (
                    ("drops", i, axis),
                    f"{drop.name!r} extends beyond the floor, {axis} {list(bounds)} [m]",
                )
        shape = drop_rectangle(drop)
        above = next((s for s in solids if overlap_depth(shape, s.shape) > OVERLAP_TOLERANCE), None)
        if above is not None:
            yield ("drops", i, "x"), f"{above.name!r} would have no floor under it at {drop.name!r}"
        for other in world.drops[:i]:
            if overlap_depth(shape, drop_rectangle(other)) > 0.0:
                yield ("drops", i, "x"), f"{drop.name!r} overlaps {other.name!r}"
        for j, mover in enumerate(world.movers):
            points = _points_along(mover.path, mover.walk)
            circles = [Circle(*point, mover.radius) for point in points]
            if any(overlap_depth(circle, shape) > OVERLAP_TOLERANCE for circle in circles):
                yield ("movers", j, "path"), f"{mover.name!r} would walk into {drop.name!r}"


def _points_along(path: tuple[Point, ...], walk: str) -> Iterator[Point]:
    """Points at most ``_STEP`` apart along a mover's path."""
    for a, b in pairwise((*path, path[0]) if walk == "loop" else path):
        count = max(int(np.hypot(b[0] - a[0], b[1] - a[1]) / _STEP) + 1, 1)
        for share in np.linspace(0.0, 1.0, count + 1).tolist():
            yield a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
