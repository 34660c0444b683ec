"""Landmarks: their existence, observations of them, and the update by one (METHOD 4.4).

Detections, (bearing [rad], range [m]) in base_link, become observations: moved to the present time,
matched to the map, and weighted. Successive detections of one landmark share their errors (of the
map, of the camera's mount), so the weight depends on the time since the last one, not on the frame
rate.

A landmark may be displaced from its mapped position, so the update is one of probabilistic data
association (Bar-Shalom and Tse 1975): with the probability that the landmark is in its place it is
an EKF update (Joseph form), otherwise none, and the covariance is that of the mixture.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.numerics import Array
from navfw.numerics.linear_systems import determinant, inverse
from navfw.numerics.products import product
from navfw.signals import LandmarkDetection, Odometry, Pose, wrap_angle
from navfw.topomap import Landmark, TopoMap

_MAX_GAIN, _MAX_LOSS = 1.0, -1.5  # chosen
"""Bounds on the log-odds that one observation adds."""

_MIN_LOG_ODDS, _MAX_LOG_ODDS = -5.0, 4.0  # derived
"""Bounds on the log-odds of a landmark: probabilities 0.007 and 0.98."""

_TINY = 1e-30  # chosen

MAP_SIGMA = 0.03  # chosen
"""Standard deviation of the landmarks' mapped positions [m]."""


class LandmarkExistence:
    """Estimates whether each landmark stands where mapped, from ``prior`` in (0, 1) on."""

    def __init__(self, prior: float) -> None:
        self._prior = math.log(prior / (1.0 - prior))
        self._odds: dict[str, float] = {}

    def probability(self, identity: str) -> float:
        """Return the probability that the landmark stands where the map has it."""
        return 1.0 / (1.0 + math.exp(-self._odds.get(identity, self._prior)))

    def update(self, identity: str, likelihood_ratio: float, weight: float = 1.0) -> None:
        """Update the landmark's probability by an observation.

        ``likelihood_ratio`` is the observation's likelihood with the landmark in its place, over
        that with it elsewhere; ``weight`` in (0, 1] scales its logarithm.
        """
        evidence = min(max(math.log(max(likelihood_ratio, _TINY)), _MAX_LOSS), _MAX_GAIN)
        odds = self._odds.get(identity, self._prior) + weight * evidence
        self._odds[identity] = min(max(odds, _MIN_LOG_ODDS), _MAX_LOG_ODDS)

    def reset(self, fits: Callable[[str], bool]) -> None:
        """Reset landmarks below the prior if ``fits(identity)``: the pose was wrong, not they."""
        for identity in [name for name, odds in self._odds.items() if odds < self._prior]:
            if fits(identity):
                del self._odds[identity]


GATE = 9.0  # derived
"""Association gate: squared Mahalanobis distance of (bearing, range) beyond which a detection is
rejected. 99 % of correct detections are nearer (chi-square, two degrees of freedom)."""

ELSEWHERE_DENSITY = 0.05  # chosen
"""Density [1/(rad m)] of detections of a landmark that is not where the map has it."""


def expected_measurement(state: Array, x: float, y: float) -> tuple[Array, Array]:
    """Predict bearing, range (2,) of the point (x, y) from ``state`` (4,), and Jacobian (2, 4)."""
    dx, dy = x - state[0], y - state[1]
    squared = max(dx * dx + dy * dy, 1e-6)
    distance = math.sqrt(squared)
    expected = np.array((wrap_angle(math.atan2(dy, dx) - state[2]), distance))
    jacobian = np.array(
        (
            (dy / squared, -dx / squared, -1.0, 0.0),
            (-dx / distance, -dy / distance, 0.0, 0.0),
        )
    )
    return expected, jacobian


def joseph(covariance: Array, gain: Array, jacobian: Array, noise: Array) -> Array:
    """Update a covariance (n, n) by a measurement of m values, in Joseph's form.

    The result is symmetric and positive semidefinite for any ``gain`` (n, m); ``jacobian`` (m, n)
    is of the measurement, ``noise`` (m, m) its covariance.
    """
    left = np.eye(len(covariance)) - product(gain, jacobian)
    updated = product(left, covariance, left.T) + product(gain, noise, gain.T)
    return np.asarray(0.5 * (updated + updated.T))


@dataclass(frozen=True, slots=True)
class Association:
    """The estimate after a detection, and how well the detection fitted.

    ``state`` (4,) and ``covariance`` (4, 4) are the updated estimate. ``distance`` is the squared
    Mahalanobis distance of the innovation; ``likelihood_ratio`` the detection's likelihood with the
    landmark in its place over that with it elsewhere; ``probability`` the posterior probability
    that the landmark is in its place, 0 outside the gate.
    """

    state: Array
    covariance: Array
    distance: float
    likelihood_ratio: float
    probability: float


def associate(
    state: Array,
    covariance: Array,
    measured: Array,
    noise: Array,
    at: tuple[float, float],
    existence: float,
) -> Association:
    """Update ``state`` (4,) and ``covariance`` (4, 4) by a detection of a landmark mapped ``at``.

    ``measured`` (2,) is bearing [rad] and range [m] with the covariance ``noise`` (2, 2), ``at``
    (x, y) [m] in ``map``; ``existence`` is the prior probability that the landmark is there.
    """
    predicted, jacobian = expected_measurement(state, *at)
    innovation = measured - predicted
    innovation[0] = wrap_angle(float(innovation[0]))
    spread = product(jacobian, covariance, jacobian.T) + noise
    information = inverse(spread)
    distance = float(product(innovation, information, innovation))
    density = math.exp(-0.5 * min(distance, 600.0)) * math.sqrt(max(determinant(information), 0.0))
    ratio = density / (2.0 * math.pi) / ELSEWHERE_DENSITY
    if distance > GATE:
        return Association(state, covariance, distance, ratio, 0.0)
    probability = existence * ratio / (existence * ratio + 1.0 - existence)
    gain = product(covariance, jacobian.T, information)
    step = product(gain, innovation)
    moved = state + probability * step
    moved[2] = wrap_angle(float(moved[2]))
    updated = joseph(covariance, gain, jacobian, noise)
    mixed = probability * updated + (1.0 - probability) * covariance
    mixed += probability * (1.0 - probability) * np.outer(step, step)
    return Association(moved, mixed, distance, ratio, probability)


MAX_AGE = 2.0  # chosen
"""Largest age of a detection [s]; older ones are dropped."""

_REPEAT_INTERVAL = 1.0  # chosen
"""Time between two detections of one landmark from which they count as independent [s]."""

_DISTANCE_TOLERANCE = 0.05  # chosen
"""Allowed error [m], beyond three sigmas, of the measured distance between two landmarks."""

_ODOMETRY_ERROR = 0.03  # chosen
"""Odometry error between two observations, as a share of the distance driven."""


@dataclass(frozen=True, slots=True)
class LandmarkObservation:
    """An observation of a mapped landmark, moved by odometry to the robot's present pose.

    ``measured`` (2,) is its bearing [rad] and range [m] in base_link, ``noise`` (2, 2) their
    covariance, with that of the mapped position; ``x``, ``y`` [m] is where it was seen in ``odom``.
    ``weight`` in (0, 1] is the share of new information: 1 from 1 s after the last observation on.
    """

    landmark: Landmark
    measured: Array
    noise: Array
    x: float
    y: float
    weight: float


class LandmarkObserver:
    """Converts landmark detections to observations of mapped landmarks."""

    def __init__(self, topo_map: TopoMap) -> None:
        self._marks = topo_map.landmarks_by_identity
        self._trail: deque[tuple[float, Pose]] = deque()
        self._last: dict[str, float] = {}

    def observe(
        self, odometry: Odometry, detections: Sequence[LandmarkDetection]
    ) -> list[LandmarkObservation]:
        """Convert ``detections`` to observations at the time of ``odometry``.

        Those of unmapped landmarks, older than 2 s, seen before or nearer than 0.1 m are dropped.
        """
        self._trail.append((odometry.time, odometry.pose))
        while self._trail[0][0] < odometry.time - MAX_AGE:
            self._trail.popleft()
        observations = []
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
            noise = detection.covariance + np.diag(((MAP_SIGMA / distance) ** 2, MAP_SIGMA**2))
            since = detection.time - self._last.get(detection.identity, -math.inf)
            if since <= 0.0:
                continue
            self._last[detection.identity] = detection.time
            weight = min(1.0, since / _REPEAT_INTERVAL)
            observations.append(LandmarkObservation(mark, measured, noise, x, y, weight))
        return observations

    def _pose_at(self, time: float) -> Pose:
        """Return the odometry pose nearest in time; frames are stamped with odometry's times."""
        return min(self._trail, key=lambda entry: abs(entry[0] - time))[1]


def consistent_observations(
    observations: Sequence[tuple[LandmarkObservation, float]],
) -> list[LandmarkObservation]:
    """Return the largest set of pairwise consistent observations, by greedy search from each.

    Each observation comes with the distance driven [m] when it was made. Two are consistent when
    the distance between their landmarks in ``odom`` agrees with that in the map.
    """
    largest: list[LandmarkObservation] = []
    consistent = _consistency(observations)
    for first in range(len(observations)):
        members = [first]
        for other in range(len(observations)):
            if other != first and all(consistent[other][member] for member in members):
                members.append(other)
        if len(members) > len(largest):
            largest = [observations[member][0] for member in sorted(members)]
    return largest


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
