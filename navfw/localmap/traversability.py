"""Traversability of the passages ahead, by the occupancy grid (METHOD 4.3).

A leg of the route is closed when no free path leads to its end even if all unobserved cells were
free; it is open when a path leads there over cells observed free; otherwise its status is unknown.
Only a strip along the leg counts: as wide as the passage, and wider by the uncertainty of the
estimated position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import cv2
import numba
import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.localmap.cell_arrays import clipped_cells
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.numerics.arrays import Array, Bytes, Indices
from navfw.signals import Belief, PassageQuery, PassageStatus, Pose

MAX_SIGMA = 0.4  # chosen
"""Sigma of the position above which nothing is checked [m]."""
MAX_HALF_WIDTH = 1.0  # chosen
"""Largest half width of the strip, before slack [m]."""

Metres = Annotated[float, Field(ge=0.0, le=5.0)]

_MIN_LENGTH = 0.3  # chosen
"""Length of a leg [m] below which its status is unknown: too few cells to judge."""

_RADIUS_TOLERANCE = 0.03  # chosen
"""A leg is closed only if it is so for a robot with a radius smaller by this [m]."""

_ROUNDING = 1e-6  # chosen
"""Tolerance [s] for frames that come exactly at the interval."""

_START_RADIUS = 0.5  # chosen
"""Radius [m] around the robot within which a path may begin: false obstacles beside the robot must
not close every leg."""

_ALONG_WALL, _WALL_DEPTH, _STEP = 1.0, 0.2, 0.05  # chosen
"""Distances [m] along and across its wall, in steps, at which a door's opening is looked for."""
_SPARE = 0.3  # chosen
"""Distance [m] kept from the ends of where the body fits through an opening."""
_GAPS = np.ones((3, 3), np.uint8)  # defined


class TraversabilityParams(StrictModel):
    """Which legs are checked, how wide and how often."""

    range: float = Field(
        2.5, gt=0.3, le=10.0, description="distance up to which legs are checked [m]"
    )
    slack: Metres = Field(0.2, description="added to the strip at each side, beside one sigma [m]")
    interval: float = Field(0.5, ge=0.0, le=60.0, description="time between two checks [s]")


class TraversabilityCheck:
    """Checks the legs that the planner queries, once per interval."""

    def __init__(self, params: TraversabilityParams | None = None) -> None:
        self.params = params or TraversabilityParams()
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first check."""
        self._last = -math.inf

    def due(self, time: float) -> bool:
        """Return whether the interval since the last check has passed at ``time`` [s]."""
        return not time - self._last < self.params.interval - _ROUNDING

    def check(
        self,
        occupancy: OccupancyGrid,
        queries: Sequence[PassageQuery],
        pose: Pose,
        belief: Belief,
        time: float,
    ) -> tuple[tuple[PassageQuery, PassageStatus], ...]:
        """Judge the ``queries`` in order; return the status of each that could be judged.

        ``queries`` are the legs of the route, the first from the robot on; ``pose`` (odom) and
        ``belief`` (map) are of the same ``time`` [s]. If the position's sigma is above 0.4 m,
        nothing is judged: it is not known which passage is in view.
        """
        self._last = time
        sigma = belief.sigma
        if sigma > MAX_SIGMA:
            return ()

        def to_odom(x: float, y: float) -> tuple[float, float]:
            return pose.to_parent(*belief.pose.to_local(x, y))

        widest = MAX_HALF_WIDTH
        legs = [
            (to_odom(*query.start), to_odom(*query.end), min(0.5 * query.width, widest))
            for query in queries
        ]
        slack = self.params.slack + sigma
        statuses = _passage_statuses(occupancy, pose, legs, self.params.range, slack)
        return tuple(zip(queries, statuses, strict=False))


Leg = tuple[tuple[float, float], tuple[float, float], float]
Gate = tuple[float, ...]
"""x, y of the grid's first cell, side of a cell, end of the leg, its direction, half width."""


def _passage_statuses(
    occupancy: OccupancyGrid, pose: Pose, legs: Sequence[Leg], reach: float, slack: float
) -> list[PassageStatus]:
    """Judge each leg (start, end in odom [m], half width [m]) that can be judged.

    Legs are judged up to ``reach`` [m] from odom ``pose``; the first closed one is the last of the
    list, as the camera does not see behind it.
    """
    radius, clearance = occupancy.robot.radius, occupancy.clearance
    strip = np.zeros(clearance.shape, np.uint8)
    row, column = occupancy.index(pose.x, pose.y)
    cv2.circle(strip, (column, row), round(_START_RADIUS / occupancy.params.cell), 1, -1)
    near = np.flatnonzero(strip.view(np.bool_))
    statuses: list[PassageStatus] = []
    for start, end, half in legs:
        stop = _cut(pose, start, end, reach)
        if stop is None:
            break
        ends = [occupancy.index(*point)[::-1] for point in (start, stop)]
        thickness = max(round(2.0 * (half + slack) / occupancy.params.cell), 1)
        cv2.line(strip, ends[0], ends[1], 1, thickness)
        if math.dist(start, stop) < _MIN_LENGTH:
            statuses.append("unknown")
            continue
        gate = _gate(occupancy, (start, stop, half + slack))
        if _leads(strip, near, clearance, radius, occupancy.observed, gate)[1]:
            statuses.append("open")
            continue
        begins, leads = _leads(strip, near, clearance, radius - _RADIUS_TOLERANCE, strip, gate)
        if begins and not leads:
            return [*statuses, "closed"]
        statuses.append("unknown")
    return statuses


def _cut(
    pose: Pose, start: tuple[float, float], end: tuple[float, float], reach: float
) -> tuple[float, float] | None:
    """Return the leg's end, or where it leaves the ``reach`` [m]; None if it starts outside."""
    ax, ay = start[0] - pose.x, start[1] - pose.y
    if math.hypot(ax, ay) > reach:
        return None
    dx, dy = end[0] - start[0], end[1] - start[1]
    if math.hypot(ax + dx, ay + dy) <= reach:
        return end
    a, b = dx * dx + dy * dy, ax * dx + ay * dy
    share = (-b + math.sqrt(max(b * b - a * (ax * ax + ay * ay - reach * reach), 0.0))) / a
    return start[0] + share * dx, start[1] + share * dy


def _gate(occupancy: OccupancyGrid, leg: Leg) -> Gate:
    """Return the gate across the end of ``leg``."""
    start, end, half = leg
    length = math.dist(start, end)
    ux, uy = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    return *occupancy.origin, occupancy.params.cell, *end, ux, uy, half


def find_opening(
    grid: OccupancyGrid, query: PassageQuery, pose: Pose, belief: Belief
) -> tuple[float, float] | None:
    """Return the opening [m, map] nearest to a door at the end of ``query``, if one was seen.

    The body has room all across the wall there, over floor that was observed.
    """
    if query.normal is None:
        return None
    across = np.array(query.normal)
    off, deep = (np.arange(-far, far + _STEP, _STEP) for far in (_ALONG_WALL, _WALL_DEPTH))
    along = off[:, None] * (across[1], -across[0]) + query.end
    points = (along[:, None] + deep[:, None] * across).reshape(-1, 2)
    to = pose.points_to_parent(belief.pose.points_to_local(points))
    at, _ = clipped_cells(to, grid.origin, grid.params.cell, grid.size)
    observed = cv2.dilate(grid.observed, _GAPS)[at] > 0
    free = observed & (grid.clearance[at] >= grid.robot.radius)
    fits = free.reshape(len(off), -1).all(axis=1)
    ends = np.flatnonzero(np.diff(fits, prepend=False, append=False)).reshape(-1, 2)
    if not len(ends):
        return None
    first, last = min(ends - (0, 1), key=lambda run: max(off[run[0]], -off[run[1]]))
    spare = min((last - first) // 2, round(_SPARE / _STEP))
    x, y = along[min(max(len(off) // 2, first + spare), last - spare)]
    return float(x), float(y)


@numba.njit(cache=True)
def _in_gate(gate: Gate, row: int, column: int) -> bool:  # pragma: no cover - compiled
    """Return whether a cell is in the gate: a path that reaches one of its cells has passed."""
    left, bottom, cell, end_x, end_y, ux, uy, half = gate
    x, y = left + cell * column - end_x, bottom + cell * row - end_y
    return -cell <= ux * x + uy * y <= 2.0 * cell and abs(uy * x - ux * y) <= half


@numba.njit(cache=True)
def _leads(
    strip: Bytes, near: Indices, clearance: Array, least: float, observed: Bytes, gate: Gate
) -> tuple[bool, bool]:  # pragma: no cover - compiled
    """Return whether a path may begin at one of the cells ``near``, and whether one leads there.

    It leads over cells of ``strip`` that are ``observed``; ``near`` (k,) are flat indices.
    """
    size, cells = strip.shape[1], strip.size
    free, room, seen = strip.copy().reshape(-1), clearance.reshape(-1), observed.reshape(-1)
    waiting, count = np.empty(len(near) + 4 * cells, np.int64), len(near)
    waiting[:count], begins = near, False
    while count > 0:
        count -= 1
        at, column = waiting[count], waiting[count] % size
        if not (free[at] and seen[at] and room[at] >= least):
            continue
        free[at], begins = 0, True  # reached
        if _in_gate(gate, at // size, column):
            return True, True
        # at the first and the last column a neighbour is the cell itself
        for i in (at - size, at + size, at - min(column, 1), at + min(size - 1 - column, 1)):
            if 0 <= i < cells and free[i]:
                waiting[count] = i
                count += 1
    return begins, False
