"""Metric scale of a single camera: speed and camera height, related by the floor.

Flow gives distances as multiples of the baseline. If the floor is visible, it gives the camera's
height as a multiple of the baseline, too. A known speed thus yields the height, and a known height
the speed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

_NOMINAL_SPEED = 0.35
"""Speed assumed if the scale is unknown [m/s]: the limits of OFFIS's distance terms in metres,
divided by this speed, are those of its terms of time to contact in seconds."""
NO_FLOOR = 50.0
"""Camera height if no floor is visible [m]: all cells below the horizon then count as objects."""


@dataclass(frozen=True, slots=True)
class Scale:
    """The ``speed`` [m/s] and camera ``height`` [m] that OFFIS uses.

    ``source`` is "speed" if the speed was given, "height" if the speed follows from a given height
    and the floor, and "none" if the scale is unknown: only ratios of distances are then meaningful.
    """

    speed: float
    height: float
    source: str

    @property
    def metric(self) -> bool:
        """Whether distances are in metres."""
        return self.source != "none"

    @property
    def floor(self) -> bool:
        """Whether the height above the floor is known."""
        return self.height < NO_FLOOR


@dataclass
class ScaleEstimator:
    """Estimates unknown ``speed`` [m/s] or ``height`` [m] from the floor of recent images."""

    speed: float | None
    height: float | None
    _ratios: deque[float] = field(default_factory=lambda: deque(maxlen=31))

    def update(self, ratio: float | None) -> Scale:
        """The scale after a measured ``ratio`` [1/s] of speed to height; None without floor."""
        if ratio is not None:
            self._ratios.append(ratio)
        usual = float(np.median(self._ratios)) if self._ratios else None
        if self.speed is not None:
            height = self.height or (NO_FLOOR if usual is None else self.speed / usual)
            return Scale(self.speed, min(max(height, 0.05), NO_FLOOR), "speed")
        now = ratio or usual
        if now is None:
            return Scale(_NOMINAL_SPEED, NO_FLOOR, "none")
        if self.height is not None:
            return Scale(self.height * now, self.height, "height")
        return Scale(_NOMINAL_SPEED, min(max(_NOMINAL_SPEED / now, 0.05), NO_FLOOR), "none")
