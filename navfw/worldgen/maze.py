"""The family ``maze``: a grid of cells with walls between them and few loops."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import networkx as nx
import numpy as np

from navfw.interfaces import WorldFamily
from navfw.topomap import PlaceKind
from navfw.worldgen.region_layout import Roadmap, WallLine, runs, walls_along
from navfw.worldgen.world_draft import WALL, Point, Unsuitable, WorldDraft, blend

Cell = tuple[int, int]
_MAX_PATH = 30.0
"""Largest length of the path from start to goal [m], in cells times their size."""


class Maze(WorldFamily):
    """A grid maze with cells 1.6 to 1.1 m wide."""

    name: ClassVar[str] = "maze"

    def build(self, rng: np.random.Generator, difficulty: float) -> WorldDraft:
        """Draw 5 to 8 by 5 to 8 cells, 1.6 m wide when easy, 1.1 m when difficult."""
        cell = round(
            float(np.clip(blend(1.55, 1.15, difficulty) + rng.uniform(-0.05, 0.05), 1.1, 1.6)), 3
        )
        columns, rows = (int(n) for n in rng.integers(5, 7, 2) + round(2.0 * difficulty))
        draft = WorldDraft.empty(rng, columns * cell + WALL, rows * cell + WALL)
        draft.enclose(draft.palette.draw("wall"))
        draft.ceiling = draft.palette.draw("ceiling")
        maze = _carve(rng, columns, rows, loops=blend(0.2, 0.06, difficulty))
        draft.description = f"A maze of {columns} x {rows} cells of {cell:g} m."
        inner = draft.palette.draw_many("wall", 3)
        lines = list(_lines(maze, columns, rows, cell))
        draft.walls += walls_along(lines, [], draft.palette, inner)
        start, goal = _ends(rng, maze, cell)
        onward = nx.shortest_path(maze, start, goal)[1]
        draft.set_start_and_goal(
            _middle(start, cell), _middle(goal, cell), towards=_middle(onward, cell)
        )
        draft.time_allowance = 45.0
        _add_map(draft, maze, cell, goal)
        return draft


def _carve(rng: np.random.Generator, columns: int, rows: int, loops: float) -> nx.Graph:
    """Graph of the cells without a wall between: a random tree and a share of other edges."""
    grid = nx.grid_2d_graph(columns, rows)
    for a, b in grid.edges:
        grid.edges[a, b]["weight"] = rng.random()
    maze = nx.minimum_spanning_tree(grid)
    others = [edge for edge in grid.edges if not maze.has_edge(*edge)]
    for edge in others:
        if rng.random() < loops:
            maze.add_edge(*edge)
    return maze


def _lines(maze: nx.Graph, columns: int, rows: int, cell: float) -> Iterator[WallLine]:
    """Walls between unconnected cells, collinear pieces merged."""
    half = 0.5 * WALL
    for axis, (across, along) in enumerate(((columns, rows), (rows, columns))):
        for i in range(1, across):
            cells = (((i - 1, j), (i, j)) for j in range(along))
            pairs = ((a, b) if axis == 0 else (a[::-1], b[::-1]) for a, b in cells)
            for begin, end in runs([not maze.has_edge(*pair) for pair in pairs]):
                at, low, high = (round(half + n * cell, 3) for n in (i, begin, end))
                yield WallLine(axis, at, low, high)


def _middle(cell: Cell, size: float) -> Point:
    x, y = (round(0.5 * WALL + (index + 0.5) * size, 3) for index in cell)
    return x, y


def _ends(rng: np.random.Generator, maze: nx.Graph, cell: float) -> tuple[Cell, Cell]:
    """Return a corner cell, and one of the farthest cells within ``_MAX_PATH`` of it."""
    cells = sorted(maze.nodes)
    corners = [c for c in cells if c[0] in (0, cells[-1][0]) and c[1] in (0, cells[-1][1])]
    start = corners[int(rng.integers(len(corners)))]
    steps = nx.single_source_shortest_path_length(maze, start)
    near = {c: n for c, n in steps.items() if 7.0 < n * cell < _MAX_PATH}
    if not near:
        raise Unsuitable("no goal at a suitable distance")
    most = max(near.values())
    farthest = sorted(c for c, n in near.items() if n == most)
    return start, farthest[int(rng.integers(len(farthest)))]


def _add_map(draft: WorldDraft, maze: nx.Graph, cell: float, goal: Cell) -> None:
    """The map: a place for every cell, a passage between connected cells."""
    roadmap = Roadmap(draft.geometry())
    names: dict[Cell, str] = {}
    for at in sorted(maze.nodes):
        beyond = sorted(maze[at])
        straight = len(beyond) == 2 and (
            beyond[0][0] == beyond[1][0] or beyond[0][1] == beyond[1][1]
        )
        kind: PlaceKind = "junction" if len(beyond) > 2 else "corridor" if straight else "corner"
        names[at] = "goal" if at == goal else f"cell-{at[0]}-{at[1]}"
        roadmap.add(names[at], *_middle(at, cell), kind)
    for a, b in maze.edges:
        if not roadmap.add_passage(names[a], names[b], cell - WALL):
            raise Unsuitable("cells too narrow")
    draft.goal_place = "goal"
    draft.topo_map = roadmap.build("generated-maze")
