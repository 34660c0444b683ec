"""Walls around regions of the plane that are unions of rectangles: corridors, cells, side rooms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from navfw.sim.worldspec import OpeningSpec, WallSpec
from navfw.worldgen.world_draft import WALL

__all__ = ["Area", "Gap", "Line", "boundary_lines", "walls_along"]

# ends reach into the wall they meet, but not to its far face, where two faces would share a plane
_FILL = 0.4 * WALL


@dataclass(frozen=True, slots=True)
class Area:
    """A rectangle of free floor; areas of the same region have no wall between them."""

    x: tuple[float, float]
    y: tuple[float, float]
    region: int = 1


@dataclass(frozen=True, slots=True)
class Gap:
    """A door gap: its middle [m] and width [m]; it lies on some line."""

    name: str
    at: tuple[float, float]
    width: float


@dataclass(frozen=True, slots=True)
class Line:
    """Where a wall stands: at ``at`` [m] on ``axis`` (0: x), from ``low`` to ``high``."""

    axis: int
    at: float
    low: float
    high: float

    def holds(self, point: tuple[float, float], half: float) -> bool:
        """Whether a gap of that half width fits into the line around the point."""
        along = point[1 - self.axis]
        on = abs(point[self.axis] - self.at) < 1e-6
        return on and self.low + half <= along <= self.high - half


def boundary_lines(areas: Sequence[Area]) -> list[Line]:
    """The lines between regions, and between regions and the rest of the world."""
    xs = np.unique([edge for area in areas for edge in area.x])
    ys = np.unique([edge for area in areas for edge in area.y])
    region = np.zeros((xs.size + 1, ys.size + 1), dtype=np.int64)  # with a rim of nothing
    for area in areas:
        i, j = np.searchsorted(xs, area.x), np.searchsorted(ys, area.y)
        region[i[0] + 1 : i[1] + 1, j[0] + 1 : j[1] + 1] = area.region
    lines = [Line(0, *numbers) for numbers in _runs(region, xs, ys)]
    lines += [Line(1, *numbers) for numbers in _runs(region.T, ys, xs)]
    return lines


def _runs(
    region: npt.NDArray[np.int64],
    at: npt.NDArray[np.float64],
    along: npt.NDArray[np.float64],
) -> Iterator[tuple[float, float, float]]:
    """(at, low, high) of maximal straight stretches where the region changes across ``at``."""
    differ = region[:-1] != region[1:]
    for i, row in enumerate(differ):
        changes = np.flatnonzero(np.diff(row[1:-1].astype(int), prepend=0, append=0))
        for begin, end in pairwise(changes.tolist()):
            if row[begin + 1]:
                yield float(at[i]), float(along[begin]), float(along[end])


def walls_along(
    lines: Sequence[Line], gaps: Sequence[Gap], texture: str, height: float = 2.4
) -> list[WallSpec]:
    """A wall on every line, with its gaps; its ends reach into the walls that it meets."""
    walls = []
    for number, line in enumerate(lines, start=1):
        low, high = round(line.low - _FILL, 3), round(line.high + _FILL, 3)
        ends = ((line.at, low), (line.at, high))
        points = ends if line.axis == 0 else tuple((b, a) for a, b in ends)
        openings = tuple(
            OpeningSpec(name=gap.name, at=gap.at, width=gap.width)
            for gap in gaps
            if line.holds(gap.at, 0.5 * gap.width)
        )
        walls.append(
            WallSpec(
                name=f"wall-{number}",
                points=points,
                openings=openings,
                texture=texture,
                height=height,
            )
        )
    return walls
