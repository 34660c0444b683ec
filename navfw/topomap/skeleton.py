"""The skeleton of free ground as a graph: where ways meet or end, and the lines between."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import networkx as nx
import numpy as np

from navfw.signals import Array, Mask
from navfw.topomap.ground import Ground, thinned

__all__ = ["skeleton_graph"]

SPUR = 1.6
"""Twigs into corners are at most so many times as long as the ground is wide where they begin."""

Cell = tuple[int, int]

_RING = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))


def skeleton_graph(ground: Ground, clearance: float) -> nx.MultiGraph:
    """Where a robot that keeps ``clearance`` [m] can go, as lines midway between the solids.

    Nodes have ``at`` (x, y) [m]; edges have ``line`` (n, 2) [m], from the node with the smaller
    number to the other. Twigs into the corners of rooms are taken off.
    """
    graph = _traced(ground, thinned(ground.clearance >= clearance))
    while _pruned(graph, ground):
        _joined(graph)
    return graph


def _traced(ground: Ground, skeleton: Mask) -> nx.MultiGraph:
    padded = np.pad(skeleton, 1).astype(np.int8)
    ring = [
        padded[1 + di : 1 + di + skeleton.shape[0], 1 + dj : 1 + dj + skeleton.shape[1]]
        for di, dj in _RING
    ]
    rises = np.sum([(ring[k] == 0) & (ring[(k + 1) % 8] == 1) for k in range(8)], axis=0)
    knots = skeleton & ((rises != 2) | (np.sum(ring, axis=0) > 3))
    count, labels = cv2.connectedComponents(knots.astype(np.uint8), connectivity=8)
    graph = nx.MultiGraph()
    for node in range(1, count):
        rows, columns = np.nonzero(labels == node)
        # the cell nearest to the middle of the cluster
        best = int(np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2))
        graph.add_node(node, at=ground.point(float(rows[best]), float(columns[best])))
    paths, members = cv2.connectedComponents((skeleton & ~knots).astype(np.uint8), connectivity=8)
    cells: dict[int, list[Cell]] = {path: [] for path in range(1, paths)}
    for row, column in zip(*(each.tolist() for each in np.nonzero(members)), strict=True):
        cells[int(members[row, column])].append((row, column))
    for path in cells.values():
        _add_path(graph, ground, path, labels)
    return graph


def _add_path(graph: nx.MultiGraph, ground: Ground, cells: list[Cell], labels: Array) -> None:
    """One line of the skeleton, from knot to knot; a ring without any gets one of its own."""
    inside = set(cells)
    touching = [cell for cell in cells if _knots_beside(cell, labels)]
    if not touching:
        ring = [ground.point(*cell) for cell in _walked(cells[0], inside)[1]]
        node = max(graph.nodes, default=0) + 1
        graph.add_node(node, at=ring[0])
        graph.add_edge(node, node, line=np.array([*ring, ring[0]]))
        return
    first = touching[0]
    came_from, reached = _walked(first, inside)
    last = max(touching, key=reached.index)
    way = [last]
    while (before := came_from[way[-1]]) is not None:
        way.append(before)
    b_options, a_options = (_knots_beside(cell, labels) for cell in (way[0], way[-1]))
    pairs = [(a, b) for a in a_options for b in b_options if a != b]
    if not pairs and len(way) < 3:
        return  # a bulge of one knot
    a, b = pairs[0] if pairs else (a_options[0], b_options[0])
    line = [ground.point(*cell) for cell in reversed(way)]
    line = [graph.nodes[a]["at"], *line, graph.nodes[b]["at"]]
    graph.add_edge(a, b, line=np.array(line if a <= b else line[::-1]))


def _walked(start: Cell, inside: set[Cell]) -> tuple[dict[Cell, Cell | None], list[Cell]]:
    """Where each cell is reached from, and all of them in the order of their distance."""
    came_from: dict[Cell, Cell | None] = {start: None}
    reached = [start]
    for cell in reached:
        for near in _beside(cell, inside):
            if near not in came_from:
                came_from[near] = cell
                reached.append(near)
    return came_from, reached


def _beside(cell: Cell, inside: set[Cell]) -> Iterator[Cell]:
    for di, dj in (*_RING[::2], *_RING[1::2]):  # straight neighbours first
        if (near := (cell[0] + di, cell[1] + dj)) in inside:
            yield near


def _knots_beside(cell: Cell, labels: Array) -> list[int]:
    rows, columns = labels.shape
    found = []
    for di, dj in _RING:
        i, j = cell[0] + di, cell[1] + dj
        if 0 <= i < rows and 0 <= j < columns and labels[i, j] and labels[i, j] not in found:
            found.append(int(labels[i, j]))
    return found


def _pruned(graph: nx.MultiGraph, ground: Ground) -> bool:
    """Take off the twigs that end in corners; whether there were any."""
    twigs = []
    for node in graph:
        if graph.degree(node) != 1:
            continue
        ((_, root, data),) = graph.edges(node, data=True)
        wide = ground.at(*graph.nodes[root]["at"])
        length = float(np.linalg.norm(np.diff(data["line"], axis=0), axis=1).sum())
        narrowing = ground.at(*graph.nodes[node]["at"]) < 0.6 * wide
        if narrowing and length < SPUR * wide and graph.degree(root) > 1:
            twigs.append(node)
    graph.remove_nodes_from(twigs)
    return bool(twigs)


def _joined(graph: nx.MultiGraph) -> None:
    """Make one line of the two at each node where nothing meets any more."""
    for node in list(graph):
        around = list(graph.edges(node, data=True, keys=True))
        if len(around) != 2 or graph.degree(node) != 2:
            continue
        (_, a, _, first), (_, b, _, second) = around
        if node in (a, b):
            continue
        there = first["line"] if a < node else first["line"][::-1]  # from a to the node
        back = second["line"] if node < b else second["line"][::-1]  # from the node to b
        line = np.vstack([there, back[1:]])
        graph.remove_node(node)
        graph.add_edge(a, b, line=line if a <= b else line[::-1])
