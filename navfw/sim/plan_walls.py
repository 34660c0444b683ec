"""Covers the walls around the free floor of a floor plan with few rectangles.

Each straight edge of the outline gives a candidate: the rectangle behind it, as deep as the wall,
and extended in both directions as far as the wall goes on. Candidates are then chosen greedily by
the cells they cover (set cover; Chvatal 1979), so that one rectangle serves both faces of a wall
and all rooms along it.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, Mask
from navfw.numerics.products import product
from navfw.sim.shapes import Rectangle

_OUTLINE_TOLERANCE = 1.2
"""Largest distance [cells] of the outline from its straight edges: noise of a mapped wall."""

_SHELL = 0.3
"""Depth [m] of walls in front of unknown floor, or of floor that is occupied farther in."""

_MAX_THICKNESS = 2.0
"""Largest thickness [m] of a wall that one rectangle fills between its two faces."""

_MISSED = 1.0
"""Largest distance [cells] of a cell's centre from a rectangle that counts as covered."""

_Edge = tuple[Array, Array]


def wall_rectangles(free: Mask, cell: float) -> list[Rectangle]:
    """Enclose the free floor by rectangles, in metres from the grid's corner, largest first.

    ``free`` (rows, columns) has cells of ``cell`` [m]; the outside of the grid is not free. Each
    cell that is not free and touches free floor lies within a cell of a rectangle, and each cell in
    a rectangle within a cell of one that is not free.
    """
    border = math.ceil(_MAX_THICKNESS / cell) + 2
    ground = np.pad(free, border)
    away = cv2.distanceTransform((~ground).astype(np.uint8), cv2.DIST_L2, 5)
    wanted: Mask = ~ground & (away <= max(_SHELL / cell, 2.0))
    # outlines (n, 2) through the centres of free cells: what is not free lies to their left
    outlines, _ = cv2.findContours(ground.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    centres = (outline[:, 0].astype(np.float64) + 0.5 for outline in outlines)
    edges = [edge for outline in centres for edge in _straight_edges(outline)]
    open_ = cv2.erode(ground.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    grown = [_grown(ground, open_, edge, cell) for edge in edges]
    candidates = [strip for strip in grown if strip is not None]
    chosen = _cover(candidates, wanted)
    chosen += _patches(chosen, wanted)
    return [strip.rectangle(cell, border) for strip in _trimmed(chosen, wanted)]


@dataclass(frozen=True, slots=True)
class _Strip:
    """A rectangle in cells: ``length`` along the unit vector ``along`` from ``start``.

    Its other side goes ``depth`` to the left of ``along``. Cell (i, j) spans j to j + 1 in x and i
    to i + 1 in y.
    """

    start: tuple[float, float]
    along: tuple[float, float]
    length: float
    depth: float

    def coordinates(self, points: Array) -> tuple[Array, Array]:
        """Distances of points (N, 2) along and to the left."""
        dx, dy = points[:, 0] - self.start[0], points[:, 1] - self.start[1]
        (ax, ay) = self.along
        return ax * dx + ay * dy, ax * dy - ay * dx

    def rectangle(self, cell: float, border: int) -> Rectangle:
        """Return the rectangle in metres, from the corner of the grid without its border."""
        (ax, ay), half, deep = self.along, 0.5 * self.length, 0.5 * self.depth
        x = self.start[0] + half * ax - deep * ay - border
        y = self.start[1] + half * ay + deep * ax - border
        return Rectangle(x * cell, y * cell, half * cell, deep * cell, math.atan2(ay, ax))

    def part(self, low: float, high: float) -> _Strip:
        """Return the part between two distances along it."""
        x, y = self.start[0] + low * self.along[0], self.start[1] + low * self.along[1]
        return _Strip((x, y), self.along, high - low, self.depth)

    def cells(self, mask: Mask, margin: float = _MISSED) -> npt.NDArray[np.intp]:
        """Flat indices of the cells of ``mask`` with their centre inside, or within ``margin``."""
        (ax, ay) = self.along
        ends = np.array([(0, 0), (self.length, 0), (0, self.depth), (self.length, self.depth)])
        corners = product(ends, np.array([[ax, ay], [-ay, ax]])) + self.start
        low = np.maximum(np.floor(corners.min(axis=0) - margin).astype(int), 0)
        high = np.ceil(corners.max(axis=0) + margin).astype(int)
        rows, columns = np.nonzero(mask[low[1] : high[1], low[0] : high[0]])
        rows, columns = rows + low[1], columns + low[0]
        along, left = self.coordinates(np.stack([columns + 0.5, rows + 0.5], axis=1))
        inside = (along >= -margin) & (along <= self.length + margin)
        inside &= (left >= -margin) & (left <= self.depth + margin)
        flat: npt.NDArray[np.intp] = rows[inside] * mask.shape[1] + columns[inside]
        return flat


def _straight_edges(outline: Array) -> list[_Edge]:
    """Return the ends of the straight edges of an outline, moved onto the border of its cells."""
    if len(outline) < 3:
        return []
    corners = cv2.approxPolyDP(outline.astype(np.float32)[:, None], _OUTLINE_TOLERANCE, closed=True)
    index = {(x, y): i for i, (x, y) in reversed(list(enumerate(outline.tolist())))}
    at = sorted({index[x, y] for x, y in corners[:, 0].tolist()})
    edges = []
    for first, last in pairwise([*at, at[0] + len(outline)]):
        points = outline.take(range(first, last + 1), axis=0, mode="wrap")
        edges.append(_fitted(points))
    return edges


def _fitted(points: Array) -> _Edge:
    """Return the ends of the line through points (N, 2), moved half a cell to its left."""
    first, last = points[0], points[-1]
    along = (last - first) / max(math.dist(last, first), 1e-9)
    if len(points) > 6:
        # by least squares, without the ends, where the outline turns into the next edge
        inner = points[2:-2]
        middle = inner.mean(axis=0)
        _, _, axes = np.linalg.svd(inner - middle, full_matrices=False)
        along = axes[0] if product(axes[0], along) > 0 else -axes[0]
        first = middle + along * float(product(first - middle, along))
        last = middle + along * float(product(last - middle, along))
    left = np.array([-along[1], along[0]])
    # the outline of a slanted edge runs through the outermost cells: half a cell is the border
    return first + 0.5 * left, last + 0.5 * left


def _grown(ground: Mask, open_: Mask, edge: _Edge, cell: float) -> _Strip | None:
    """The rectangle behind an edge, as deep and as long as the wall; None if there is none."""
    first, last = edge
    length = math.dist(last, first)
    if length < 0.5:
        return None
    along = (last - first) / length
    left = np.array([-along[1], along[0]])
    depths = np.arange(math.ceil(_MAX_THICKNESS / cell)) + 0.5
    steps = np.linspace(0.0, length, max(math.ceil(length), 2) + 1)[1:-1]
    for shift in (0.0, 0.5, 1.0, 1.5):  # the outline's noise: the wall may begin a little behind
        points = first + shift * left + steps[:, None, None] * along + depths[:, None] * left
        ends_at = np.flatnonzero(_is_ground(ground, open_, points, axis=0))
        if not ends_at.size or ends_at[0] > 0:
            break
    else:
        return None
    # nothing behind it: a shell suffices
    depth = int(ends_at[0]) if ends_at.size else max(math.ceil(_SHELL / cell), 2)
    first, last = first + shift * left, last + shift * left
    ahead = np.arange(max(ground.shape)) + 0.5
    more = []
    for at, way in ((first, -along), (last, along)):
        points = at + ahead[:, None, None] * way + depths[:depth, None] * left
        beyond = at + ahead[:, None] * way
        outside = ((beyond < 0.0) | (beyond >= ground.shape[::-1])).any(axis=1)
        ends_at = np.flatnonzero(_is_ground(ground, open_, points, axis=1) | outside)
        more.append(float(ends_at[0]) if ends_at.size else 0.0)
    start = first - more[0] * along
    strip = _Strip(
        (float(start[0]), float(start[1])),
        (float(along[0]), float(along[1])),
        length + more[0] + more[1],
        float(depth),
    )
    return _without_open_ends(strip, open_)


def _without_open_ends(strip: _Strip, open_: Mask) -> _Strip | None:
    """The rectangle cut back to where none of its cells is amid free ground; None if all are."""
    rows, columns = np.divmod(strip.cells(open_, margin=0.0), open_.shape[1])
    along, _ = strip.coordinates(np.stack([columns + 0.5, rows + 0.5], axis=1))
    middle = 0.5 * strip.length
    low = float(along[along < middle].max(initial=-0.5)) + 0.5
    high = float(along[along >= middle].min(initial=strip.length + 0.5)) - 0.5
    return strip.part(low, high) if high - low >= 0.5 else None


def _is_ground(ground: Mask, open_: Mask, points: Array, axis: int) -> Mask:
    """By rows of points (..., 2): whether half of them are free, or one is amid free ground."""
    rows, columns = ground.shape
    j = np.clip(np.floor(points[..., 0]).astype(int), 0, columns - 1)
    i = np.clip(np.floor(points[..., 1]).astype(int), 0, rows - 1)
    is_ground: Mask = (ground[i, j].mean(axis=axis) >= 0.5) | open_[i, j].any(axis=axis)
    return is_ground


def _cover(candidates: list[_Strip], wanted: Mask) -> list[_Strip]:
    """Return the candidates chosen greedily, until they cover as much as all of them."""
    cells = [strip.cells(wanted) for strip in candidates]
    left = wanted.ravel().copy()
    queue = [(-len(covered), number) for number, covered in enumerate(cells) if covered.size]
    heapq.heapify(queue)
    chosen: list[_Strip] = []
    while queue:
        gain, number = heapq.heappop(queue)
        now = int(left[cells[number]].sum())
        if now == -gain:
            chosen.append(candidates[number])
            left[cells[number]] = False
        elif now > 0:  # others have covered a part of it in the meantime
            heapq.heappush(queue, (-now, number))
    return chosen


def _patches(chosen: list[_Strip], wanted: Mask) -> list[_Strip]:
    """A rectangle for each run of cells, row by row, that the chosen ones leave uncovered."""
    left = wanted.ravel().copy()
    for strip in chosen:
        left[strip.cells(wanted)] = False
    patches: list[_Strip] = []
    for flat in np.flatnonzero(left).tolist():
        if left[flat]:
            row, column = divmod(flat, wanted.shape[1])
            length = int(np.argmin(left[flat : flat + wanted.shape[1] - column]))
            patches.append(_Strip((float(column), float(row)), (1.0, 0.0), float(length), 1.0))
            left[patches[-1].cells(wanted)] = False
    return patches


def _trimmed(strips: list[_Strip], wanted: Mask) -> list[_Strip]:
    """The rectangles without ends that others cover as well, and without the superfluous ones."""
    count = np.zeros(wanted.size, dtype=np.int32)
    cells = [strip.cells(wanted) for strip in strips]
    for covered in cells:
        count[covered] += 1
    kept: list[_Strip] = []
    for strip, covered in reversed(list(zip(strips, cells, strict=True))):
        own = covered[count[covered] == 1]
        count[covered] -= 1
        if own.size == 0:
            continue
        rows, columns = np.divmod(own, wanted.shape[1])
        along, _ = strip.coordinates(np.stack([columns + 0.5, rows + 0.5], axis=1))
        low = max(float(along.min()) - 2.0, 0.0)
        high = min(float(along.max()) + 2.0, strip.length)
        kept.append(strip.part(low, high))
        count[kept[-1].cells(wanted)] += 1
    return sorted(kept, key=lambda strip: -strip.length * strip.depth)
