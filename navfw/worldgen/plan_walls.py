"""The ground of a floor plan without the noise of a map, and the walls around it as few rectangles.

Maps by SLAM have single wrong pixels, gaps of a pixel in walls, and free ground behind windows: the
ground is what is certainly free and in one piece. Each straight edge of its outline gives a
candidate: the rectangle behind it, as deep as the wall and as long as the wall goes on in both
directions. Candidates are then chosen greedily by the cells they cover (set cover; Chvatal 1979),
so that one rectangle serves both faces of a wall and all rooms along it.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.errors import InputError
from navfw.numerics import Array, Mask
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.sim.shapes import Rectangle
from navfw.topomap.map_builder import MARGIN
from navfw.topomap.occupancy_map import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyMap


class PlanCleaning(StrictModel):
    """The steps of cleaning, in this order; 0 leaves a step out."""

    speckle: Annotated[
        float,
        Field(ge=0.0, le=1.0, description="spots within free ground up to this size vanish [m]"),
    ] = 0.12
    gap: Annotated[
        float,
        Field(ge=0.0, le=0.4, description="openings narrower than this are closed [m]"),
    ] = 0.15


Point = tuple[float, float]
_Labels = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class CleanedPlan:
    """A plan without noise, and the piece of its free ground in which a robot drives.

    ``plan`` has all ground connected with it, ``ground`` not what the robot does not fit through
    to. ``pieces`` are all of the plan, first the one taken, then the largest: area [m^2] and
    widest point [m].
    """

    plan: OccupancyMap
    ground: OccupancyMap
    pieces: tuple[tuple[float, Point], ...]


def cleaned(plan: OccupancyMap, cleaning: PlanCleaning, inside: Point | None = None) -> CleanedPlan:
    """The plan without speckles and gaps; free ground apart from one piece is unknown.

    Small occupied or unknown spots that free ground surrounds become free. Gaps narrower than
    ``cleaning.gap`` become unknown. The piece is the largest, or the one with ``inside`` [m].

    Raises:
        InputError: nothing is free, or not the point.

    """
    from scipy.ndimage import maximum_position

    free = _without_speckles(plan.free, cleaning.speckle / plan.resolution)
    free = _without_gaps(free, cleaning.gap / plan.resolution)
    if not free.any():
        raise InputError(
            "the plan has no free ground that is wider than its gaps; choose a smaller --gap, or "
            "check the resolution",
            file=plan.file,
        )
    away = cv2.distanceTransform(np.pad(free, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    labels = _pieces(
        free, away.astype(np.float64), (RobotModel().radius + MARGIN) / plan.resolution + 0.5
    )
    areas: Array = np.bincount(labels.ravel()).astype(np.float64) * plan.resolution**2
    order = 1 + np.argsort(-areas[1:], kind="stable")
    taken = order[0] if inside is None else _piece_at(plan, labels, areas, inside)
    order = np.append(taken, order[order != taken])
    widest = np.array(maximum_position(away, labels, order))
    points = plan.centres(widest[:, 0], widest[:, 1]).tolist()
    _, joined = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    free = joined == joined[labels == taken][0]
    cells: Cells = np.where(free, FREE, np.where(plan.occupied, OCCUPIED, UNKNOWN)).astype(np.int8)
    ground: Cells = np.where(free & (labels != taken) & (labels > 0), UNKNOWN, cells)
    return CleanedPlan(
        OccupancyMap(cells, plan.resolution, plan.origin, plan.file),
        OccupancyMap(ground, plan.resolution, plan.origin, plan.file),
        tuple(zip(areas[order].tolist(), map(tuple, points), strict=True)),
    )


def _pieces(free: Mask, away: Array, need: float) -> _Labels:
    """By cell: the number of the piece, from 1, in which one ``need`` [cells] wide can drive.

    0 where there is none; where it fits nowhere, the pieces are those of the free ground.
    """
    core = away >= need if (away >= need).any() else free
    _, numbers = cv2.connectedComponents(core.astype(np.uint8), connectivity=8)
    grown = numbers.astype(np.float32)
    for _ in range(math.ceil(2.0 * need)):  # into corners, and up to the walls
        larger = cv2.dilate(grown, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
        grown = np.where(free & (grown == 0.0), larger, grown)
    return grown.astype(np.intp)


def _piece_at(plan: OccupancyMap, labels: _Labels, areas: Array, point: Point) -> int:
    """The piece with the point; raises InputError if there is none."""
    rows, columns = np.nonzero(labels)
    centres = plan.centres(rows, columns)
    away = np.hypot(centres[:, 0] - point[0], centres[:, 1] - point[1])
    nearest = int(np.argmin(away))
    label = int(labels[rows[nearest], columns[nearest]])
    if away[nearest] > 0.75 * plan.resolution:
        x, y = centres[nearest]
        raise InputError(
            f"expected a point of free ground, ({point[0]:g}, {point[1]:g}) is {away[nearest]:.2f}"
            f" m from it: the nearest is ({x:.2f}, {y:.2f}), in a piece of {areas[label]:.0f} m2",
            file=plan.file,
            key="--inside",
        )
    return label


def _without_speckles(free: Mask, size: float) -> Mask:
    """Free ground with the spots in it that are at most ``size`` cells wide and high."""
    # unknown all around: a spot at the edge of the grid is not surrounded
    blocked = np.pad(~free, 1, constant_values=True).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(blocked, connectivity=8)
    extent = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    small = extent <= size
    small[0] = False  # the label of the free ground
    grown: Mask = free | small[labels[1:-1, 1:-1]]
    return grown


def _without_gaps(free: Mask, width: float) -> Mask:
    """Free ground without its parts narrower than ``width`` cells."""
    edge = round(width)
    if edge < 2:
        return free
    kernel = np.ones((edge, edge), np.uint8)
    padded = np.pad(free, edge).astype(np.uint8)
    eroded = cv2.erode(padded, kernel, anchor=(edge // 2, edge // 2))
    opposite = edge - 1 - edge // 2  # of an even kernel the middle lies beside its centre
    opened = cv2.dilate(eroded, kernel, anchor=(opposite, opposite))
    # a square kernel also blunts the corners of slanted walls: those parts are no gaps, they touch
    # what remains along one side only
    lost = ((padded > 0) & (opened == 0)).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(lost, connectivity=4)
    kept = opened > 0
    blunt = np.zeros(count, dtype=np.bool_)
    for label in range(1, count):
        x, y, w, h = stats[label, :4]
        around = np.s_[y - 1 : y + h + 1, x - 1 : x + w + 1]
        blunt[label] = _stretches(labels[around] == label, kept[around]) < 2
    wide: Mask = (kept | blunt[labels])[edge:-edge, edge:-edge]
    return wide


def _stretches(region: Mask, kept: Mask) -> int:
    """The number of separate stretches along which ``part`` touches the ground that is kept."""
    ring = cv2.dilate(region.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return int(cv2.connectedComponents((ring & kept).astype(np.uint8), connectivity=8)[0]) - 1


_OUTLINE_TOLERANCE = 1.2
"""Largest distance [cells] of the outline from its straight edges: noise of a mapped wall."""

_SHELL = 0.3
"""Depth [m] of walls before ground that nothing is known of, or that is occupied farther in."""

_MAX_THICKNESS = 2.0
"""Largest thickness [m] of a wall that one rectangle fills between its two faces."""

_MISSED = 1.0
"""A cell whose centre is this near [cells] to a rectangle counts as covered."""

_Edge = tuple[Array, Array]


def wall_rectangles(free: Mask, cell: float) -> list[Rectangle]:
    """Rectangles that enclose the free ground, in metres from the grid's corner, largest first.

    ``free`` (rows, columns) has cells of ``cell`` [m]; what is outside of the grid is not free.
    Each cell that is not free and touches free ground lies within a cell of a rectangle, and each
    cell in a rectangle within a cell of what is not free.
    """
    border = math.ceil(_MAX_THICKNESS / cell) + 2
    ground = np.pad(free, border)
    away = cv2.distanceTransform((~ground).astype(np.uint8), cv2.DIST_L2, 5)
    wanted: Mask = ~ground & (away <= max(_SHELL / cell, 2.0))
    edges = [edge for outline in _outlines(ground) for edge in _straight_edges(outline)]
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
        """The same in metres, from the corner of the grid without its border."""
        (ax, ay), half, deep = self.along, 0.5 * self.length, 0.5 * self.depth
        x = self.start[0] + half * ax - deep * ay - border
        y = self.start[1] + half * ay + deep * ax - border
        return Rectangle(x * cell, y * cell, half * cell, deep * cell, math.atan2(ay, ax))

    def part(self, low: float, high: float) -> _Strip:
        """The part between two distances along it."""
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


def _outlines(ground: Mask) -> list[Array]:
    """The outlines (N, 2) of the free ground through the centres of its cells, in order.

    What is not free lies to the left of their direction.
    """
    outlines, _ = cv2.findContours(ground.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return [outline[:, 0, :].astype(np.float64) + 0.5 for outline in outlines]


def _straight_edges(outline: Array) -> list[_Edge]:
    """The ends of the straight edges of an outline, moved onto the border of its cells."""
    if len(outline) < 3:
        return []
    corners = cv2.approxPolyDP(outline.astype(np.float32)[:, None], _OUTLINE_TOLERANCE, closed=True)
    at = _positions(outline, corners[:, 0].astype(np.float64))
    edges = []
    for first, last in pairwise([*at, at[0] + len(outline)]):
        points = outline.take(range(first, last + 1), axis=0, mode="wrap")
        edges.append(_fitted(points))
    return edges


def _positions(outline: Array, corners: Array) -> list[int]:
    """The positions of the corners in the outline, ascending."""
    index = {(float(x), float(y)): i for i, (x, y) in reversed(list(enumerate(outline)))}
    return sorted({index[float(x), float(y)] for x, y in corners})


def _fitted(points: Array) -> _Edge:
    """The ends of the line through points (N, 2), moved half a cell to its left."""
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
        ends_at = np.flatnonzero(
            _is_ground(ground, open_, points, axis=1) | _outside(ground, at + ahead[:, None] * way)
        )
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


def _outside(ground: Mask, points: Array) -> Mask:
    """Whether points (N, 2) lie outside of the grid."""
    rows, columns = ground.shape
    inside: Mask = np.all((points >= 0.0) & (points < (columns, rows)), axis=1)
    return ~inside


def _cover(candidates: list[_Strip], wanted: Mask) -> list[_Strip]:
    """The candidates chosen greedily, until they cover as much as all of them."""
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
