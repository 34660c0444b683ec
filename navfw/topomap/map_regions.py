"""The regions of free ground between doors, and names for the places in them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping

import cv2
import numpy as np

from navfw.topomap.clearance_grid import ClearanceGrid
from navfw.topomap.door_detection import DOOR_WIDTH

Point = tuple[float, float]
Bounds = tuple[float, float, float, float]

_CORRIDOR_RATIO = 4.0
"""A region whose area exceeds this many times the square of its width is a corridor."""

_CORRIDOR_WIDTH = 3.5
"""Largest width [m] of a corridor: what is wider is a hall, however long."""

HALL = 60.0
"""A region that is no corridor and has at least this area [m^2] is a hall."""

SMALL = 1.0
"""Regions below this area [m^2] are no rooms of their own: niches between solids."""


class Regions:
    """The regions of free space between the doors: 0 where occupied, else a region's number."""

    def __init__(self, grid: ClearanceGrid, doors: Iterable[tuple[Point, Point]]) -> None:
        self._grid = grid
        free = (grid.clearance > 0.1).astype(np.uint8)
        half = 0.5 * DOOR_WIDTH / grid.cell
        for at, through in doors:
            row, column = self._index(*at)
            ends = [
                (round(column - sign * half * through[1]), round(row + sign * half * through[0]))
                for sign in (-1, 1)
            ]
            cv2.line(free, ends[0], ends[1], 0, 2)
        _, self._labels, stats, centres = cv2.connectedComponentsWithStats(free, connectivity=4)
        self._areas = stats[:, cv2.CC_STAT_AREA] * grid.cell**2
        self._centres = [grid.point(y, x) for x, y in centres]
        self._corridors: dict[int, bool] = {}

    def at(self, x: float, y: float) -> int:
        """The region at a point [m]."""
        return int(self._labels[self._index(x, y)])

    def area(self, region: int) -> float:
        """Area [m^2] of a region."""
        return float(self._areas[region])

    def is_corridor(self, region: int) -> bool:
        """Whether the region is narrow, and long for its width."""
        if region not in self._corridors:
            width = 2.0 * float(self._grid.clearance[self._labels == region].max())
            long = self._areas[region] > _CORRIDOR_RATIO * width * width
            self._corridors[region] = region > 0 and bool(long) and width <= _CORRIDOR_WIDTH
        return self._corridors[region]

    def names(self) -> dict[int, str]:
        """Names by kind and number, from the upper left to the lower right: ``room-3``."""
        large = [r for r in range(1, len(self._areas)) if self._areas[r] >= SMALL]
        large.sort(key=lambda r: (-round(self._centres[r][1]), self._centres[r][0]))
        kinds = {region: self._kind(region) for region in large}
        numbers = {kind: itertools.count(1) for kind in kinds.values()}
        alone = {kind for kind in numbers if list(kinds.values()).count(kind) == 1}
        return {
            region: kind if kind in alone else f"{kind}-{next(numbers[kind])}"
            for region, kind in kinds.items()
        }

    def _kind(self, region: int) -> str:
        if self.is_corridor(region):
            return "corridor"
        return "hall" if self._areas[region] >= HALL else "room"

    def _index(self, x: float, y: float) -> tuple[int, int]:
        cell, (x0, y0) = self._grid.cell, self._grid.origin
        return round((y - y0) / cell), round((x - x0) / cell)


class PlaceNames:
    """Unique names for places, after the rooms that contain them."""

    def __init__(self, rooms: Mapping[str, Bounds], regions: Regions) -> None:
        # smallest first: of nested rooms the inner one gives the name
        self._rooms = sorted(rooms.items(), key=lambda room: _area(room[1]))
        self._regions = regions
        self._region_names = {} if rooms else regions.names()
        self._taken: set[str] = set()

    def centre(self, at: Point, kind: str) -> str:
        """The name of the place that represents a room."""
        return self._free(self._room(*at) or kind, first=True)

    def place(self, at: Point, kind: str) -> str:
        """The name of any other place."""
        stem = self._room(*at) or kind
        if self._region_names and kind in {"corner", "junction"} and stem != kind:
            stem = f"{stem}-{kind}"
        return self._free(stem, first=False)

    def door(self, at: Point, through: Point) -> str:
        """The name of a door: that of the rooms on its sides."""
        sides = []
        for sign in (-1, 1):
            room = self._room(at[0] + sign * 0.7 * through[0], at[1] + sign * 0.7 * through[1])
            if room is not None and room not in sides:
                sides.append(room)
        return self._free("-".join([*sorted(sides), "door"]), first=True)

    def _room(self, x: float, y: float) -> str | None:
        if self._region_names:
            return self._region_names.get(self._regions.at(x, y))
        inside = (n for n, (x0, x1, y0, y1) in self._rooms if x0 <= x <= x1 and y0 <= y <= y1)
        return next(inside, None)

    def _free(self, stem: str, first: bool) -> str:
        names = itertools.chain(
            [stem] if first else [], (f"{stem}-{n}" for n in itertools.count(1))
        )
        name = next(name for name in names if name not in self._taken)
        self._taken.add(name)
        return name


def _area(bounds: Bounds) -> float:
    x0, x1, y0, y1 = bounds
    return (x1 - x0) * (y1 - y0)
