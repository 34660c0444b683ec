"""The true geometry of a world in the plane, for metrics, plots and checks; not for the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from navfw.errors import WorldError
from navfw.numerics import Array, Mask
from navfw.numerics.arrays import Indices
from navfw.sim.solids import Solid, drop_rectangle, solids_of
from navfw.sim.worldspec import WorldSpec

CELL = 0.05
"""Edge of a cell of the search grid [m]."""
_MOVES = {
    (0, 1): (),
    (1, 0): (),
    (1, 1): ((0, 1), (1, 0)),
    (1, -1): ((0, -1), (1, 0)),
    (1, 2): ((0, 1), (1, 1)),
    (1, -2): ((0, -1), (1, -1)),
    (2, 1): ((1, 0), (1, 1)),
    (2, -1): ((1, 0), (1, -1)),
}
"""Straight, diagonal and knight's moves by rows and columns, with the cells that each passes. With
their opposites, they are 16 directions of the search."""


@dataclass(frozen=True, slots=True)
class ConfigurationSpaceGrid:
    """Grid of positions of a disc-shaped robot's centre; ``occupied`` (rows, columns) collide.

    Row 0 is at the lowest y, column 0 at the lowest x; cell (i, j) has its centre at ``origin + (j
    + 0.5, i + 0.5) * cell`` [m].
    """

    origin: tuple[float, float]
    cell: float
    occupied: Mask

    def centres(self, rows: Indices, columns: Indices) -> Array:
        """Centres (N, 2) [m] of the cells in these ``rows`` and ``columns`` (N,)."""
        x = self.origin[0] + (columns + 0.5) * self.cell
        y = self.origin[1] + (rows + 0.5) * self.cell
        return np.stack([x, y], axis=1)


@dataclass(frozen=True, slots=True)
class DistanceField:
    """Lengths [m] of the shortest paths from each cell to one goal: ``lengths`` (rows, columns)."""

    grid: ConfigurationSpaceGrid
    lengths: Array

    def at(self, x: float, y: float) -> float:
        """Return the length [m] from x, y [m, map], interpolated between cells; exact to 2 %."""
        (x0, y0), cell, (rows, columns) = self.grid.origin, self.grid.cell, self.lengths.shape
        up = min(max((y - y0) / cell - 0.5, 0.0), rows - 1.0)
        right = min(max((x - x0) / cell - 0.5, 0.0), columns - 1.0)
        i, j = min(int(up), rows - 2), min(int(right), columns - 2)
        (a, b), (c, d) = self.lengths[i : i + 2, j : j + 2].tolist()
        low, high = a + (right - j) * (b - a), c + (right - j) * (d - c)
        return float(low + (up - i) * (high - low))


class SceneGeometry:
    """Outlines of solids at the robot's height and of drops, in ``bounds`` (x0, y0, x1, y1) [m].

    ``doors`` are the names and widths [m] of the gaps in walls.
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        solids: tuple[Solid, ...],
        doors: tuple[tuple[str, float], ...] = (),
    ) -> None:
        self.bounds = bounds
        self.solids = solids
        self.doors = doors
        self._graphs: dict[float, tuple[ConfigurationSpaceGrid, Indices, object]] = {}
        self._fields: dict[tuple[float, float, float], DistanceField] = {}

    @classmethod
    def from_world(cls, world: WorldSpec, robot_height: float = 0.4) -> SceneGeometry:
        """Make the plan of a valid world: its solids between the floor and ``robot_height`` [m].

        Drops are included like solids: the robot cannot stand there either.
        """
        solids = [s for s in solids_of(world) if s.bottom < robot_height and s.top > 0.0]
        solids += [Solid(drop.name, "drop", drop_rectangle(drop)) for drop in world.drops]
        doors = tuple((gap.name, gap.width) for wall in world.walls for gap in wall.openings)
        return cls((world.x[0], world.y[0], world.x[1], world.y[1]), tuple(solids), doors)

    # --- clearance ----------------------------------------------------------------------------

    def clearances(self, points: Array) -> Array:
        """Return the distance (N,) [m] of points (N, 2) to the nearest solid; negative inside one.

        It is inf in a world without solids. The edge of the floor does not count.
        """
        nearest = np.full(len(points), np.inf)
        for solid in self.solids:
            np.minimum(nearest, solid.shape.distance(points), out=nearest)
        return nearest

    def near_clearances(self, x: Array, y: Array, reach: float) -> Array:
        """Clearance (len(y), len(x)) [m] at the points of a grid, at most ``reach`` [m].

        ``x`` and ``y`` must ascend. Each solid is compared only with the points near it.
        """
        nearest = np.full((len(y), len(x)), reach)
        for solid in self.solids:
            x0, y0, x1, y1 = solid.shape.bounds
            columns = slice(*np.searchsorted(x, (x0 - reach, x1 + reach)))
            rows = slice(*np.searchsorted(y, (y0 - reach, y1 + reach)))
            points = np.stack(np.meshgrid(x[columns], y[rows]), axis=-1).reshape(-1, 2)
            window = nearest[rows, columns]
            np.minimum(window, solid.shape.distance(points).reshape(window.shape), out=window)
        return nearest

    def clearance(self, x: float, y: float) -> float:
        """Return the distance [m] of a point [m, map] to the nearest solid."""
        return float(self.clearances(np.array([[x, y]]))[0])

    def nearest_name(self, x: float, y: float) -> str:
        """Return the name of the solid nearest to the point x, y [m, map]; "" if there is none."""
        point = np.array([[x, y]])
        distances = [float(s.shape.distance(point)[0]) for s in self.solids]
        return self.solids[int(np.argmin(distances))].name if distances else ""

    def check_free(self, x: float, y: float, radius: float, what: str) -> None:
        """Check that a disc of ``radius`` [m] is free at x, y [m, map]; ``what`` begins errors.

        Raises:
            WorldError: the disc overlaps a solid, or leaves the floor.

        """
        x0, y0, x1, y1 = self.bounds
        if not (x0 + radius <= x <= x1 - radius and y0 + radius <= y <= y1 - radius):
            raise WorldError(
                f"{what} ({x:g}, {y:g}) must lie on the floor, x {x0:g} to {x1:g} and y {y0:g} to"
                f" {y1:g} m, at least the robot's radius {radius:g} m from its edge"
            )
        free = self.clearance(x, y)
        if free < radius:
            raise WorldError(
                f"{what} ({x:g}, {y:g}) is {free:.2f} m from {self.nearest_name(x, y)!r},"
                f" the robot needs {radius:g} m: choose a freer place"
            )

    def configuration_space(
        self, radius: float = 0.0, cell: float = CELL
    ) -> ConfigurationSpaceGrid:
        """Grid of cells of ``cell`` [m]; occupied where a disc of ``radius`` [m] does not fit."""
        x0, y0, x1, y1 = self.bounds
        columns, rows = math.ceil((x1 - x0) / cell - 1e-9), math.ceil((y1 - y0) / cell - 1e-9)
        x = x0 + (np.arange(columns, dtype=np.float64) + 0.5) * cell
        y = y0 + (np.arange(rows, dtype=np.float64) + 0.5) * cell
        outside = np.logical_or.outer(
            (y < y0 + radius) | (y > y1 - radius), (x < x0 + radius) | (x > x1 - radius)
        )
        occupied = (self.near_clearances(x, y, radius + cell) < radius) | outside
        return ConfigurationSpaceGrid((x0, y0), cell, occupied)

    # --- shortest paths -----------------------------------------------------------------------

    def shortest_path(
        self, start: tuple[float, float], goal: tuple[float, float], radius: float
    ) -> tuple[float, Array]:
        """Return length [m] and corners (N, 2) [m] of the shortest path for ``radius`` [m].

        Dijkstra's search on a 5 cm grid, then shortened; within about 1 % of the true length
        (test_sim_scene_geometry). Gaps less than a cell wider than the robot may be missed.

        Raises:
            WorldError: an end is not free, or there is no path between them.

        """
        self.check_free(*start, radius, "the start")
        self.check_free(*goal, radius, "the goal")
        ends = np.array([start, goal])
        if self.straight_path_free(ends[0], ends[1], radius):
            return math.dist(start, goal), ends
        path = np.vstack([start, self._grid_path(start, goal, radius), goal])
        path = self._shortened(path, radius)
        return _length(path), path

    def distance_field(self, goal: tuple[float, float], radius: float) -> DistanceField:
        """Lengths of the shortest paths to ``goal`` for a robot of ``radius`` [m]; cached.

        Raises:
            WorldError: the robot is too large for this world.

        """
        from scipy.ndimage import distance_transform_edt
        from scipy.sparse.csgraph import dijkstra

        if (*goal, radius) in self._fields:
            return self._fields[*goal, radius]
        grid, numbers, graph = self._search_graph(radius)
        lengths = np.full(numbers.shape, np.inf)
        goal_cell = _free_cell(grid, numbers, *goal)
        lengths[numbers >= 0] = dijkstra(graph, directed=False, indices=goal_cell)
        # a cell from which no way leads takes the value of the nearest one with a way
        rows, columns = distance_transform_edt(
            ~np.isfinite(lengths), return_distances=False, return_indices=True
        )
        field = self._fields[*goal, radius] = DistanceField(grid, lengths[rows, columns])
        return field

    def _grid_path(
        self, start: tuple[float, float], goal: tuple[float, float], radius: float
    ) -> Array:
        from scipy.sparse.csgraph import dijkstra

        grid, numbers, graph = self._search_graph(radius)
        first, last = (_free_cell(grid, numbers, *end) for end in (start, goal))
        lengths, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
        if not np.isfinite(lengths[last]):
            need = 2.0 * radius
            narrow = [f"{n!r} ({w:g} m)" for n, w in self.doors if w < need + CELL]
            also = f"; too narrow: {', '.join(narrow)}" if narrow else ""
            raise WorldError(
                f"the goal ({goal[0]:g}, {goal[1]:g}) cannot be reached from"
                f" ({start[0]:g}, {start[1]:g}) by a robot of radius {radius:g} m:"
                f" no path is {need:g} m wide{also}; take a narrower robot, or open a wider path"
            )
        way = [last]
        while way[-1] != first:
            way.append(int(before[way[-1]]))
        rows, columns = np.nonzero(numbers >= 0)
        cells = np.array(way[::-1])
        return grid.centres(rows[cells], columns[cells])

    def _search_graph(self, radius: float) -> tuple[ConfigurationSpaceGrid, Indices, object]:
        """The grid, the index of each free cell (-1: occupied), and the graph between them."""
        if radius not in self._graphs:
            grid = self.configuration_space(radius)
            free = ~grid.occupied
            numbers = np.full(free.shape, -1, dtype=np.int64)
            numbers[free] = np.arange(np.count_nonzero(free))
            self._graphs[radius] = (grid, numbers, _grid_graph(numbers, grid.cell))
        return self._graphs[radius]

    def straight_path_free(self, a: Array, b: Array, radius: float) -> bool:
        """Whether a disc of ``radius`` [m] is free on the line from a to b (tested every 1 cm)."""
        steps = max(int(np.ceil(math.dist(a, b) / 0.01)), 1)
        points = a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a)
        low, high = np.minimum(a, b) - radius, np.maximum(a, b) + radius
        near = (self._bounds[:, :2] <= high) & (self._bounds[:, 2:] >= low)
        # tolerance of 0.5 mm: shortest paths touch the corners of solids
        return all(
            (self.solids[index].shape.distance(points) >= radius - 5e-4).all()
            for index in np.flatnonzero(near.all(axis=1)).tolist()
        )

    @cached_property
    def _bounds(self) -> Array:
        """(n, 4) the boxes x0, y0, x1, y1 [m] around all solids."""
        return np.array([solid.shape.bounds for solid in self.solids]).reshape(-1, 4)

    def _shortened(self, path: Array, radius: float) -> Array:
        """Shorten a path until it no longer gets shorter: resample it, cut its corners, repeat."""
        for _ in range(6):
            before = _length(path)
            path = self._cut_corners(_resample(path, 0.1), radius)
            if before - _length(path) < 1e-3:
                break
        return path

    def _cut_corners(self, path: Array, radius: float) -> Array:
        """Replace parts of the path by straight lines, each as far as it is free."""
        kept = [0]
        while kept[-1] < len(path) - 1:
            corner = kept[-1]
            low, high = corner + 1, len(path) - 1
            # exponential, then binary search: free lines are nearly always a prefix of the path
            reach = 1
            while corner + reach <= high and self.straight_path_free(
                path[corner], path[corner + reach], radius
            ):
                low, reach = corner + reach, reach * 2
            high = min(high, corner + reach)
            while low < high:
                middle = (low + high + 1) // 2
                if self.straight_path_free(path[corner], path[middle], radius):
                    low = middle
                else:
                    high = middle - 1
            kept.append(low)
        return path[kept]


def _free_cell(grid: ConfigurationSpaceGrid, numbers: Indices, x: float, y: float) -> int:
    """Index of the free cell nearest to a point [m]."""
    rows, columns = np.nonzero(numbers >= 0)
    if rows.size == 0:
        raise WorldError("the robot is too large for this world")
    away = np.linalg.norm(grid.centres(rows, columns) - (x, y), axis=1)
    return int(away.argmin())


def _grid_graph(numbers: Indices, cell: float) -> object:
    """The undirected graph (sparse matrix of lengths [m]) between neighbouring free cells."""
    from scipy.sparse import coo_array

    rows, columns = numbers.shape
    sources, targets, lengths = [], [], []
    for (di, dj), beside in _MOVES.items():
        height, width = rows - di, columns - abs(dj)
        left = max(-dj, 0)
        source = numbers[:height, left : left + width]
        target = numbers[di : di + height, left + dj : left + dj + width]
        both = (source >= 0) & (target >= 0)
        # a move must not cut through an occupied cell beside it
        for bi, bj in beside:
            both &= numbers[bi : bi + height, left + bj : left + bj + width] >= 0
        sources.append(source[both])
        targets.append(target[both])
        lengths.append(np.full(np.count_nonzero(both), cell * math.hypot(di, dj)))
    count = int(numbers.max()) + 1
    data = (np.concatenate(lengths), (np.concatenate(sources), np.concatenate(targets)))
    return coo_array(data, shape=(count, count)).tocsr()


def _length(path: Array) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _resample(path: Array, spacing: float) -> Array:
    """Return the same path with a point at least every ``spacing`` [m]."""
    parts = []
    for a, b in pairwise(path):
        count = max(int(np.ceil(math.dist(a, b) / spacing)), 1)
        parts.append(a + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (b - a))
    return np.vstack([*parts, path[-1:]])
