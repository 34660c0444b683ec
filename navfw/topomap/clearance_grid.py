"""The clearance grid of a world, and the skeleton of its free space as a graph."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import networkx as nx
import numpy as np

from navfw.numerics import Array, Mask

_EXACT = 1.0  # chosen
"""Distances up to this [m] are exact: they decide on doors and free widths."""

_MAX_COLUMN = 1.5  # chosen
"""Largest width and depth [m] of a column: a free-standing obstacle that makes no rooms."""


@dataclass(frozen=True, slots=True)
class ClearanceGrid:
    """Distances to the nearest obstacle: ``clearance`` (rows, cols) [m], negative inside one.

    The centre of cell (i, j) is at ``origin + (j, i) * cell`` [m].
    """

    origin: tuple[float, float]
    cell: float
    clearance: Array

    @classmethod
    def of(
        cls,
        bounds: tuple[float, float, float, float],
        near_clearances: Callable[[Array, Array, float], Array],
        cell: float = 0.05,
    ) -> ClearanceGrid:
        """Compute the grid within ``bounds`` (x0, y0, x1, y1) [m]; the boundary counts as a wall.

        ``near_clearances`` returns the distances (len(y), len(x)) [m] to the nearest obstacle at
        the points of a grid with these x and y [m], at most its third argument [m]. Distances above
        1 m are those between cells, to half a cell.
        """
        x0, y0, x1, y1 = bounds
        x = np.arange(x0 + 0.5 * cell, x1, cell)
        y = np.arange(y0 + 0.5 * cell, y1, cell)
        near = near_clearances(x, y, _EXACT)
        apart = cv2.distanceTransform((near > 0.0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        far = np.maximum((apart.astype(np.float64) - 0.5) * cell, _EXACT)
        clearance = np.where(near < _EXACT, near, far)
        edge = np.minimum.outer(np.minimum(y - y0, y1 - y), np.minimum(x - x0, x1 - x))
        return cls((float(x[0]), float(y[0])), cell, np.minimum(clearance, edge))

    def without_columns(self) -> ClearanceGrid:
        """Return the grid without columns; clearances that grow by that are to half a cell."""
        solid = np.pad(self.clearance < 0.5 * self.cell, 1, constant_values=True)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(solid.astype(np.uint8))
        extent = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) * self.cell
        free = (~solid | (extent <= _MAX_COLUMN)[labels]).astype(np.uint8)
        away = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]
        clearance = (away.astype(np.float64) - 0.5) * self.cell
        larger = clearance > self.clearance + self.cell
        return replace(self, clearance=np.where(larger, clearance, self.clearance))

    def point(self, row: float, column: float) -> tuple[float, float]:
        """Return the centre (x, y) [m] of a cell."""
        return self.origin[0] + column * self.cell, self.origin[1] + row * self.cell

    def at(self, x: float, y: float) -> float:
        """Return the clearance [m] at a point (x, y) [m], of the nearest cell; 0 off the grid."""
        row = round((y - self.origin[1]) / self.cell)
        column = round((x - self.origin[0]) / self.cell)
        rows, columns = self.clearance.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return float(self.clearance[row, column]) if inside else 0.0

    def along(self, a: tuple[float, float], b: tuple[float, float]) -> float:
        """Return the least clearance [m] on the straight line between two points [m]."""
        count = max(math.ceil(math.dist(a, b) / (0.5 * self.cell)), 1)
        share = np.linspace(0.0, 1.0, count + 1)
        x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
        return float(self.at_points(np.stack([x, y], axis=1)).min())

    def at_points(self, points: Array) -> Array:
        """Return clearances (...) [m] at points (..., 2) [m]; off the grid those at its edge."""
        rows, columns = self.clearance.shape
        j = np.rint((points[..., 0] - self.origin[0]) / self.cell).astype(int)
        i = np.rint((points[..., 1] - self.origin[1]) / self.cell).astype(int)
        clearances: Array = self.clearance[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]
        return clearances


_SPUR = 1.6  # chosen
"""Largest length of a spur into a corner, over the clearance where it branches off."""

Cell = tuple[int, int]

_EDGES = ((-1, 0), (0, 1), (1, 0), (0, -1))  # defined
_CORNERS = ((-1, -1), (-1, 1), (1, 1), (1, -1))  # defined


_BITS = 1 << np.arange(8)  # defined
"""The weights of a cell's neighbours in its code, clockwise from the one above."""


def _removable(first: bool) -> Mask:
    """Return by code whether a cell goes in the first or second half of a step of thinning."""
    n = (np.arange(256)[:, None] & _BITS) > 0
    count = n.sum(axis=1)
    rises = (~n & np.roll(n, -1, axis=1)).sum(axis=1)
    up, right, down, left = n[:, 0], n[:, 2], n[:, 4], n[:, 6]
    if first:
        edge = (up & right & down) | (right & down & left)
    else:
        edge = (up & right & left) | (up & down & left)
    removable: Mask = (count >= 2) & (count <= 6) & (rises == 1) & ~edge
    return removable


_REMOVABLE = (_removable(True), _removable(False))


def skeleton_graph(grid: ClearanceGrid, clearance: float) -> nx.MultiGraph:
    """Trace the paths of a robot that keeps ``clearance`` [m]: lines midway between obstacles.

    Nodes have ``at`` (x, y) [m]; edges have ``line`` (n, 2) [m], from the node with the smaller
    number to the other. Spurs into the corners of rooms are removed.
    """
    graph = _traced(grid, thinned(grid.clearance >= clearance))
    while _remove_spurs(graph, grid):
        _merge_lines(graph)
    return graph


def _traced(grid: ClearanceGrid, skeleton: Mask) -> nx.MultiGraph:
    """Convert the skeleton to a graph: nodes are cells with other than two neighbours."""
    cells = _neighbours(skeleton)
    nodes = [cell for cell, near in cells.items() if len(near) != 2]
    numbers = {cell: number for number, cell in enumerate(nodes)}
    graph = nx.MultiGraph()
    graph.add_nodes_from((number, {"at": grid.point(*cell)}) for cell, number in numbers.items())
    visited: set[Cell] = set()
    for node in nodes:
        for first in cells[node]:
            path = _walk(cells, node, first, numbers)
            a, b = numbers[node], numbers[path[-1]]
            # each line is found from both ends; one between adjacent nodes has no cells of its own
            if path[1] in visited or path[-2] in visited or (len(path) == 2 and a > b):
                continue
            visited.update(path[1:-1])
            line = np.array([grid.point(*cell) for cell in path])
            graph.add_edge(a, b, line=line if a <= b else line[::-1])
    for cell in cells:  # the rest are closed rings
        if cell in visited or cell in numbers:
            continue
        numbers[cell] = len(numbers)
        path = _walk(cells, cell, cells[cell][0], numbers)
        visited.update(path)
        graph.add_node(numbers[cell], at=grid.point(*cell))
        line = np.array([grid.point(*path_cell) for path_cell in path])
        graph.add_edge(numbers[cell], numbers[cell], line=line)
    return graph


def _neighbours(skeleton: Mask) -> dict[Cell, list[Cell]]:
    """Find each cell's neighbours: by edge, or by corner if no edge neighbour connects the two."""
    rows, columns = np.nonzero(skeleton)
    inside = set(zip(rows.tolist(), columns.tolist(), strict=True))
    neighbours: dict[Cell, list[Cell]] = {}
    for i, j in sorted(inside):
        near = [(i + di, j + dj) for di, dj in _EDGES if (i + di, j + dj) in inside]
        near += [
            (i + di, j + dj)
            for di, dj in _CORNERS
            if (i + di, j + dj) in inside and not {(i + di, j), (i, j + dj)} & inside
        ]
        neighbours[i, j] = near
    return neighbours


def _walk(
    cells: dict[Cell, list[Cell]], start: Cell, first: Cell, stops: dict[Cell, int]
) -> list[Cell]:
    """Follow the cells from ``start`` through ``first`` to the next of ``stops``."""
    path = [start, first]
    while path[-1] not in stops:
        path.append(next(cell for cell in cells[path[-1]] if cell != path[-2]))
    return path


def _remove_spurs(graph: nx.MultiGraph, grid: ClearanceGrid) -> bool:
    """Remove the spurs that end in corners; returns whether there were any."""
    spurs = []
    for node in graph:
        if graph.degree(node) != 1:
            continue
        ((_, root, data),) = graph.edges(node, data=True)
        wide = grid.at(*graph.nodes[root]["at"])
        length = float(np.linalg.norm(np.diff(data["line"], axis=0), axis=1).sum())
        narrowing = grid.at(*graph.nodes[node]["at"]) < 0.6 * wide
        if narrowing and length < _SPUR * wide and graph.degree(root) > 1:
            spurs.append(node)
    graph.remove_nodes_from(spurs)
    return bool(spurs)


def _merge_lines(graph: nx.MultiGraph) -> None:
    for node in list(graph):
        around = list(graph.edges(node, data=True, keys=True))
        if len(around) != 2 or graph.degree(node) != 2:
            continue
        (_, a, _, first), (_, b, _, second) = around
        if node in (a, b):
            continue
        onward = first["line"] if a < node else first["line"][::-1]  # from a to the node
        back = second["line"] if node < b else second["line"][::-1]  # from the node to b
        line = np.vstack([onward, back[1:]])
        graph.remove_node(node)
        graph.add_edge(a, b, line=line if a <= b else line[::-1])


def thinned(mask: Mask) -> Mask:
    """Thin ``mask`` to a skeleton one cell wide, of equal connectivity (Zhang and Suen 1984).

    Only cells at the border can go, so only these, and those that a removal uncovers, are examined.
    """
    shape = np.pad(mask, 1).astype(np.uint8)
    flat, width = shape.ravel(), shape.shape[1]
    # the neighbours, clockwise from the one above
    around = np.array([-width, 1 - width, 1, width + 1, width, width - 1, -1, -width - 1])
    border = np.flatnonzero(flat)
    unchanged = 0
    while unchanged < len(_REMOVABLE):
        for removable in _REMOVABLE:
            codes = flat[border[:, None] + around] @ _BITS
            gone = border[removable[codes]]
            flat[gone] = 0
            unchanged = 0 if gone.size else unchanged + 1
            inner = codes == _BITS.sum()
            border = np.union1d(border[~inner], (gone[:, None] + around).ravel())
            border = border[flat[border] > 0]
    skeleton: Mask = shape[1:-1, 1:-1] > 0
    # parts that shrink to a square of 2 x 2 cells vanish: keep the innermost cell of each
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    for region in set(range(1, count)) - set(labels[skeleton].tolist()):
        depth = cv2.distanceTransform((labels == region).astype(np.uint8), cv2.DIST_L2, 3)
        skeleton[np.unravel_index(int(depth.argmax()), depth.shape)] = True
    return skeleton
