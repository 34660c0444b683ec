"""Moving obstacles of a world: kinematic motion along a path, and their recorded positions.

A walker follows its path at constant speed, deterministic in simulated time, and nothing stops it.
One that yields waits as long as the robot is close in front of it, then continues.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navfw.numerics import Array
from navfw.signals import Pose
from navfw.sim.worldspec import WalkerSpec

_YIELD_DISTANCE = 0.6
"""A walker that yields waits when the gap to the robot in front of it is at most this [m]."""

_YIELD_MARGIN = 0.15
"""Margin [m] to either side of the lane, as wide as both bodies, that counts as in front."""

CLOSING_SPEED, CLOSING_TIME = 0.05, 1.0
"""The robot causes a contact when it approaches the walker faster than this [m/s], or has closed
more of the distance than the walker over this time [s]."""


class WalkerPath:
    """A walker's path, parametrised by the distance travelled along it."""

    def __init__(self, spec: WalkerSpec) -> None:
        corners = list(spec.path)
        if spec.walk == "loop":
            corners.append(corners[0])
        else:
            corners += corners[-2::-1]
        self._corners = corners
        self._starts = [0.0]
        for a, b in pairwise(corners):
            self._starts.append(self._starts[-1] + math.dist(a, b))

    @property
    def length(self) -> float:
        """Length [m] of one round, from the first point back to it."""
        return self._starts[-1]

    def pose_at(self, travelled: float) -> tuple[float, float, float]:
        """(x, y [m], heading [rad]) after ``travelled`` [m]; any number of rounds."""
        travelled %= self.length
        i = min(bisect_right(self._starts, travelled), len(self._corners) - 1) - 1
        (ax, ay), (bx, by) = self._corners[i], self._corners[i + 1]
        leg = self._starts[i + 1] - self._starts[i]
        share = (travelled - self._starts[i]) / leg
        return ax + share * (bx - ax), ay + share * (by - ay), math.atan2(by - ay, bx - ax)


class Walker:
    """A moving obstacle: ``x``, ``y`` [m], ``heading`` [rad], and whether it is ``waiting``."""

    def __init__(self, spec: WalkerSpec) -> None:
        self.spec = spec
        self.waiting = False
        self._path = WalkerPath(spec)
        self._travelled = spec.phase * self._path.length
        self.x, self.y, self.heading = self._path.pose_at(self._travelled)

    def update_waiting(self, robot: Pose, radius: float) -> None:
        """Set ``waiting`` by the pose and ``radius`` [m] of the robot."""
        if not self.spec.yields:
            return
        dx, dy = robot.x - self.x, robot.y - self.y
        c, s = math.cos(self.heading), math.sin(self.heading)
        both = self.spec.radius + radius
        self.waiting = (
            math.hypot(dx, dy) <= both + _YIELD_DISTANCE
            and c * dx + s * dy > 0.0
            and abs(c * dy - s * dx) <= both + _YIELD_MARGIN
        )

    def advance(self, dt: float) -> None:
        """Move on by ``dt`` [s], unless waiting."""
        if not self.waiting:
            self._travelled += self.spec.speed * dt
            self.x, self.y, self.heading = self._path.pose_at(self._travelled)


def caused_by_robot(before: Pose, after: Pose, dt: float, walker: Walker) -> bool:
    """Whether the robot's motion, from one pose to the next in ``dt`` [s], approached the walker.

    A robot that stands, moves away or passes by does not cause the contact.
    """
    dx, dy = walker.x - after.x, walker.y - after.y
    away = math.hypot(dx, dy)
    if away == 0.0 or dt <= 0.0:
        return False
    speed = ((after.x - before.x) * dx + (after.y - before.y) * dy) / (away * dt)
    return speed > CLOSING_SPEED


def closed_by_robot(robot: Array, walker: Array) -> bool:
    """Whether the robot's motion closed more of the distance between them than the walker's.

    ``robot`` and ``walker`` (n, 2) are positions [m] at the same times.
    """
    between = walker[:-1] - robot[:-1]
    away = np.maximum(np.hypot(between[:, 0], between[:, 1]), 1e-9)
    both = np.diff(robot, axis=0) + np.diff(walker, axis=0)
    return bool(np.sum(both * between / away[:, None]) > 0.0)


@dataclass(frozen=True)
class WalkerTrack:
    """Positions of walkers: ``time`` (T,) [s] ascending, ``points`` (T, M, 2), ``radii`` (M,) [m].

    Together with ``SceneGeometry``, the static solids, this is the geometry at any time.
    """

    names: tuple[str, ...]
    radii: Array
    time: Array
    points: Array

    @classmethod
    def of(cls, walkers: Sequence[Walker], time: list[float], points: list[Array]) -> WalkerTrack:
        """The track of positions (M, 2) recorded at ascending times [s]."""
        return cls(
            names=tuple(walker.spec.name for walker in walkers),
            radii=np.array([walker.spec.radius for walker in walkers]),
            time=np.array(time),
            points=np.array(points).reshape(len(time), len(walkers), 2),
        )

    def at(self, times: Array) -> Array:
        """Positions (N, M, 2) at times (N,) [s], interpolated; constant beyond either end."""
        after = np.clip(np.searchsorted(self.time, times), 1, max(len(self.time) - 1, 1))
        if len(self.time) < 2:
            return np.repeat(self.points[:1], len(times), axis=0)
        span = self.time[after] - self.time[after - 1]
        share = np.clip((times - self.time[after - 1]) / span, 0.0, 1.0)[:, None, None]
        return (1.0 - share) * self.points[after - 1] + share * self.points[after]

    def clearances(self, points: Array, times: Array) -> Array:
        """Distances (N,) [m] of points (N, 2) at times (N,) [s] to the nearest walker's body."""
        if not self.names:
            return np.full(len(points), np.inf)
        away = np.linalg.norm(self.at(times) - points[:, None, :], axis=2) - self.radii
        nearest: Array = away.min(axis=1)
        return nearest
