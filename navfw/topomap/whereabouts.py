"""What an uncertain position tells: how sure it is, and how probable each place of the map."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from navfw.signals import Array, Pose, position_sigma
from navfw.topomap.model import TopoMap

__all__ = ["AT_PLACE", "COUNT", "WITHIN", "likeliest_places", "within"]

AT_PLACE = 1.0
"""How far around a place is still 'at' it [m]."""

COUNT = 8
"""How many of the likeliest places a belief names."""

WITHIN = 1.0
"""A belief's confidence is the probability that the robot is no farther from its pose [m]."""


def likeliest_places(
    topo_map: TopoMap, pose: Pose, covariance: Array, reach: float = AT_PLACE, count: int = COUNT
) -> Mapping[str, float]:
    """The ``count`` likeliest places with their probabilities, likeliest first; they sum to 1.

    ``covariance`` (3, 3) is that of ``pose`` (x, y, yaw); within ``reach`` [m] of a place one is at
    it.
    """
    spread = reach**2 + 0.5 * float(np.trace(covariance[:2, :2]))
    squared = topo_map.place_distances(pose.x, pose.y) ** 2
    count = min(count, len(squared))
    likeliest = np.argpartition(squared, count - 1)[:count]
    likeliest = likeliest[np.argsort(squared[likeliest], kind="stable")]
    # relative to the nearest, so that far from every place something is still above zero
    weights = np.exp(-0.5 * (squared[likeliest] - squared[likeliest[0]]) / spread)
    weights /= weights.sum()
    names = list(topo_map.places)
    return {names[i]: float(w) for i, w in zip(likeliest.tolist(), weights, strict=True)}


def within(covariance: Array, radius: float = WITHIN) -> float:
    """The probability, at least, that the position is no farther off than ``radius`` [m]."""
    sigma = position_sigma(covariance)
    return 1.0 if sigma == 0.0 else -math.expm1(-0.5 * (radius / sigma) ** 2)
