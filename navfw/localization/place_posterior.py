"""What an uncertain position tells: how sure it is, and how probable each place of the map."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from navfw.errors import InputError
from navfw.signals import Array, Pose, position_sigma
from navfw.topomap import TopoMap

__all__ = [
    "AT_PLACE",
    "COUNT",
    "REFRESH",
    "WITHIN",
    "PlacesNearby",
    "known_start",
    "likeliest_places",
    "within",
]

AT_PLACE = 1.0
"""How far around a place is still 'at' it [m]."""

COUNT = 8
"""How many of the likeliest places a belief names."""

REFRESH = 0.05
"""Places are weighed again after so much motion [m]."""

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


class PlacesNearby:
    """The likeliest places about a pose that moves, weighed again after ``refresh`` [m] alone."""

    def __init__(
        self,
        topo_map: TopoMap,
        reach: float = AT_PLACE,
        count: int = COUNT,
        refresh: float = REFRESH,
    ) -> None:
        self._map = topo_map
        self._reach, self._count, self._refresh = reach, count, refresh
        self._weighed_at = (math.inf, math.inf)
        self._places: Mapping[str, float] = {}

    def at(self, pose: Pose, covariance: Array) -> Mapping[str, float]:
        """Their probabilities (see ``likeliest_places``), by ``covariance`` (3, 3) of ``pose``."""
        if math.dist((pose.x, pose.y), self._weighed_at) > self._refresh:
            self._places = likeliest_places(self._map, pose, covariance, self._reach, self._count)
            self._weighed_at = (pose.x, pose.y)
        return self._places


def known_start(pose: Pose | None, localizer: str, instead: str) -> Pose:
    """The start ``pose``, for a ``localizer`` that cannot look for it.

    Raises:
        InputError: it is None; the message recommends ``instead`` to the stack.

    """
    if pose is None:
        raise InputError(
            f"the localizer {localizer!r} cannot find an unknown start; give the mission a start "
            f"pose, or the stack {instead}"
        )
    return pose


def within(covariance: Array, radius: float = WITHIN) -> float:
    """The probability, at least, that the position is no farther off than ``radius`` [m]."""
    sigma = position_sigma(covariance)
    return 1.0 if sigma == 0.0 else -math.expm1(-0.5 * (radius / sigma) ** 2)
