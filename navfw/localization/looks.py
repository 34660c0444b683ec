"""Sightings as evidence: brought to the present moment, and counted once, not once a frame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array, Odometry, Pose, Sighting
from navfw.topomap.model import Landmark, TopoMap

__all__ = ["Look", "Looks"]

MEMORY = 2.0
"""Sightings older than this [s] are not used."""

REPEAT = 1.0
"""Sightings of one landmark share their errors: all those of so long [s] count as one."""


@dataclass(frozen=True, slots=True)
class Look:
    """A mapped landmark as seen from where the robot is now.

    ``seen`` (2,) is (bearing [rad], range [m]) in base_link, ``noise`` (2, 2) its covariance;
    ``x``, ``y`` [m] is where it was seen, in odom. ``weight`` in (0, 1] says how much this look adds
    to the last one at the same landmark.
    """

    landmark: Landmark
    seen: Array
    noise: Array
    x: float
    y: float
    weight: float


class Looks:
    """Turns sightings into looks; ``placed`` [m] is how exactly the map has its landmarks."""

    def __init__(self, topo_map: TopoMap, placed: float) -> None:
        self._marks = topo_map.landmarks_by_identity
        self._placed = placed
        self._trail: deque[tuple[float, Pose]] = deque()
        self._last: dict[str, float] = {}

    def hear(self, odometry: Odometry, sightings: Sequence[Sighting]) -> list[Look]:
        """The looks that ``sightings`` are at the time of ``odometry``; unmapped ones are none."""
        self._trail.append((odometry.time, odometry.pose))
        while self._trail[0][0] < odometry.time - MEMORY:
            self._trail.popleft()
        return list(self._looks(odometry, sightings))

    def _looks(self, odometry: Odometry, sightings: Sequence[Sighting]) -> Iterator[Look]:
        for sighting in sightings:
            mark = self._marks.get(sighting.identity)
            if mark is None or odometry.time - sighting.time > MEMORY:
                continue
            then = self._pose_at(sighting.time)
            ahead = sighting.range * math.cos(sighting.bearing)
            x, y = then.to_parent(ahead, sighting.range * math.sin(sighting.bearing))
            local = odometry.pose.to_local(x, y)
            distance = math.hypot(*local)
            if distance < 0.1:
                continue  # no bearing so near
            seen = np.array((math.atan2(local[1], local[0]), distance))
            noise = sighting.covariance + np.diag(
                ((self._placed / distance) ** 2, self._placed**2)
            )
            since = sighting.time - self._last.get(sighting.identity, -math.inf)
            if since <= 0.0:
                continue
            self._last[sighting.identity] = sighting.time
            yield Look(mark, seen, noise, x, y, min(1.0, since / REPEAT))

    def _pose_at(self, time: float) -> Pose:
        """Where odometry was then; camera frames come with its times."""
        return min(self._trail, key=lambda entry: abs(entry[0] - time))[1]
