"""Detections turned into observations: moved to the present time, matched to the map, weighted.

Successive detections of one landmark share their errors (of the map, of the camera's mount), so an
observation's weight depends on the time since the last one, not on the frame rate.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.signals import LandmarkDetection, Odometry, Pose
from navfw.topomap import Landmark, TopoMap

MAX_AGE = 2.0
"""Largest age of a detection [s]; older ones are dropped."""

_REPEAT_INTERVAL = 1.0
"""Time between two detections of one landmark from which they count as independent [s]."""

_DISTANCE_TOLERANCE = 0.05
"""Allowed error [m], beyond three sigmas, of the measured distance between two landmarks."""

_ODOMETRY_ERROR = 0.03
"""Odometry error between two observations, as a share of the distance driven."""


@dataclass(frozen=True, slots=True)
class LandmarkObservation:
    """A mapped landmark, observed from the robot's present pose.

    ``measured`` (2,) is (bearing [rad], range [m]) in base_link, ``noise`` (2, 2) its covariance;
    ``x``, ``y`` [m] is the observed position in ``odom``. ``weight`` in (0, 1] is the share of new
    information, given the last observation of the same landmark.
    """

    landmark: Landmark
    measured: Array
    noise: Array
    x: float
    y: float
    weight: float


class LandmarkObserver:
    """Turns detections into observations of mapped landmarks.

    ``map_sigma`` [m] is the standard deviation of the landmarks' mapped positions.
    """

    def __init__(self, topo_map: TopoMap, map_sigma: float) -> None:
        self._marks = topo_map.landmarks_by_identity
        self._map_sigma = map_sigma
        self._trail: deque[tuple[float, Pose]] = deque()
        self._last: dict[str, float] = {}

    def observe(
        self, odometry: Odometry, detections: Sequence[LandmarkDetection]
    ) -> list[LandmarkObservation]:
        """Observations from ``detections``, at the time of ``odometry``.

        Detections of unmapped landmarks and those older than ``MAX_AGE`` give none.
        """
        self._trail.append((odometry.time, odometry.pose))
        while self._trail[0][0] < odometry.time - MAX_AGE:
            self._trail.popleft()
        return list(self._observations(odometry, detections))

    def _observations(
        self, odometry: Odometry, detections: Sequence[LandmarkDetection]
    ) -> Iterator[LandmarkObservation]:
        for detection in detections:
            mark = self._marks.get(detection.identity)
            if mark is None or odometry.time - detection.time > MAX_AGE:
                continue
            then = self._pose_at(detection.time)
            ahead = detection.range * math.cos(detection.bearing)
            x, y = then.to_parent(ahead, detection.range * math.sin(detection.bearing))
            local = odometry.pose.to_local(x, y)
            distance = math.hypot(*local)
            if distance < 0.1:
                continue  # the bearing is undefined so near
            measured = np.array((math.atan2(local[1], local[0]), distance))
            noise = detection.covariance + np.diag(
                ((self._map_sigma / distance) ** 2, self._map_sigma**2)
            )
            since = detection.time - self._last.get(detection.identity, -math.inf)
            if since <= 0.0:
                continue
            self._last[detection.identity] = detection.time
            yield LandmarkObservation(
                mark, measured, noise, x, y, min(1.0, since / _REPEAT_INTERVAL)
            )

    def _pose_at(self, time: float) -> Pose:
        """The odometry pose nearest in time; camera frames are stamped with odometry's times."""
        return min(self._trail, key=lambda entry: abs(entry[0] - time))[1]


def consistent_observations(
    observations: Sequence[tuple[LandmarkObservation, float]],
) -> list[LandmarkObservation]:
    """The largest set found of pairwise consistent observations (greedy, from each as a seed).

    Each observation comes with the distance driven [m] when it was made. Two are consistent when
    the distance between their landmarks in ``odom`` agrees with that in the map.
    """
    found: list[LandmarkObservation] = []
    consistent = _consistency(observations)
    for first in range(len(observations)):
        members = [first]
        for other in range(len(observations)):
            if other != first and all(consistent[other][member] for member in members):
                members.append(other)
        if len(members) > len(found):
            found = [observations[member][0] for member in sorted(members)]
    return found


def _consistency(observations: Sequence[tuple[LandmarkObservation, float]]) -> list[list[bool]]:
    table = [[True] * len(observations) for _ in observations]
    for i, (a, driven_a) in enumerate(observations):
        for j, (b, driven_b) in enumerate(observations[:i]):
            measured = math.hypot(a.x - b.x, a.y - b.y)
            mapped = math.hypot(a.landmark.x - b.landmark.x, a.landmark.y - b.landmark.y)
            sigma = math.sqrt(float(a.noise[1, 1] + b.noise[1, 1]))
            allowed = _DISTANCE_TOLERANCE + 3.0 * sigma + _ODOMETRY_ERROR * abs(driven_a - driven_b)
            table[i][j] = table[j][i] = abs(measured - mapped) <= allowed
    return table
