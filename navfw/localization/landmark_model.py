"""What a landmark at a known place looks like from a pose, and what a detection tells (METHOD 4.4).

A detection is (bearing [rad], range [m]) in base_link. A landmark may stand elsewhere than the map
says. So an update is one of probabilistic data association (Bar-Shalom and Tse 1975): with the
probability that the landmark stands where it should it is an EKF update (Joseph form), otherwise
none, and the covariance is that of the mixture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.signals import Array, wrap_angle

__all__ = ["ELSEWHERE", "GATE", "Association", "associate", "expected", "joseph"]

GATE = 9.0
"""Squared Mahalanobis distance of (bearing, range) beyond which a detection is not believed."""

ELSEWHERE = 0.05
"""Density [1/(rad m)] of detections of a landmark that is not where the map has it."""


def expected(state: Array, x: float, y: float) -> tuple[Array, Array]:
    """Bearing and range (2,) of the point (x, y) from ``state`` (4,), and their Jacobian (2, 4)."""
    dx, dy = x - state[0], y - state[1]
    squared = max(dx * dx + dy * dy, 1e-6)
    distance = math.sqrt(squared)
    seen = np.array((wrap_angle(math.atan2(dy, dx) - state[2]), distance))
    jacobian = np.array(
        (
            (dy / squared, -dx / squared, -1.0, 0.0),
            (-dx / distance, -dy / distance, 0.0, 0.0),
        )
    )
    return seen, jacobian


def joseph(covariance: Array, gain: Array, jacobian: Array, noise: Array) -> Array:
    """The covariance after an update; symmetric and positive for whatever gain."""
    left = np.eye(len(covariance)) - gain @ jacobian
    updated = left @ covariance @ left.T + gain @ noise @ gain.T
    return np.asarray(0.5 * (updated + updated.T))


@dataclass(frozen=True, slots=True)
class Association:
    """What a detection made of an estimate.

    ``distance`` is the squared Mahalanobis distance of the innovation; ``likelihood`` how much more
    likely the detection is with the landmark in its place than with it elsewhere; ``share`` the
    probability that it stands in its place, 0 outside the gate.
    """

    state: Array
    covariance: Array
    distance: float
    likelihood: float
    share: float


def associate(
    state: Array,
    covariance: Array,
    seen: Array,
    noise: Array,
    at: tuple[float, float],
    trust: float,
) -> Association:
    """Update (state, covariance) by ``seen`` (2,), with its ``noise`` (2, 2), of a landmark ``at``.

    ``trust`` is the prior probability that the landmark stands where the map has it.
    """
    predicted, jacobian = expected(state, *at)
    innovation = seen - predicted
    innovation[0] = wrap_angle(float(innovation[0]))
    spread = jacobian @ covariance @ jacobian.T + noise
    inverse = np.linalg.inv(spread)
    distance = float(innovation @ inverse @ innovation)
    density = math.exp(-0.5 * min(distance, 600.0)) * math.sqrt(max(np.linalg.det(inverse), 0.0))
    likelihood = density / (2.0 * math.pi) / ELSEWHERE
    if distance > GATE:
        return Association(state, covariance, distance, likelihood, 0.0)
    share = trust * likelihood / (trust * likelihood + 1.0 - trust)
    gain = covariance @ jacobian.T @ inverse
    step = gain @ innovation
    moved = state + share * step
    moved[2] = wrap_angle(float(moved[2]))
    updated = joseph(covariance, gain, jacobian, noise)
    mixed = share * updated + (1.0 - share) * covariance
    mixed += share * (1.0 - share) * np.outer(step, step)
    return Association(moved, mixed, distance, likelihood, share)
