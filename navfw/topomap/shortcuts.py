"""A graph of few points whose paths are nearly as short as the shortest ones.

Lines midway between obstacles lead far round in wide ground, and have many points. The shortest
paths follow straight lines from corner to corner of the obstacles (visibility graph; Lozano-Perez
and Wesley 1979). Of these lines only those are taken without which a path between two of the points
that matter would be too long (greedy spanner; Althofer et al. 1993).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import cv2
import networkx as nx
import numpy as np
from scipy.sparse.csgraph import dijkstra

from navfw.numerics import Array, Mask
from navfw.topomap.clearance_grid import ClearanceGrid

_STRETCH = 1.05  # chosen
"""Largest length of a path in the graph, over that of the shortest one with ``_COMFORT``."""

_LAST_STRETCH = 1.2  # chosen
"""Such a factor for paths from and to points used only because paths lead over them."""

_HALL_STRETCH = 2.0  # chosen
"""Such a factor for paths over a point in a hall that is none of those that matter."""

_COMFORT = 0.45  # chosen
"""Clearance [m] of lines that are not lines of the given graph."""

_MAX_CORNERS = 600  # chosen
"""Largest number of corners considered: those of the largest obstacles."""

Point = tuple[float, float]
Segment = tuple[Point, Point]


def spanner(
    graph: nx.Graph,
    keys: list[int],
    grid: ClearanceGrid,
    doors: Mapping[int, Segment],
    in_hall: Callable[[Point], bool],
) -> nx.Graph:
    """Build a sparser graph that connects ``keys``, points of ``graph``, by short straight edges.

    ``graph`` is connected, its points have ``at`` (x, y) [m]. Of its other points, and of corners
    of obstacles, only those are taken that short paths need. ``doors`` are segments [m] by their
    points, which only the given edges at that point cross; those edges stay. Points ``in_hall`` are
    taken only if paths would be long without them.
    """
    points = list(graph)
    at = np.array([graph.nodes[point]["at"] for point in points]).reshape(-1, 2)
    nodes = np.vstack([at, _corners(grid)])
    index = {point: number for number, point in enumerate(points)}
    lengths = _visible_lengths(nodes, grid, list(doors.values()))
    for door in doors:
        lengths[index[door], :] = lengths[:, index[door]] = np.inf
    for a, b in graph.edges:
        i, j = index[a], index[b]
        lengths[i, j] = lengths[j, i] = max(math.dist(nodes[i], nodes[j]), 1e-6)
    first = [index[key] for key in keys]
    spanned = _Spanner(nodes, points)
    for door in doors:
        for beside in graph[door]:
            spanned.connect(index[door], index[beside])
    hall = np.array([in_hall(node) for node in nodes.tolist()])
    spanned.add(first, _without(lengths, hall, first))
    spanned.add(first, lengths, _HALL_STRETCH)
    size = 0
    while size < len(spanned.graph):  # ways from and to the points between
        size, taken = len(spanned.graph), spanned.numbers
        spanned.add(taken, _without(lengths, hall, taken), _LAST_STRETCH)
    return spanned.graph


def _without(lengths: Array, nodes: Mask, kept: list[int]) -> Array:
    """Return lengths (N, N) [m] without lines from and to ``nodes``, except those ``kept``."""
    gone = nodes.copy()
    gone[kept] = False
    return np.where(gone | gone[:, None], np.inf, lengths)


class _Spanner:
    """A growing graph of some of the ``nodes`` (N, 2) [m], and the lengths of all its paths.

    ``points`` are the numbers of the first nodes in the graph; the others get further ones.
    """

    def __init__(self, nodes: Array, points: list[int]) -> None:
        self.graph = nx.Graph()
        self._nodes = nodes
        self._points = [*points, *range(max(points) + 1, max(points) + 1 + len(nodes))]
        self._ways = np.full((len(nodes), len(nodes)), np.inf)
        np.fill_diagonal(self._ways, 0.0)

    @property
    def numbers(self) -> list[int]:
        """Numbers of the nodes in the graph."""
        return [number for number, point in enumerate(self._points) if point in self.graph]

    def add(self, keys: list[int], lengths: Array, stretch: float = _STRETCH) -> None:
        """Add shortest paths between ``keys`` that are too long in the graph, short ones first.

        ``lengths`` (N, N) [m] are those of the lines between nodes, inf where there is none.
        """
        for key in keys:
            self._add_node(key)
        shortest, before = dijkstra(
            np.where(np.isfinite(lengths), lengths, 0.0),
            directed=False,
            indices=keys,
            return_predecessors=True,
        )
        between = shortest[:, keys]
        pairs = np.argwhere(np.triu(np.isfinite(between), 1))
        order = np.argsort(between[pairs[:, 0], pairs[:, 1]], kind="stable")
        for row, column in pairs[order].tolist():
            start, node = keys[row], keys[column]
            if self._ways[start, node] <= stretch * between[row, column]:
                continue
            while node != start:
                previous = int(before[row, node])
                self.connect(previous, node)
                node = previous

    def connect(self, i: int, j: int) -> None:
        """Add the edge between two nodes."""
        a, b = self._add_node(i), self._add_node(j)
        if self.graph.has_edge(a, b):
            return
        self.graph.add_edge(a, b)
        ways, length = self._ways, math.dist(self._nodes[i], self._nodes[j])
        connected = np.flatnonzero(np.isfinite(ways[i]) | np.isfinite(ways[j]))
        pairs = np.ix_(connected, connected)
        through = ways[connected, i, None] + length + ways[None, j, connected]
        ways[pairs] = np.minimum(ways[pairs], np.minimum(through, through.T))

    def _add_node(self, number: int) -> int:
        point: int = self._points[number]
        x, y = self._nodes[number]
        self.graph.add_node(point, at=(float(x), float(y)))
        return point


def _corners(grid: ClearanceGrid) -> Array:
    """Find points (N, 2) [m] at the corners of obstacles, ``_COMFORT`` from them."""
    ground = (grid.clearance >= _COMFORT + 0.5 * grid.cell).astype(np.uint8)
    outlines, _ = cv2.findContours(ground, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    corners: list[tuple[float, float]] = []
    for outline in sorted(outlines, key=len, reverse=True):
        polygon = cv2.approxPolyDP(outline, 0.1 / grid.cell, closed=True)[:, 0].astype(np.float64)
        before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, 0) - polygon
        # what is not free lies to the left of an outline: a turn to the left goes round a corner
        left = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > 0.0
        corners += [grid.point(row, column) for column, row in polygon[left].tolist()]
    return np.array(corners[:_MAX_CORNERS]).reshape(-1, 2)


def _visible_lengths(nodes: Array, grid: ClearanceGrid, closed: list[Segment]) -> Array:
    """Compute distances (N, N) [m] of nodes with a clear straight line between them, else inf."""
    lengths = np.full((len(nodes), len(nodes)), np.inf)
    for i in range(len(nodes) - 1):
        others = nodes[i + 1 :]
        clear = _clear(nodes[i], others, grid)
        for segment in closed:
            clear &= ~_crosses(nodes[i], others, segment)
        span = np.linalg.norm(others - nodes[i], axis=1)
        lengths[i, i + 1 :] = lengths[i + 1 :, i] = np.where(clear & (span > 0.0), span, np.inf)
    return lengths


def _clear(start: Array, ends: Array, grid: ClearanceGrid) -> Mask:
    """Return which lines from ``start`` to ``ends`` (N, 2) [m] have ``_COMFORT`` everywhere."""
    spans = np.linalg.norm(ends - start, axis=1)
    clear = np.ones(len(ends), dtype=np.bool_)
    step = grid.cell
    # from the start outwards, in blocks: most lines end soon
    for near in np.arange(0.0, float(spans.max(initial=0.0)) + step, 64 * step):
        alive = np.flatnonzero(clear & (spans >= near))
        if alive.size == 0:
            break
        along = np.minimum(near + np.arange(64) * step, spans[alive, None])
        units = (ends[alive] - start) / np.maximum(spans[alive, None], 1e-9)
        points = start + along[..., None] * units[:, None, :]
        clear[alive] &= (grid.at_points(points) >= _COMFORT - 0.02).all(axis=1)
    return clear


def _crosses(start: Array, ends: Array, segment: Segment) -> Mask:
    a, b = np.array(segment[0]), np.array(segment[1])

    def side(p: Array, q: Array, r: Array) -> Array:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    apart = side(a, b, start) * side(a, b, ends) <= 0.0
    return apart & (side(start, ends, a) * side(start, ends, b) <= 0.0)
