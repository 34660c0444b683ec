"""Place posterior: the probability of each place of the map, given an uncertain position."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from navfw.errors import InputError
from navfw.interfaces import Localizer
from navfw.numerics import Array
from navfw.numerics.functions import exp
from navfw.signals import Pose, position_sigma
from navfw.topomap import TopoMap

PLACE_RADIUS = 1.0
"""Standard deviation [m] of the robot's position when it is at a place."""

COUNT = 8
"""Number of places that a belief lists, likeliest first."""

REFRESH = 0.05
"""Distance moved [m] after which the place posterior is computed again."""

_CONFIDENCE_RADIUS = 1.0
"""A belief's confidence is the probability that its position error is below this [m]."""


def likeliest_places(
    topo_map: TopoMap,
    pose: Pose,
    covariance: Array,
    radius: float = PLACE_RADIUS,
    count: int = COUNT,
) -> Mapping[str, float]:
    """The ``count`` likeliest places with their probabilities, likeliest first; they sum to 1.

    ``covariance`` (3, 3) is that of ``pose`` (x, y, yaw); ``radius`` [m] is the standard deviation
    of the position of a robot at a place.
    """
    spread = radius**2 + 0.5 * float(np.trace(covariance[:2, :2]))
    squared = topo_map.place_distances(pose.x, pose.y) ** 2
    count = min(count, len(squared))
    likeliest = np.argsort(squared, kind="stable")[:count]
    # relative to the nearest place, so that the weights do not all underflow far from every place
    weights = exp(-0.5 * (squared[likeliest] - squared[likeliest[0]]) / spread)
    weights /= weights.sum()
    names = list(topo_map.places)
    return {names[i]: float(w) for i, w in zip(likeliest.tolist(), weights, strict=True)}


class PlacePosterior:
    """The likeliest places of a moving pose, computed again after ``refresh`` [m] only."""

    def __init__(
        self,
        topo_map: TopoMap,
        radius: float = PLACE_RADIUS,
        count: int = COUNT,
        refresh: float = REFRESH,
    ) -> None:
        self._map = topo_map
        self._radius, self._count, self._refresh = radius, count, refresh
        self._computed_at = (math.inf, math.inf)
        self._places: Mapping[str, float] = {}

    def at(self, pose: Pose, covariance: Array) -> Mapping[str, float]:
        """Place probabilities (``likeliest_places``) for ``pose`` with ``covariance`` (3, 3)."""
        if math.dist((pose.x, pose.y), self._computed_at) > self._refresh:
            self._places = likeliest_places(self._map, pose, covariance, self._radius, self._count)
            self._computed_at = (pose.x, pose.y)
        return self._places


class PlaceLocalizer(Localizer):
    """A localiser whose beliefs list the likeliest places of the map.

    Its ``start`` sets ``posterior``; reading that before raises RuntimeError.
    """

    _posterior: PlacePosterior | None = None

    def reset(self) -> None:
        """Back to the state before ``start``."""
        self._posterior = None

    @property
    def posterior(self) -> PlacePosterior:
        """The place posterior of the pose."""
        if self._posterior is None:
            raise RuntimeError("start() comes before update()")
        return self._posterior


def known_start(pose: Pose | None, localizer: str, instead: str) -> Pose:
    """The start ``pose``, for a ``localizer`` that cannot search for an unknown one.

    Raises:
        InputError: ``pose`` is None; the message recommends ``instead``.

    """
    if pose is None:
        raise InputError(
            f"the localizer {localizer!r} cannot find an unknown start; give the mission a start "
            f"pose, or the stack {instead}"
        )
    return pose


def probability_within(covariance: Array, radius: float = _CONFIDENCE_RADIUS) -> float:
    """A lower bound on the probability that the position error is at most ``radius`` [m]."""
    sigma = position_sigma(covariance)
    return 1.0 if sigma == 0.0 else -math.expm1(-0.5 * (radius / sigma) ** 2)
