"""How fast, how high? One camera sees no scale; the floor ties the two together.

Flow tells distances in units of the way between two images. Where a floor is seen, it tells the
camera's height in the same unit: speed gives height, and height gives speed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from navfw.robot import CameraModel
from navfw.signals import Array, FlowField

__all__ = ["NO_FLOOR", "Scale", "ScaleEstimator", "floor_ratio"]

NOMINAL_SPEED = 0.35
"""Speed taken where none is known [m/s]: then OFFIS's terms of distance follow from its terms of
time to contact, whose limits are as many seconds as the others are metres over this speed."""
NO_FLOOR = 50.0
"""Height of a camera that sees no floor [m]: everything below the horizon counts as an object."""
_SAME = 0.12  # relative width of what counts as one floor
_LEAST_CELLS = 8
_LEAST_SHARE = 0.3
_LEAST_SPAN = 1.6  # a wall's flow imitates a floor's over a smaller range of rows
_DROPS = 0.2


@dataclass(frozen=True, slots=True)
class Scale:
    """What OFFIS is to take for true: ``speed`` [m/s] and the camera's ``height`` [m].

    ``source``: "speed" where it was given, "height" where the speed follows from the given height
    and the floor, "none" where distances mean nothing but their ratios.
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
        """Whether the floor is known."""
        return self.height < NO_FLOOR


@dataclass
class ScaleEstimator:
    """Completes speed and height from the floor seen now and before."""

    speed: float | None
    height: float | None
    _ratios: deque[float] = field(default_factory=lambda: deque(maxlen=31))

    def update(self, ratio: float | None) -> Scale:
        """The scale, when the floor passes at ``ratio`` [1/s] = speed / height (None: no floor)."""
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
    """Way between the images over the camera's height, from the floor; None where none is seen.

    ``flow`` is derotated. A point of the floor has the nearness ``fall / height`` (METHOD 2.8), so
    way times nearness over fall is the same wherever floor is seen, and larger wherever something
    stands on it.
    """
    shift = flow.motion.translation
    direction = shift / max(float(np.linalg.norm(shift)), 1e-12)
    lines = flow.points * direction[2] - camera.focal * direction[:2]
    squared = (lines * lines).sum(axis=-1)
    expansion = (flow.vectors * lines).sum(axis=-1) / np.maximum(squared, 1e-9)
    # way x nearness now, METHOD 2.5
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
    """The densest value of the log ``ratios`` if it looks like a floor."""
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
