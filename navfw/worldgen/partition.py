"""Walls around regions of the plane that are unions of rectangles, such as corridors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from navfw.sim.worldspec import OpeningSpec, WallSpec
from navfw.worldgen.looks import Palette
from navfw.worldgen.world_draft import WALL

_FILL = 0.4 * WALL
"""Extension of a wall's ends into the wall that they meet [m]: faces are not coplanar."""


@dataclass(frozen=True, slots=True)
class FloorArea:
    """A rectangle of free floor [m]; areas of one region have no wall between them."""

    x: tuple[float, float]
    y: tuple[float, float]
    region: int = 1


@dataclass(frozen=True, slots=True)
class WallLine:
    """A wall's centre line: at ``at`` [m] on ``axis`` (0: x), from ``low`` to ``high`` [m]."""

    axis: int
    at: float
    low: float
    high: float

    def contains(self, point: tuple[float, float], half: float) -> bool:
        """Whether a gap of half width ``half`` [m] around the point is within the line."""
        along = point[1 - self.axis]
        on = abs(point[self.axis] - self.at) < 1e-6
        return on and self.low + half <= along <= self.high - half


def boundary_lines(areas: Sequence[FloorArea]) -> list[WallLine]:
    """The lines between regions, and between regions and their surroundings."""
    xs = np.unique([edge for area in areas for edge in area.x])
    ys = np.unique([edge for area in areas for edge in area.y])
    region = np.zeros((xs.size + 1, ys.size + 1), dtype=np.int64)  # with a border of region 0
    for area in areas:
        i, j = np.searchsorted(xs, area.x), np.searchsorted(ys, area.y)
        region[i[0] + 1 : i[1] + 1, j[0] + 1 : j[1] + 1] = area.region
    lines = [WallLine(0, *numbers) for numbers in _boundary_intervals(region, xs, ys)]
    lines += [WallLine(1, *numbers) for numbers in _boundary_intervals(region.T, ys, xs)]
    return lines


def _boundary_intervals(
    region: npt.NDArray[np.int64],
    at: npt.NDArray[np.float64],
    along: npt.NDArray[np.float64],
) -> Iterator[tuple[float, float, float]]:
    """(at, low, high) of maximal intervals in which the region changes across ``at``."""
    differ = region[:-1] != region[1:]
    for i, row in enumerate(differ):
        changes = np.flatnonzero(np.diff(row[1:-1].astype(int), prepend=0, append=0))
        for begin, end in pairwise(changes.tolist()):
            if row[begin + 1]:
                yield float(at[i]), float(along[begin]), float(along[end])


def walls_along(
    lines: Sequence[WallLine],
    gaps: Sequence[OpeningSpec],
    palette: Palette,
    textures: Sequence[str],
) -> list[WallSpec]:
    """A wall on every line, with its gaps; its ends extend into the walls that they meet.

    Each has one of ``textures`` of ``palette``, at random.
    """
    walls = []
    for number, line in enumerate(lines, start=1):
        low, high = round(line.low - _FILL, 3), round(line.high + _FILL, 3)
        ends = ((line.at, low), (line.at, high))
        points = ends if line.axis == 0 else tuple((b, a) for a, b in ends)
        openings = tuple(gap for gap in gaps if line.contains(gap.at, 0.5 * gap.width))
        walls.append(
            WallSpec(
                name=f"wall-{number}",
                points=points,
                openings=openings,
                texture=palette.pick(textures),
            )
        )
    return walls
