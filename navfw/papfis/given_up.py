"""Frontiers that are pursued and given up, and passages that are too narrow to explore beyond."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from navfw.numerics import Array
from navfw.papfis.known_ground import Frontier, KnownGround

_NEARER = 0.2  # chosen
"""Length [m] by which the path to a frontier gets shorter, which is progress."""
_SEEN = 0.08  # chosen
"""Area [m^2] of floor seen for the first time, which is progress as well."""
_COVERED = 0.8  # chosen
"""Distance [m] around a frontier that was given up in which others count as the same."""
_CHANGED = 0.3  # chosen
"""Share by which the gain of a frontier that was given up changes until it is tried again."""
_ROOM = 0.4  # chosen
"""Area [m^2] of floor on which the body has room, but to which no path leads, that is reported."""
_BIG, _AWAY = 2.0, 1.2  # chosen
"""Gain [m^2] of a frontier that is tried again at once, and the robot's distance [m] for that."""


class Pursuit:
    """Watches whether a robot makes progress on its way to one frontier, from ``time`` [s] on.

    ``length`` [m] is that of the path there, and stays as ``begin``; ``known`` [m^2] is the area
    of the floor that is known. There is no progress ``since`` then [s].
    """

    def __init__(self, time: float, length: float, known: float) -> None:
        self.since, self._length, self._known = time, length, known
        self.begin = length

    def update(self, time: float, length: float, known: float) -> None:
        """Take in a plan at ``time`` [s]: its ``length`` [m], and the ``known`` area [m^2]."""
        if length < self._length - _NEARER or known > self._known + _SEEN:
            self.since, self._known = time, known
            self._length = min(length, self._length)


@dataclass(frozen=True, slots=True)
class GivenUp:
    """A frontier at x, y [m, map] that was given up for a ``reason``, at a ``gain`` [m^2].

    ``tries`` is how often that was so. It is ``open`` while it is tried again.
    """

    x: float
    y: float
    gain: float
    reason: str
    tries: int = 1
    open: bool = False

    def seen_from(self, robot: tuple[float, float]) -> GivenUp:
        """Open it once if it is large, and a ``robot`` at x, y [m] can come facing it."""
        away = math.dist((self.x, self.y), robot) >= _AWAY
        return replace(self, open=True) if away and self.tries == 1 and self.gain >= _BIG else self

    def covers(self, frontier: Frontier) -> bool:
        """Return whether ``frontier`` is the one that was given up, and nothing has changed."""
        changed = abs(frontier.gain - self.gain) > _CHANGED * self.gain
        return self.is_at(frontier) and not (changed or self.open)

    def is_at(self, frontier: Frontier) -> bool:
        """Return whether ``frontier`` is where this one was given up, changed or not."""
        return math.dist((self.x, self.y), (frontier.x, frontier.y)) <= _COVERED


def narrow_passages(ground: KnownGround, costs: Array) -> list[tuple[float, float]]:
    """Return a point (x, y) [m] of each room that was seen, but to which no path leads.

    ``costs`` are those of the paths from the robot.
    """
    apart = np.isfinite(ground.price) & ~np.isfinite(costs)
    _, _, stats, middles = cv2.connectedComponentsWithStats(apart.view(np.uint8), connectivity=4)
    large = stats[:, cv2.CC_STAT_AREA] * ground.cell**2 >= _ROOM
    large[0] = False
    points = ground.points(np.rint(middles[large][:, ::-1]).astype(np.int64))
    return [(float(x), float(y)) for x, y in points]
