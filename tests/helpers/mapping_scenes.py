"""A robot that is driven through drawn rooms and observes them exactly, for tests of mapping."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from navfw.localmap import LocalMap
from navfw.mapping import GrowingMap
from navfw.numerics import Array, Mask
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Odometry, Pose, Twist

Box = tuple[float, float, float, float]
"""x from, x to, y from, y to [m]."""

ROBOT = RobotModel()
SIGHT = 2.5
"""Distance [m] up to which the robot observes, all around it."""

ROOM: tuple[Box, ...] = (
    *(
        (-2.0, 6.0, -2.1, -2.0),
        (-2.0, 6.0, 2.0, 2.1),
        (-2.1, -2.0, -2.1, 2.1),
        (6.0, 6.1, -2.1, 2.1),
    ),
    *((2.0, 2.1, -2.0, -0.5), (2.0, 2.1, 0.5, 2.0), (4.5, 5.0, 1.2, 1.6), (-1.5, -0.9, -1.6, -1.3)),
)
"""The walls of two rooms with a door of 1 m between them, and a box in each."""

ROUND = ((0.0, 0.0), (4.0, 0.0), (5.0, -1.0), (4.0, 0.0), (0.0, 0.0), (-1.0, 1.0), (0.0, 0.0))
"""A path through both rooms and back [m]."""


def inside(boxes: Sequence[Box], x: Array, y: Array) -> Mask:
    """Which of the points (x, y) [m] lie in one of the boxes, to 1 cm: no cell is on an edge."""
    found = np.zeros(np.broadcast(x, y).shape, dtype=np.bool_)
    for x0, x1, y0, y1 in boxes:
        found |= (x > x0 - 0.01) & (x < x1 + 0.01) & (y > y0 - 0.01) & (y < y1 + 0.01)
    return found


def poses_along(path: Sequence[tuple[float, float]], step: float = 0.05) -> Iterator[Pose]:
    """Poses every ``step`` [m] along straight lines between the points of ``path``."""
    for (x0, y0), (x1, y1) in pairwise(path):
        length = float(np.hypot(x1 - x0, y1 - y0))
        yaw = float(np.arctan2(y1 - y0, x1 - x0))
        for share in np.arange(0.0, length, step) / length:
            yield Pose(x0 + share * (x1 - x0), y0 + share * (y1 - y0), yaw)


def observe(local_map: LocalMap, boxes: Sequence[Box], truth: Pose, odom: Pose) -> None:
    """Let the local map at ``odom`` see all cells of ``boxes`` within sight of the true pose."""
    grid = local_map.occupancy
    along = [grid.origin[a] + np.arange(grid.size) * grid.params.cell for a in (0, 1)]
    x, y = np.meshgrid(*along)
    seen = np.hypot(x - odom.x, y - odom.y) < SIGHT
    points = truth.points_to_parent(odom.points_to_local(np.stack([x[seen], y[seen]], axis=1)))
    grid.log_odds[seen] = np.where(inside(boxes, *points.T), 3.0, -1.5)


def drive(
    growing: GrowingMap,
    boxes: Sequence[Box],
    truth: Sequence[Pose],
    odometry: Sequence[Pose] | None = None,
    begin: float = 0.0,
) -> LocalMap:
    """Drive along the true poses, with other poses by odometry if given; finish the map."""
    local_map = LocalMap(ROBOT)
    for k, (true, odom) in enumerate(zip(truth, odometry or truth, strict=True)):
        reading = Odometry(begin + 0.1 * k, odom, Twist(0.5, 0.0), 0.0, still=False)
        local_map.occupancy.update(odom, reading.time)
        observe(local_map, boxes, true, odom)
        growing.update(reading, local_map)
    growing.finish()
    return local_map


def agreement(grid: GrownGrid, boxes: Sequence[Box]) -> tuple[float, float]:
    """Shares of the observed cells that are right: of the occupied ones, and of the free ones."""
    cells = np.argwhere(np.ones(grid.log_odds.shape, dtype=np.bool_))
    x, y = grid.centres(cells).T
    solid = inside(boxes, x, y).reshape(grid.log_odds.shape)
    return float(solid[grid.occupied].mean()), float((~solid[grid.free]).mean())
