"""Doors, the regions of free ground between them, and names for the places in the regions.

A door is a short narrow gap between wider ground on a line of the skeleton.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from navfw.numerics import Array
from navfw.topomap.clearance_grid import ClearanceGrid

DOOR_WIDTH = 1.5  # chosen
"""Largest width of a door [m]."""

BEFORE_DOOR = 0.8  # chosen
"""Distance [m] from a door to the places before and behind it."""

_DOOR_DEPTH = 1.7  # derived
"""Largest distance [m] between the points before and behind a door where it has become wider: a
door of 1.5 m in a wall of 1 m. A gap that is longer is a corridor."""

_WIDER = 0.06  # chosen
"""Clearance [m] gained in front of a door: it opens into wider ground."""

_JAMB_REACH = 0.15  # chosen
"""Jambs lie at most this much [m] farther than the nearest obstacle on both sides of a door."""

_SQUARE = math.radians(8.0)  # chosen
"""A door whose direction is within this angle [rad] of an axis is taken to be along the axis."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Door:
    """A door on a line: index of the nearest point of it, middle [m], unit direction through it."""

    index: int
    at: Point
    through: Point


def doors_on(grid: ClearanceGrid, line: Array, roughness: float = 0.0) -> list[Door]:
    """Find the doors on ``line`` (N, 2) [m], in its order.

    A door is the narrowest part of a gap between jambs on both sides that becomes wider within 1.7
    m; it lies in the middle of the wall. Walls are uneven by ``roughness`` [m].
    """
    clearance = np.array([grid.at(*point) for point in line])
    doors: list[Door] = []
    for index in range(1, len(line) - 1):
        narrowest = clearance[index]
        around = slice(max(index - 10, 0), index + 11)
        if narrowest > 0.5 * DOOR_WIDTH or narrowest > clearance[around].min() + 1e-9:
            continue
        jambs = _jambs(grid, line, index, narrowest + _JAMB_REACH)
        if jambs is None:
            continue
        point, through = _across(*jambs)
        enough = narrowest + roughness
        gap = [_until_wider(grid, point, through, sign, enough) for sign in (-1, 1)]
        if sum(gap) > _DOOR_DEPTH:
            continue
        shift = 0.5 * (gap[1] - gap[0])
        middle = point[0] + shift * through[0], point[1] + shift * through[1]
        if grid.at(*middle) < narrowest - 1.5 * grid.cell:
            continue  # no straight gap: its middle is narrower than its narrowest point
        if doors and math.dist(doors[-1].at, middle) < BEFORE_DOOR:
            continue
        nearest = int(np.argmin(np.linalg.norm(line - middle, axis=1)))
        doors.append(Door(nearest, middle, through))
    return doors


def _until_wider(
    grid: ClearanceGrid, at: Point, through: Point, sign: int, clearance: float
) -> float:
    """Return the distance [m] to where the gap is wider; infinite beyond ``_DOOR_DEPTH``."""
    for step in np.arange(grid.cell, _DOOR_DEPTH, grid.cell):
        x, y = at[0] + sign * step * through[0], at[1] + sign * step * through[1]
        if grid.at(x, y) >= clearance + _WIDER:
            return float(step)
    return math.inf


def _jambs(
    grid: ClearanceGrid, line: Array, index: int, reach: float
) -> tuple[Array, Array] | None:
    """Find the nearest solid points [m] right and left of ``line`` at ``index``, within reach.

    Returns None if there is nothing solid on one of the sides.
    """
    at = line[index]
    ahead = line[min(index + 6, len(line) - 1)] - line[max(index - 6, 0)]
    steps = np.arange(-reach, reach + grid.cell, 0.5 * grid.cell)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(offsets, axis=1)
    solid = (grid.at_points(at + offsets) < 0.5 * grid.cell) & (away <= reach)
    left = ahead[0] * offsets[:, 1] - ahead[1] * offsets[:, 0]
    jambs = []
    for side in (left < 0.0, left > 0.0):
        candidates = np.flatnonzero(solid & side)
        if candidates.size == 0:
            return None
        jambs.append(at + offsets[candidates[np.argmin(away[candidates])]])
    return jambs[0], jambs[1]


def _across(right: Array, left: Array) -> tuple[Point, Point]:
    """Return the middle [m] between two jambs, and the unit direction through them.

    The direction is along an axis if it nearly is (``_SQUARE``).
    """
    middle, across = 0.5 * (right + left), left - right
    angle = math.atan2(-across[0], across[1])
    square = 0.5 * math.pi * round(angle / (0.5 * math.pi))
    if abs(angle - square) < _SQUARE:
        angle = square
    return (float(middle[0]), float(middle[1])), (math.cos(angle), math.sin(angle))


Bounds = tuple[float, float, float, float]

_CORRIDOR_RATIO = 4.0  # chosen
"""A region whose area exceeds this many times the square of its width is a corridor."""

_CORRIDOR_WIDTH = 3.5  # chosen
"""Largest width [m] of a corridor: what is wider is a hall, however long."""

HALL = 60.0  # chosen
"""A region that is no corridor and has at least this area [m^2] is a hall."""

SMALL = 1.0  # chosen
"""Regions below this area [m^2] are no rooms of their own: niches between solids."""


class Regions:
    """Divides free space at the doors into numbered regions; occupied space is region 0."""

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
        """Return the number of the region at the point (x, y) [m, map]; 0 if it is occupied."""
        return int(self._labels[self._index(x, y)])

    def area(self, region: int) -> float:
        """Return the area [m^2] of a region."""
        return float(self._areas[region])

    def is_corridor(self, region: int) -> bool:
        """Return whether the region is at most 3.5 m wide, and long for its width."""
        if region not in self._corridors:
            width = 2.0 * float(self._grid.clearance[self._labels == region].max())
            long = self._areas[region] > _CORRIDOR_RATIO * width * width
            self._corridors[region] = region > 0 and bool(long) and width <= _CORRIDOR_WIDTH
        return self._corridors[region]

    def is_hall(self, region: int) -> bool:
        """Return whether the region has at least 60 m^2 and is no corridor."""
        return bool(region) and self._areas[region] >= HALL and not self.is_corridor(region)

    def names(self) -> dict[int, str]:
        """Name regions from 1 m^2 on by kind and number, from upper left to lower right: room-3."""
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
        return "hall" if self.is_hall(region) else "room"

    def _index(self, x: float, y: float) -> tuple[int, int]:
        cell, (x0, y0) = self._grid.cell, self._grid.origin
        return round((y - y0) / cell), round((x - x0) / cell)


class PlaceNames:
    """Makes unique names for places, after the rooms or else the regions that contain them."""

    def __init__(self, rooms: Mapping[str, Bounds], regions: Regions) -> None:
        # smallest first: of nested rooms the inner one gives the name
        areas = {name: (x1 - x0) * (y1 - y0) for name, (x0, x1, y0, y1) in rooms.items()}
        self._rooms = sorted(rooms.items(), key=lambda room: areas[room[0]])
        self._regions = regions
        self._region_names = {} if rooms else regions.names()
        self._taken: set[str] = set()

    def centre(self, at: Point, kind: str) -> str:
        """Return a name for the place of a room: the room's, or ``kind``, and a number if taken."""
        return self._free(self._room(*at) or kind, first=True)

    def place(self, at: Point, kind: str) -> str:
        """Return a name for any other place: the room's, or ``kind``, and a number."""
        stem = self._room(*at) or kind
        if self._region_names and kind in {"corner", "junction"} and stem != kind:
            stem = f"{stem}-{kind}"
        return self._free(stem, first=False)

    def door(self, at: Point, through: Point) -> str:
        """Return a name for a door, after the rooms on its two sides."""
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
