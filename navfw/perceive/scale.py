"""Metric scale of a single camera: speed and camera height, related by the floor.

Flow gives distances as multiples of the baseline. If the floor is visible, it gives the camera's
height as a multiple of the baseline, too. A known speed thus yields the height, and a known height
the speed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from navfw.robot import CameraModel
from navfw.signals import Array, FlowField

__all__ = ["NO_FLOOR", "Scale", "ScaleEstimator", "floor_ratio"]

NOMINAL_SPEED = 0.35
"""Speed assumed if the scale is unknown [m/s]: the limits of OFFIS's distance terms in metres,
divided by this speed, are those of its terms of time to contact in seconds."""
NO_FLOOR = 50.0
"""Camera height if no floor is visible [m]: all cells below the horizon then count as objects."""
_SAME = 0.12  # half the width of a cluster of log ratios that is one floor
_LEAST_CELLS = 8  # least number of cells of a floor
_LEAST_SHARE = 0.3  # least share of the cells below the horizon
_LEAST_SPAN = 1.6  # least ratio of the descents of its rays: a wall resembles a floor on fewer rows
_DROPS = 0.2  # largest share of cells farther than the floor


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
            return Scale(NOMINAL_SPEED, NO_FLOOR, "none")
        if self.height is not None:
            return Scale(self.height * now, self.height, "height")
        return Scale(NOMINAL_SPEED, min(max(NOMINAL_SPEED / now, 0.05), NO_FLOOR), "none")


def floor_ratio(flow: FlowField, camera: CameraModel) -> float | None:
    """Ratio of the baseline to the camera's height, from the floor; None if no floor is visible.

    ``flow`` is derotated. A point of the floor has the nearness ``fall / height`` (METHOD 2.8), so
    baseline times nearness divided by fall is equal on the whole floor and larger on obstacles.
    """
    shift = flow.motion.translation
    direction = shift / max(float(np.linalg.norm(shift)), 1e-12)
    lines = flow.points * direction[2] - camera.focal * direction[:2]
    squared = (lines * lines).sum(axis=-1)
    expansion = (flow.vectors * lines).sum(axis=-1) / np.maximum(squared, 1e-9)
    # baseline times current nearness, METHOD 2.5
    nearness = expansion / np.maximum(1.0 - direction[2] * expansion, 0.1)
    fall = (flow.points @ np.array([0.0, 1.0]) / camera.focal) * np.cos(camera.pitch) + np.sin(
        camera.pitch
    )
    sigma = flow.sigma / np.sqrt(np.maximum(squared, 1e-9))
    sure = (flow.confidence > 0.15) & (fall > 0.08) & (nearness > 3.0 * sigma)
    below = (flow.confidence > 0.15) & (fall > 0.08)
    if sure.sum() < _LEAST_CELLS or sure.sum() < 0.5 * below.sum():
        return None
    return _lowest_cluster(np.log(nearness[sure] / fall[sure]), fall[sure])


def _lowest_cluster(ratios: Array, fall: Array) -> float | None:
    """Median ratio in the densest cluster of the log ``ratios``; None if it is not a floor."""
    order = np.argsort(ratios)
    ratios, fall = ratios[order], fall[order]
    ends = np.searchsorted(ratios, ratios + 2.0 * _SAME, side="right")
    starts = np.arange(ratios.size)
    first = int(np.argmax(ends - starts))
    inside = slice(first, int(ends[first]))
    count = int(ends[first]) - first
    if count < max(_LEAST_CELLS, _LEAST_SHARE * ratios.size) or first > _DROPS * ratios.size:
        return None
    low, high = np.quantile(fall[inside], [0.1, 0.9])
    if high < _LEAST_SPAN * low:
        return None
    return float(np.exp(np.median(ratios[inside])))
