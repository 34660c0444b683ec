"""The ground that the robot knows: where its body fits, what paths cost, where it ends unseen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np

from navfw.localmap.cell_arrays import bounds, distances, small_spots, without_gaps
from navfw.localmap.cost_kernels import cost_to_go, price_cells
from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices
from navfw.papfis.frontier_kernels import free_line, steepest_path, unseen_in_view
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Waypoint
from navfw.signals.grown_grid import FREE_BELOW
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap
from navfw.topomap.sharpening import sharpened

Point = tuple[float, float]

MIN_GAIN = 0.12  # chosen
"""Unseen floor [m^2] for which a frontier counts."""
MARGIN, CLEAR = 0.04, 0.25  # chosen
"""Clearances beside the body [m]: the least of a passable cell, and from which it costs no more;
those of the local planner, which drives the paths."""

_BORDER = 1.0  # chosen
"""Width [m] of the unseen ground that is added around what was observed."""
_AROUND = 10.0  # chosen
"""Distance [m] around robot and goal up to which a way is searched."""
_FREE, _UNKNOWN, _OFF_PLAN, _WALL = 1.2, 2.5, 5.0, 15.0  # chosen
"""Prices of unseen ground: free on the floor plan, without one, unknown to it, a wall on it. A wall
of 0.1 m with the body's room beside it costs as much as a detour of 7 m."""
_SPECK = 0.06  # chosen
"""Area [m^2] of unseen ground amid free ground that counts as free: a few rays wide."""
_SPOT = 0.03  # chosen
"""Area [m^2] of the largest occupied spot that is looked at once more if it bars what is beyond."""
_STANDING, _STANDING_PRICE = 0.35, 5.0  # chosen
"""Distance [m] from the robot up to which observed ground is passable at this price, whatever is
near: the body stands there and may drive off."""
_PIECE = 1.2  # chosen
"""Longest side [m] of a piece of the border between seen and unseen ground."""
_VIEW, _RAYS = 2.5, 48  # chosen
"""Distance [m] up to which unseen ground behind a frontier counts as gain, and rays that are cast:
the camera sees the floor about as far."""
_SWEEPS = 400  # chosen
"""Largest number of sweeps of the search: a path through a maze turns often."""
MIN_AHEAD = 0.4  # chosen
"""Least distance [m] of a waypoint, but at the end of the path: the robot is not at it yet."""
_HELD = 0.3  # chosen
"""Distance [m] up to which a new waypoint is dropped for the old one."""
_PRICE = 2.0  # chosen
"""Price of a cell up to which a straight line may cut through it."""


@dataclass(frozen=True, slots=True)
class Frontier:
    """A piece of the border between floor that the robot can reach, and unseen floor.

    x, y [m, map] is its middle; ``gain`` [m^2] the unseen floor in view from there, ``length`` [m]
    that of the path there, ``clearance`` [m] the least beside the body on it, and ``first`` (x, y)
    [m] a point at the begin of that path.
    """

    x: float
    y: float
    gain: float
    length: float
    clearance: float
    first: Point


@dataclass(frozen=True, slots=True)
class UnseenGround:
    """What unseen ground is taken for on the way to ``goal`` (x, y) [m], by the map's ``plan``."""

    goal: Point
    plan: OccupancyMap | None

    def corners(self, at: Point) -> Array:
        """Return the corners (2, 2: x, y) [m] of the ground to search from ``at`` (x, y) [m]."""
        ends = np.array([at, self.goal])
        return np.stack([ends.min(axis=0) - _AROUND, ends.max(axis=0) + _AROUND])

    def prices(self, points: Array, radius: float) -> Array:
        """Return prices (n,) of unseen cells at ``points`` (n, 2) [m] for a robot of ``radius``."""
        if self.plan is None:
            return np.full(len(points), _UNKNOWN)
        around = radius * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
        states = np.stack([self.plan.state(points + offset) for offset in around])
        prices = np.where(states[0] == FREE, _FREE, _OFF_PLAN)
        return np.where((states == OCCUPIED).any(axis=0), _WALL, prices)


@dataclass(frozen=True, slots=True)
class KnownGround:
    """A grown grid, reduced to cells of twice the size; all arrays are (rows, columns).

    ``price`` is that of crossing a cell, infinite where the body may not go. ``origin`` [m] is the
    centre of cell [0, 0], ``clearance`` [m] that from the body's rim to what is occupied.
    """

    origin: Point
    cell: float
    price: Array
    clearance: Array
    unseen: Mask
    occupied: Mask

    @classmethod
    def of(
        cls, grid: GrownGrid, robot: RobotModel, at: Point, hopes: UnseenGround | None = None
    ) -> Self:
        """Make the ground of ``grid`` for a robot ``at`` (x, y) [m].

        With ``hopes`` unseen ground is passable too, at the prices that they give.
        """
        if hopes is None:
            rows, columns = bounds(grid.log_odds != 0)
            border = round(_BORDER / grid.cell)
            low = np.array([rows.start, columns.start]) - border
            high = np.array([rows.stop, columns.stop]) + border
        else:
            low, high = grid.cells_at(hopes.corners(at))
        free, occupied = (_cut(mask, low, high) for mask in (grid.free, grid.occupied))
        x0, y0 = (grid.centres(low[None])[0]).tolist()
        origin = (x0, y0)
        known = without_specks(free, occupied, _SPECK / grid.cell**2)
        apart = distances(occupied, grid.cell)
        everywhere = np.ones(known.shape, np.uint8)
        price = price_cells(apart, everywhere, robot.radius, CLEAR, MARGIN, 0.0)
        known_half = known[::2, ::2]
        price[~known_half] = math.inf
        cell = 2.0 * grid.cell
        y, x = np.ogrid[: price.shape[0], : price.shape[1]]
        away = np.hypot(origin[0] + cell * x - at[0], origin[1] + cell * y - at[1])
        price[(away <= _STANDING) & np.isinf(price) & known_half] = _STANDING_PRICE
        price[away <= cell] = np.minimum(price[away <= cell], _STANDING_PRICE)
        walls = cv2.dilate(occupied.view(np.uint8), np.ones((3, 3), np.uint8))[::2, ::2] > 0
        rim = apart[::2, ::2] - robot.radius
        unseen = ~known_half & ~walls
        if hopes is not None:
            fits = unseen & (rim >= MARGIN)
            cells = np.argwhere(fits)
            price[fits] = hopes.prices(cells[:, ::-1] * cell + origin, robot.radius)
        return cls(origin, cell, price, rim, unseen, walls)

    def index(self, x: float, y: float) -> tuple[int, int]:
        """Return (row, column) of the point (x, y) [m], within the grid."""
        rows, columns = self.price.shape
        row = math.floor((y - self.origin[1]) / self.cell + 0.5)
        column = math.floor((x - self.origin[0]) / self.cell + 0.5)
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)

    def points(self, cells: Array | Indices) -> Array:
        """Return the centres (n, 2) [m] of ``cells`` (n, 2: row, column)."""
        centres: Array = np.asarray(cells[:, ::-1] * self.cell + self.origin, dtype=np.float64)
        return centres

    def costs_from(self, x: float, y: float) -> Array:
        """Compute the cost [cells, priced] of the path to each cell from (x, y) [m, map]."""
        value = np.full(self.price.shape, np.inf)
        value[self.index(x, y)] = 0.0
        cost_to_go(self.price, value, _SWEEPS)
        return value

    def path_to(self, costs: Array, x: float, y: float) -> Array:
        """Return the path (n, 2) [m] to the point (x, y) [m] from where ``costs`` begin.

        It ends at the reachable cell nearest to the point; empty if there is none within a cell.
        """
        row, column = self.index(x, y)
        window = np.s_[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        around = costs[window]
        if not np.isfinite(around).any():
            return np.empty((0, 2))
        i, j = np.unravel_index(int(around.argmin()), around.shape)
        cells = np.empty((costs.size, 2), np.int64)
        count = steepest_path(costs, int(i) + max(row - 1, 0), int(j) + max(column - 1, 0), cells)
        return self.points(cells[count - 1 :: -1] if count > 1 else cells[:1])

    @property
    def known_area(self) -> float:
        """Area [m^2] of the floor on which the body is known to have room."""
        return int(np.isfinite(self.price).sum()) * self.cell**2

    def lengths_from(self, x: float, y: float) -> Array:
        """Compute the shortest path's length [m] to each cell from (x, y) [m, map]; else inf."""
        lengths = np.full(self.price.shape, np.inf)
        lengths[self.index(x, y)] = 0.0
        cost_to_go(np.where(np.isfinite(self.price), self.cell, np.inf), lengths, _SWEEPS)
        return lengths

    def length_at(self, lengths: Array, x: float, y: float) -> float:
        """Return the least of ``lengths`` at the point (x, y) [m] and the cells beside it."""
        row, column = self.index(x, y)
        return float(lengths[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].min())

    def sees(self, start: Point, end: Point, dearest: float) -> bool:
        """Return whether the body fits through the straight line of two points [m].

        No cell on it may cost more than ``dearest``.
        """
        first = np.array(self.origin)
        begin, last = (np.array(point) - first for point in (start, end))
        ends = begin[::-1] / self.cell, last[::-1] / self.cell
        return bool(free_line(self.price, ends[0], ends[1], dearest))

    def way(self, path: Array, at: Point, end: Waypoint, lookahead: float) -> list[Waypoint]:
        """Return the corners of a ``path`` (n, 2) [m] from ``at`` on, and then its ``end``.

        Each is the farthest point, up to ``lookahead`` [m], that a straight line reaches. The line
        costs no more than the path; no corner is where the robot is but the last point.
        """
        points = [*map(tuple, path.tolist()), (end.x, end.y)]
        corners, index = [at], 0
        while index < len(points) - 1:
            index = self._farthest(points, index, corners[-1], lookahead)
            corners.append(points[index])
        between = [replace(end, x=x, y=y, kind="waypoint", final=False) for x, y in corners[1:-1]]
        return [*between, end]

    def _farthest(self, points: Sequence[Point], begin: int, at: Point, lookahead: float) -> int:
        best, dearest = 0, _PRICE
        for ahead in range(begin + 1, len(points)):
            away = math.dist(at, points[ahead])
            if best and away > lookahead:
                break
            price = float(self.price[self.index(*points[ahead])])
            dearest = max(dearest, price if math.isfinite(price) else _PRICE)
            if away >= MIN_AHEAD and (not best or self.sees(at, points[ahead], dearest)):
                best = ahead
        return best or len(points) - 1

    def room_at(self, points: Array) -> Array:
        """Return the clearances (n,) [m] beside the body at ``points`` (n, 2) [m]."""
        cells = np.array([self.index(x, y) for x, y in points.tolist()])
        rooms: Array = self.clearance[cells[:, 0], cells[:, 1]]
        return rooms

    def frontiers(self, costs: Array) -> list[Frontier]:
        """Find the pieces of the border of the ground that ``costs`` show to be reachable."""
        reached = np.isfinite(costs)
        beside = cv2.dilate(
            reached.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        )
        border = self.unseen & (beside > 0) & (self.clearance >= MARGIN)
        _, labels = cv2.connectedComponents(border.view(np.uint8), connectivity=8)
        cells = np.argwhere(border)
        side = round(_PIECE / self.cell)
        keys = np.column_stack([labels[border], cells // side])
        _, piece = np.unique(keys, axis=0, return_inverse=True)
        middles = [_middle(cells[piece == k]) for k in range(int(piece.max(initial=-1)) + 1)]
        if not middles:
            return []
        at = np.array(middles)
        reach = _VIEW / self.cell
        gains = unseen_in_view(self.unseen, self.occupied, at, reach, 1.0, _RAYS) * self.cell**2
        points = self.points(at)
        return [
            self._frontier(costs, x, y, gain)
            for (x, y), gain in zip(points.tolist(), gains.tolist(), strict=True)
        ]

    def _frontier(self, costs: Array, x: float, y: float, gain: float) -> Frontier:
        path = self.path_to(costs, x, y)
        ahead = path[min(len(path) - 1, round(0.5 / self.cell))]
        length = float(np.hypot(*np.diff(path, axis=0).T).sum()) + math.dist(path[-1], (x, y))
        clearance = float(self.room_at(path[min(len(path) - 1, 3) :]).min())
        return Frontier(x, y, gain, length, clearance, (float(ahead[0]), float(ahead[1])))


def without_spots(grid: GrownGrid) -> GrownGrid:
    """Return ``grid`` with small occupied spots as unseen: one may be an error, worth another look.

    A false spot in a doorway closes a room.
    """
    labels, small = small_spots(grid.occupied, _SPOT / grid.cell**2, 8)
    evidence = grid.log_odds.copy()
    evidence[small[labels]] = 0
    return GrownGrid(evidence, grid.origin, grid.cell)


def with_thin_walls(grid: GrownGrid) -> GrownGrid:
    """Return ``grid`` with the bands before the surfaces of walls as free.

    The bands of its two sides close a narrow doorway that the body fits through.
    """
    evidence = grid.log_odds.copy()
    evidence[grid.occupied & (sharpened(evidence, continuous=True) <= FREE_BELOW)] = FREE_BELOW
    return GrownGrid(evidence, grid.origin, grid.cell)


def without_specks(free: Mask, occupied: Mask, largest: float) -> Mask:
    """Return the ``free`` cells with gaps between rays, and unseen specks amid them, filled.

    A speck has at most ``largest`` cells.
    """
    closed = without_gaps(free)
    unseen = ~closed & ~occupied
    labels, small = small_spots(unseen, largest, 4)
    filled: Mask = (closed | small[labels]) & ~occupied
    return filled


def steady(before: Waypoint | None, ahead: Waypoint, at: Point) -> Waypoint:
    """Return ``before`` if the new waypoint ``ahead`` is hardly another; the robot is ``at``.

    This keeps MOFIS' watch on progress, and the path of the local planner.
    """
    if before is None or before.final or ahead.final:
        return ahead
    moved = math.dist((ahead.x, ahead.y), (before.x, before.y))
    near = math.dist((before.x, before.y), at) <= MIN_AHEAD
    return ahead if near or moved >= _HELD else before


def _cut(mask: Mask, low: Indices, high: Indices) -> Mask:
    """Return the cells of ``mask`` from ``low`` to ``high`` (row, column); False outside it."""
    out = np.zeros(high - low, dtype=np.bool_)
    first, last = np.maximum(low, 0), np.minimum(high, mask.shape)
    if (last > first).all():
        (top, left), (bottom, right) = first - low, last - low
        out[top:bottom, left:right] = mask[first[0] : last[0], first[1] : last[1]]
    return out


def _middle(cells: Indices) -> tuple[int, int]:
    """Return the cell of ``cells`` (n, 2) that is nearest to their mean."""
    mean = cells.sum(axis=0) / len(cells)
    nearest = int(((cells - mean) ** 2).sum(axis=1).argmin())
    return int(cells[nearest, 0]), int(cells[nearest, 1])
