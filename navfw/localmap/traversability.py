"""What the ego map says of the way that the planner means to take (METHOD 4.3).

A leg of the way is closed when nothing that has been seen leaves the robot a path to its end, even
if all that has not been seen were free; it is open when a path leads there over ground that has
been seen free. Between the two nobody knows. Only the strip along the leg counts: as wide as the
passage, and a little more for what the estimated position is off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from navfw.localmap.drop_map import DropMap
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.signals import Belief, PassageQuery, PassageReport, PassageStatus, Percept, Pose

__all__ = ["TraversabilityCheck", "TraversabilityParams", "judge"]

Bits = npt.NDArray[np.uint8]
Cells = npt.NDArray[np.intp]
"""(k,) where cells are in the map's flat order."""
Metres = Annotated[float, Field(ge=0.0, le=5.0)]

_SHORTEST = 0.3
"""Of less than this [m] of a leg nothing is said."""

_OPENNESS = 0.03
"""A path counts as closed only if it would be even for a robot so much smaller [m]."""

_ROUNDING = 1e-6
"""Frames come in step with the interval, but for rounding [s]."""

_BESIDE = 0.5
"""A path begins so near the robot [m]: it may stand in a corner of its own ghosts."""


class TraversabilityParams(BaseModel):
    """How the way ahead is judged."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    range: Annotated[
        float, Field(gt=0.3, le=10.0, description="how far ahead legs are judged [m]")
    ] = 2.5
    slack: Annotated[
        Metres, Field(description="the strip is so much wider at each side, beside a sigma [m]")
    ] = 0.2
    surest: Annotated[
        Metres, Field(description="sigma of the position above which nothing is judged [m]")
    ] = 0.4
    widest: Annotated[Metres, Field(description="of the strip, half, before slack [m]")] = 1.0
    interval: Annotated[
        float, Field(ge=0.0, le=60.0, description="time between two judgements [s]")
    ] = 0.5


class TraversabilityCheck:
    """Judges the legs that the planner asks about, now and then."""

    def __init__(
        self, occupancy: OccupancyGrid, params: TraversabilityParams | None = None
    ) -> None:
        self.occupancy = occupancy
        self.params = params or TraversabilityParams()
        self.drops = DropMap(occupancy.robot)
        self.reset()

    def reset(self) -> None:
        """Forget the last run."""
        self.drops.reset()
        self._last = -math.inf

    def enter(self, percept: Percept, pose: Pose) -> None:
        """Note the drops that ``percept`` shows, seen from odom ``pose``."""
        self.drops.enter(percept, pose)

    def look(
        self, queries: Sequence[PassageQuery], pose: Pose, belief: Belief, time: float
    ) -> PassageReport | None:
        """The judgement for odom ``pose`` at ``time`` [s]; None when the last one is still fresh.

        ``queries`` are the legs of the way ahead, in order, the first one from the robot on.
        """
        if time - self._last < self.params.interval - _ROUNDING:
            return None
        self._last = time

        def to_odom(x: float, y: float) -> tuple[float, float]:
            return pose.to_parent(*belief.pose.to_local(x, y))

        def to_map(x: float, y: float) -> tuple[float, float]:
            return belief.pose.to_parent(*pose.to_local(x, y))

        sigma = belief.sigma
        if sigma > self.params.surest:
            queries = ()  # who does not know where he stands cannot tell which passage he sees
        legs = [
            (to_odom(*query.start), to_odom(*query.end), min(0.5 * query.width, self.params.widest))
            for query in queries
        ]
        states = judge(self.occupancy, pose, legs, self.params.range, self.params.slack + sigma)
        return PassageReport(
            time=time,
            passages=tuple(zip(queries, states, strict=False)),
            drops=tuple(to_map(*point) for point in self.drops.points()),
        )


Leg = tuple[tuple[float, float], tuple[float, float], float]


def judge(
    occupancy: OccupancyGrid, pose: Pose, legs: Sequence[Leg], reach: float, slack: float
) -> list[PassageStatus]:
    """The state of each leg (start, end in odom [m], half width [m]), as far as it can be told.

    Legs are judged up to ``reach`` [m] from odom ``pose``; the first that is closed is the last of
    the list, as nothing is seen behind it.
    """
    radius = occupancy.robot.radius
    passable = (occupancy.clearance >= radius - _OPENNESS).astype(np.uint8)
    seen = ((occupancy.clearance >= radius) & (occupancy.known > 0)).astype(np.uint8)
    strip = np.zeros_like(passable)
    row, column = occupancy.index(pose.x, pose.y)
    cv2.circle(strip, (column, row), round(_BESIDE / occupancy.params.cell), 1, -1)
    near = _cells_of(strip)
    states: list[PassageStatus] = []
    for start, end, half in legs:
        stop = _cut(pose, start, end, reach)
        if stop is None:
            break
        _draw(occupancy, strip, start, stop, half + slack)
        if math.dist(start, stop) < _SHORTEST:
            states.append("unknown")
            continue
        gate = _gate(occupancy, strip, start, stop, half + slack)
        if _joined(seen & strip, near, gate):
            states.append("open")
        elif passable.ravel()[near].any() and not _joined(passable & strip, near, gate):
            states.append("closed")
            break
        else:
            states.append("unknown")
    return states


def _cut(
    pose: Pose, start: tuple[float, float], end: tuple[float, float], reach: float
) -> tuple[float, float] | None:
    """The leg's end, or where the leg leaves the circle around the robot; None if it is outside."""
    ax, ay = start[0] - pose.x, start[1] - pose.y
    if math.hypot(ax, ay) > reach:
        return None
    dx, dy = end[0] - start[0], end[1] - start[1]
    if math.hypot(ax + dx, ay + dy) <= reach:
        return end
    a, b = dx * dx + dy * dy, ax * dx + ay * dy
    share = (-b + math.sqrt(max(b * b - a * (ax * ax + ay * ay - reach * reach), 0.0))) / a
    return start[0] + share * dx, start[1] + share * dy


def _draw(
    occupancy: OccupancyGrid,
    strip: Bits,
    start: tuple[float, float],
    end: tuple[float, float],
    half: float,
) -> None:
    ends = [occupancy.index(*point)[::-1] for point in (start, end)]
    thickness = max(round(2.0 * half / occupancy.params.cell), 1)
    cv2.line(strip, ends[0], ends[1], 1, thickness)


def _gate(
    occupancy: OccupancyGrid,
    strip: Bits,
    start: tuple[float, float],
    end: tuple[float, float],
    half: float,
) -> Cells:
    """The cells of the strip around the leg's end and across it: who is there has passed."""
    cell = occupancy.params.cell
    cells = _cells_of(strip)
    rows, columns = np.divmod(cells, occupancy.size)
    x = occupancy.origin[0] + cell * columns - end[0]
    y = occupancy.origin[1] + cell * rows - end[1]
    length = math.dist(start, end)
    ux, uy = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    along = ux * x + uy * y
    aside = uy * x - ux * y
    return cells[(along >= -cell) & (along <= 2.0 * cell) & (np.abs(aside) <= half)]


def _joined(free: Bits, near: Cells, gate: Cells) -> bool:
    """Whether one connected free area reaches from near the robot to the gate."""
    areas, labels = cv2.connectedComponents(free, connectivity=4)
    reached = np.zeros(areas, np.bool_)
    reached[labels.ravel()[near]] = True
    reached[0] = False  # what is not free
    return bool(reached[labels.ravel()[gate]].any())


def _cells_of(marked: Bits) -> Cells:
    return np.flatnonzero(marked.view(np.bool_))
