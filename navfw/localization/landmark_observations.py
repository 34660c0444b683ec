"""Detections as evidence: brought to the present moment, and counted once, not once a frame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array, LandmarkDetection, Odometry, Pose
from navfw.topomap import Landmark, TopoMap

__all__ = ["Look", "Looks", "agreeing"]

MEMORY = 2.0
"""Detections older than this [s] are not used."""

REPEAT = 1.0
"""Detections of one landmark share their errors: all those of so long [s] count as one."""

AGREE = 0.05
"""Distances of two landmarks agree when they differ by three sigmas and so much [m]."""

DRIFT = 0.03
"""Odometry between two looks may be off by this share of the way."""


@dataclass(frozen=True, slots=True)
class Look:
    """A mapped landmark as seen from where the robot is now.

    ``seen`` (2,) is (bearing [rad], range [m]) in base_link, ``noise`` (2, 2) its covariance;
    ``x``, ``y`` [m] is where it was seen, in odom. ``weight`` in (0, 1] says how much this look
    adds to the last one at the same landmark.
    """

    landmark: Landmark
    seen: Array
    noise: Array
    x: float
    y: float
    weight: float


class Looks:
    """Turns detections into looks; ``placed`` [m] is how exactly the map has its landmarks."""

    def __init__(self, topo_map: TopoMap, placed: float) -> None:
        self._marks = topo_map.landmarks_by_identity
        self._placed = placed
        self._trail: deque[tuple[float, Pose]] = deque()
        self._last: dict[str, float] = {}

    def hear(self, odometry: Odometry, detections: Sequence[LandmarkDetection]) -> list[Look]:
        """The looks that ``detections`` are at the time of ``odometry``; unmapped ones are none."""
        self._trail.append((odometry.time, odometry.pose))
        while self._trail[0][0] < odometry.time - MEMORY:
            self._trail.popleft()
        return list(self._looks(odometry, detections))

    def _looks(self, odometry: Odometry, detections: Sequence[LandmarkDetection]) -> Iterator[Look]:
        for detection in detections:
            mark = self._marks.get(detection.identity)
            if mark is None or odometry.time - detection.time > MEMORY:
                continue
            then = self._pose_at(detection.time)
            ahead = detection.range * math.cos(detection.bearing)
            x, y = then.to_parent(ahead, detection.range * math.sin(detection.bearing))
            local = odometry.pose.to_local(x, y)
            distance = math.hypot(*local)
            if distance < 0.1:
                continue  # no bearing so near
            seen = np.array((math.atan2(local[1], local[0]), distance))
            noise = detection.covariance + np.diag(
                ((self._placed / distance) ** 2, self._placed**2)
            )
            since = detection.time - self._last.get(detection.identity, -math.inf)
            if since <= 0.0:
                continue
            self._last[detection.identity] = detection.time
            yield Look(mark, seen, noise, x, y, min(1.0, since / REPEAT))

    def _pose_at(self, time: float) -> Pose:
        """Where odometry was then; camera frames come with its times."""
        return min(self._trail, key=lambda entry: abs(entry[0] - time))[1]


def agreeing(looks: Sequence[tuple[Look, float]]) -> list[Look]:
    """The most of ``looks``, each with the way driven until then, that agree with each other.

    Two of them agree when the landmarks are as far from each other in odom as in the map.
    """
    found: list[Look] = []
    agree = _agreements(looks)
    for first in range(len(looks)):
        members = [first]
        for other in range(len(looks)):
            if other != first and all(agree[other][member] for member in members):
                members.append(other)
        if len(members) > len(found):
            found = [looks[member][0] for member in sorted(members)]
    return found


def _agreements(looks: Sequence[tuple[Look, float]]) -> list[list[bool]]:
    table = [[True] * len(looks) for _ in looks]
    for i, (a, driven_a) in enumerate(looks):
        for j, (b, driven_b) in enumerate(looks[:i]):
            measured = math.hypot(a.x - b.x, a.y - b.y)
            mapped = math.hypot(a.landmark.x - b.landmark.x, a.landmark.y - b.landmark.y)
            sigma = math.sqrt(float(a.noise[1, 1] + b.noise[1, 1]))
            allowed = AGREE + 3.0 * sigma + DRIFT * abs(driven_a - driven_b)
            table[i][j] = table[j][i] = abs(measured - mapped) <= allowed
    return table
