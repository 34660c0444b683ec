"""The nearest-frontier tour on the true map, to compare an exploration's path with.

The tour sees without errors what the robot's camera could see, and always drives to the nearest
frontier, with the ground and frontiers of the planner ``explorer``, and back to the start.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from navfw.numerics import Array, Mask
from navfw.papfis.known_ground import MIN_GAIN, KnownGround
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Pose
from navfw.sim.scene_geometry import ConfigurationSpaceGrid

_RANGE = 3.0
"""Distance [m] up to which the tour sees: the range of the local map."""
_STEP = 0.4
"""Distance [m] driven between two observations."""
_MAX_LOOKS = 20_000
"""Largest number of observations; it ends a tour that would not end."""
_FREE, _OCCUPIED = -64, 64
"""Evidence of what was seen."""


class TrueTour:
    """The tour of one robot from ``start`` over ``solid`` and free cells of the true plan."""

    def __init__(self, solid: ConfigurationSpaceGrid, robot: RobotModel, start: Pose) -> None:
        walled = np.ones(solid.occupied.shape, np.bool_)  # the edge of the world is a wall
        walled[1:-1, 1:-1] = solid.occupied[1:-1, 1:-1]
        self._solid, self._robot, self._start = replace(solid, occupied=walled), robot, start
        self._pose = start
        self._evidence = np.zeros(solid.occupied.shape, np.int8)
        rays = math.ceil(robot.camera.hfov / (0.7 * solid.cell / _RANGE))
        half = 0.5 * robot.camera.hfov
        self._rays = np.linspace(-half, half, rays)
        self._away = np.arange(0.5, _RANGE / solid.cell, 0.5) * solid.cell

    def length(self, *, back: bool) -> float:
        """Compute the length [m] of the tour; with ``back``, also of the path back to the start."""
        self._mark_body()
        self._look()
        driven = 0.0
        for _ in range(_MAX_LOOKS):
            ground = self._ground()
            costs = ground.costs_from(self._pose.x, self._pose.y)
            frontiers = [f for f in ground.frontiers(costs) if f.gain >= MIN_GAIN]
            if not frontiers:
                break
            nearest = min(frontiers, key=lambda f: (f.length, f.x, f.y))
            path = ground.path_to(costs, nearest.x, nearest.y)
            driven += self._drive(np.vstack([path, [(nearest.x, nearest.y)]]))
        if back:
            lengths = self._ground().lengths_from(self._start.x, self._start.y)
            home = self._ground().length_at(lengths, self._pose.x, self._pose.y)
            driven += home if math.isfinite(home) else 0.0
        return driven

    def _ground(self) -> KnownGround:
        x, y = self._solid.origin
        half = 0.5 * self._solid.cell
        grid = GrownGrid(self._evidence.copy(), (x + half, y + half), self._solid.cell)
        return KnownGround.of(grid, self._robot, (self._pose.x, self._pose.y))

    def _drive(self, path: Array) -> float:
        """Drive along ``path`` (n, 2) for _STEP [m], or to its end, and look; return the length."""
        steps = np.hypot(*np.diff(path, axis=0).T)
        far = np.cumsum(steps)
        last = min(int(np.searchsorted(far, _STEP)) + 1, len(path) - 1)
        reached = last
        for k in range(1, last + 1):
            if not self._free_between(path[k - 1], path[k]):
                reached = k - 1
                break
        yaw = math.atan2(*(path[reached] - path[max(reached - 1, 0)])[::-1])
        self._pose = Pose(float(path[reached, 0]), float(path[reached, 1]), yaw)
        self._mark_body()
        self._look()
        if reached < last or last == len(path) - 1:
            end = path[min(reached + 1, last)]
            self._feel(float(end[0]), float(end[1]))
        return float(far[reached - 1]) if reached else 0.0

    def _free_between(self, a: Array, b: Array) -> bool:
        """Whether nothing solid is on the line between two points [m]: a wall may be unseen."""
        cells, inside = self._cells(a + np.linspace(0.0, 1.0, 9)[:, None] * (b - a))
        return bool(inside.all() and not self._solid.occupied[cells[:, 0], cells[:, 1]].any())

    def _cells(self, points: Array) -> tuple[Array, Mask]:
        """Return the cells (n, 2) at points (n, 2) [m], clipped, and which are inside."""
        cells = np.floor((points - self._solid.origin) / self._solid.cell).astype(np.int64)[:, ::-1]
        inside = np.all((cells >= 0) & (cells < self._solid.occupied.shape), axis=1)
        return np.clip(cells, 0, np.array(self._solid.occupied.shape) - 1), inside

    def _mark_body(self) -> None:
        cells, _ = self._cells(np.array([[self._pose.x, self._pose.y]]))
        radius = round(self._robot.radius / self._solid.cell)
        marked = self._evidence.copy()
        cv2.circle(marked, (int(cells[0, 1]), int(cells[0, 0])), radius, _FREE, cv2.FILLED)
        self._evidence = np.where(self._solid.occupied, self._evidence, marked)

    def _feel(self, x: float, y: float) -> None:
        """Mark what is around the point x, y [m] that was reached: no tour goes there twice.

        What is not joined to the robot within it lies behind something.
        """
        cells, _ = self._cells(np.array([[x, y], [self._pose.x, self._pose.y]]))
        disc = np.zeros(self._evidence.shape, np.uint8)
        center = int(cells[0, 1]), int(cells[0, 0])
        cv2.circle(disc, center, round(self._robot.radius / self._solid.cell), 1, cv2.FILLED)
        felt = (disc > 0) & ((self._evidence == 0) | self._solid.occupied)
        open_disc = ((disc > 0) & ~self._solid.occupied).view(np.uint8)
        _, labels = cv2.connectedComponents(open_disc, connectivity=4)
        robot = labels[cells[1, 0], cells[1, 1]]
        joined = (labels == robot) & (robot > 0)
        self._evidence[felt] = np.where(joined[felt], _FREE, _OCCUPIED)

    def _look(self) -> None:
        """Mark what is in view: free floor up to the first solid cell of each ray, and that."""
        pose, count = self._pose, len(self._away)
        angles = pose.yaw + self._rays
        x = pose.x + np.outer(np.cos(angles), self._away)
        y = pose.y + np.outer(np.sin(angles), self._away)
        cells, inside = self._cells(np.stack([x.ravel(), y.ravel()], axis=1))
        solid = self._solid.occupied[cells[:, 0], cells[:, 1]] | ~inside
        hits = np.cumsum(solid.reshape(-1, count), axis=1)
        first = (hits == 1) & solid.reshape(-1, count)
        free, wall = (hits == 0).ravel(), first.ravel() & inside
        self._evidence[cells[free, 0], cells[free, 1]] = _FREE
        self._evidence[cells[wall, 0], cells[wall, 1]] = _OCCUPIED
