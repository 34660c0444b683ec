"""Those who walk: kinematic, deterministic in simulated time; where they were, for the metrics.

A mover walks its path at constant speed and is stopped by nothing. Only one that yields waits, as
long as the robot is near in front of it, and goes on where it was.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navfw.signals import Array, Pose
from navfw.sim.worldspec import MoverSpec

__all__ = ["CLOSING", "POLITE_DISTANCE", "Mover", "MoverTrack", "Walkway", "caused_by_robot"]

POLITE_DISTANCE = 0.6
"""Who yields stops when the robot's body is so near [m] in front."""

_ASIDE = 0.15
"""In front means: on the walker's way, as wide as both bodies and so much [m] on either side."""

CLOSING = 0.05
"""A robot that approaches faster than this [m/s] has itself to blame for a touch."""


class Walkway:
    """A mover's path by the distance walked along it."""

    def __init__(self, spec: MoverSpec) -> None:
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
        """Length [m] of one round: back at the first point, about to walk the same again."""
        return self._starts[-1]

    def at(self, walked: float) -> tuple[float, float, float]:
        """(x, y [m], heading [rad]) after ``walked`` [m]; any number of rounds."""
        walked %= self.length
        i = min(bisect_right(self._starts, walked), len(self._corners) - 1) - 1
        (ax, ay), (bx, by) = self._corners[i], self._corners[i + 1]
        leg = self._starts[i + 1] - self._starts[i]
        share = (walked - self._starts[i]) / leg
        return ax + share * (bx - ax), ay + share * (by - ay), math.atan2(by - ay, bx - ax)


class Mover:
    """One who walks: ``x``, ``y`` [m], ``heading`` [rad], and whether it is ``waiting``."""

    def __init__(self, spec: MoverSpec) -> None:
        self.spec = spec
        self.waiting = False
        self._way = Walkway(spec)
        self._walked = spec.phase * self._way.length
        self.x, self.y, self.heading = self._way.at(self._walked)

    def look(self, robot: Pose, radius: float) -> None:
        """Decide whether to wait for a robot of that ``radius`` [m]."""
        if not self.spec.yields:
            return
        dx, dy = robot.x - self.x, robot.y - self.y
        c, s = math.cos(self.heading), math.sin(self.heading)
        both = self.spec.radius + radius
        self.waiting = (
            math.hypot(dx, dy) <= both + POLITE_DISTANCE
            and c * dx + s * dy > 0.0
            and abs(c * dy - s * dx) <= both + _ASIDE
        )

    def walk(self, dt: float) -> None:
        """Walk on for ``dt`` [s], unless waiting."""
        if not self.waiting:
            self._walked += self.spec.speed * dt
            self.x, self.y, self.heading = self._way.at(self._walked)


def caused_by_robot(
    before: Pose, after: Pose, dt: float, mover: Mover, closing: float = CLOSING
) -> bool:
    """Whether the robot's own motion, from one pose to the next, led towards the mover.

    Who stands, or drives away, or slides past, is run into; all else is running into someone.
    """
    dx, dy = mover.x - after.x, mover.y - after.y
    away = math.hypot(dx, dy)
    if away == 0.0 or dt <= 0.0:
        return False
    speed = ((after.x - before.x) * dx + (after.y - before.y) * dy) / (away * dt)
    return speed > closing


@dataclass(frozen=True)
class MoverTrack:
    """Where movers were: ``time`` (T,) [s] ascending, ``points`` (T, M, 2), ``radii`` (M,) [m].

    Together with a floor plan, which holds what stands still, this is the plan at any time.
    """

    names: tuple[str, ...]
    radii: Array
    time: Array
    points: Array

    @classmethod
    def of(cls, movers: Sequence[Mover], time: list[float], points: list[Array]) -> MoverTrack:
        """The track of what has been noted so far."""
        return cls(
            names=tuple(mover.spec.name for mover in movers),
            radii=np.array([mover.spec.radius for mover in movers]),
            time=np.array(time),
            points=np.array(points).reshape(len(time), len(movers), 2),
        )

    def at(self, times: Array) -> Array:
        """(N, M, 2) where the movers were at times (N,) [s]; before and after, at either end."""
        after = np.clip(np.searchsorted(self.time, times), 1, max(len(self.time) - 1, 1))
        if len(self.time) < 2:
            return np.repeat(self.points[:1], len(times), axis=0)
        span = self.time[after] - self.time[after - 1]
        share = np.clip((times - self.time[after - 1]) / span, 0.0, 1.0)[:, None, None]
        result: Array = (1.0 - share) * self.points[after - 1] + share * self.points[after]
        return result

    def clearances(self, points: Array, times: Array) -> Array:
        """(N,) distances [m] of points (N, 2) at times (N,) [s] to the nearest mover's body."""
        if not self.names:
            return np.full(len(points), np.inf)
        away = np.linalg.norm(self.at(times) - points[:, None, :], axis=2) - self.radii
        nearest: Array = away.min(axis=1)
        return nearest
