"""A robot that is driven through drawn rooms and observes them exactly, for tests of mapping."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from localmap_samples import metric_percept

from navfw.localmap import LocalMap
from navfw.mapping import GrowingMap
from navfw.numerics import Array, Mask
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Label, Odometry, Percept, Pose, Twist

Box = tuple[float, float, float, float]
"""x from, x to, y from, y to [m]."""

ROBOT = RobotModel()
SIGHT = 2.5
"""Distance [m] up to which the robot observes, all around it."""

ROOM: tuple[Box, ...] = (
    *((-2.0, 6.0, -2.0, -2.0), (-2.0, 6.0, 2.0, 2.0), (-2.0, -2.0, -2.0, 2.0)),
    *((6.0, 6.0, -2.0, 2.0), (2.0, 2.0, -2.0, -0.5), (2.0, 2.0, 0.5, 2.0)),
    *((4.5, 5.0, 1.2, 1.2), (-1.5, -0.9, -1.4, -1.4), (-0.9, -0.9, -1.7, -1.4)),
)
"""The walls of two rooms with a door of 1 m between them, and screens in each: surfaces alone."""

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


def percept_at(boxes: Sequence[Box], truth: Pose, time: float) -> Percept:
    """What a camera at the true pose sees of ``boxes``: one exact point in each of 40 columns."""
    turn, focal = ROBOT.camera.base_from_camera, ROBOT.camera.focal
    half = 0.45 * ROBOT.camera.hfov
    reach = np.arange(0.2, 3.5, 0.01)
    lens = truth.to_parent(ROBOT.camera.mount_forward, 0.0)
    points, nearness, seen = [], [], []
    for angle in np.linspace(-half, half, 40).tolist():
        ray = np.array([np.cos(angle), np.sin(angle), 0.0]) @ turn
        heading = truth.yaw + angle
        x, y = lens[0] + reach * np.cos(heading), lens[1] + reach * np.sin(heading)
        hits = np.flatnonzero(inside(boxes, x, y))
        points.append((focal * ray[0] / ray[2], focal * ray[1] / ray[2]))
        seen.append(len(hits) > 0)
        nearness.append(1.0 / (reach[hits[0]] * ray[2]) if len(hits) else 1e-3)
    height, cells = ROBOT.camera.mount_height, np.array([points])
    percept = metric_percept(time, cells, np.array([nearness]), 0.01, Label.OBSTACLE, height)
    return replace(percept, confidence=np.array([seen], dtype=np.float64))


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
        percept = percept_at(boxes, true, reading.time) if k % 3 == 0 else None
        growing.update(reading, local_map, (), percept, odom)
    growing.finish()
    return local_map


def agreement(grid: GrownGrid, boxes: Sequence[Box]) -> tuple[float, float]:
    """Shares of the observed cells that are right: of the occupied ones, and of the free ones."""
    cells = np.argwhere(np.ones(grid.log_odds.shape, dtype=np.bool_))
    x, y = grid.centres(cells).T
    solid = inside(boxes, x, y).reshape(grid.log_odds.shape)
    return float(solid[grid.occupied].mean()), float((~solid[grid.free]).mean())


def drifted(truth: Sequence[Pose], turn: float) -> list[Pose]:
    """The poses by an odometry that turns ``turn`` [rad] too far per metre."""
    poses = [truth[0]]
    for before, now in pairwise(truth):
        step = before.relative(now)
        yaw = step.yaw + turn * float(np.hypot(step.x, step.y))
        poses.append(poses[-1].compose(Pose(step.x, step.y, yaw)))
    return poses
