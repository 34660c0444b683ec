"""The skeleton of free ground as a graph: where ways meet or end, and the lines between."""

from __future__ import annotations

import networkx as nx
import numpy as np

from navfw.signals import Mask
from navfw.topomap.clearance_grid import ClearanceGrid, thinned

__all__ = ["skeleton_graph"]

SPUR = 1.6
"""Twigs into corners are at most so many times as long as the ground is wide where they begin."""

Cell = tuple[int, int]

_EDGES = ((-1, 0), (0, 1), (1, 0), (0, -1))
_CORNERS = ((-1, -1), (-1, 1), (1, 1), (1, -1))


def skeleton_graph(ground: ClearanceGrid, clearance: float) -> nx.MultiGraph:
    """Where a robot that keeps ``clearance`` [m] can go, as lines midway between the solids.

    Nodes have ``at`` (x, y) [m]; edges have ``line`` (n, 2) [m], from the node with the smaller
    number to the other. Twigs into the corners of rooms are taken off.
    """
    graph = _traced(ground, thinned(ground.clearance >= clearance))
    while _pruned(graph, ground):
        _joined(graph)
    return graph


def _traced(ground: ClearanceGrid, skeleton: Mask) -> nx.MultiGraph:
    """The skeleton's cells as knots, where ways meet or end, and lines of cells between them."""
    cells = _neighbours(skeleton)
    knots = [cell for cell, near in cells.items() if len(near) != 2]
    numbers = {cell: number for number, cell in enumerate(knots)}
    graph = nx.MultiGraph()
    graph.add_nodes_from((number, {"at": ground.point(*cell)}) for cell, number in numbers.items())
    walked: set[Cell] = set()
    for knot in knots:
        for first in cells[knot]:
            way = _walk(cells, knot, first, numbers)
            a, b = numbers[knot], numbers[way[-1]]
            # each line is met from both its ends, and one of two knots side by side has no cells
            if way[1] in walked or way[-2] in walked or (len(way) == 2 and a > b):
                continue
            walked.update(way[1:-1])
            line = np.array([ground.point(*cell) for cell in way])
            graph.add_edge(a, b, line=line if a <= b else line[::-1])
    for cell in cells:  # what is left are rings
        if cell in walked or cell in numbers:
            continue
        numbers[cell] = len(numbers)
        way = _walk(cells, cell, cells[cell][0], numbers)
        walked.update(way)
        graph.add_node(numbers[cell], at=ground.point(*cell))
        line = np.array([ground.point(*each) for each in way])
        graph.add_edge(numbers[cell], numbers[cell], line=line)
    return graph


def _neighbours(skeleton: Mask) -> dict[Cell, list[Cell]]:
    """The cells next to each: at an edge, or at a corner where no cell joins the two by edges."""
    rows, columns = np.nonzero(skeleton)
    inside = set(zip(rows.tolist(), columns.tolist(), strict=True))
    found: dict[Cell, list[Cell]] = {}
    for i, j in sorted(inside):
        near = [(i + di, j + dj) for di, dj in _EDGES if (i + di, j + dj) in inside]
        near += [
            (i + di, j + dj)
            for di, dj in _CORNERS
            if (i + di, j + dj) in inside and not {(i + di, j), (i, j + dj)} & inside
        ]
        found[i, j] = near
    return found


def _walk(
    cells: dict[Cell, list[Cell]], start: Cell, first: Cell, stops: dict[Cell, int]
) -> list[Cell]:
    """From one knot on, by way of ``first``, to the next."""
    way = [start, first]
    while way[-1] not in stops:
        way.append(next(cell for cell in cells[way[-1]] if cell != way[-2]))
    return way


def _pruned(graph: nx.MultiGraph, ground: ClearanceGrid) -> bool:
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
