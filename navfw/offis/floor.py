"""Height of the observed points above the floor, and their labels (METHOD 2.8).

A ray through image point (x, y) of a camera pitched down by ``a`` at height ``h`` descends by
``g = (y cos a + f sin a) / f`` per metre of depth. A point of nearness q is therefore at the height
``H = h - g / q`` above the floor, and the floor has the nearness ``q_floor = g / h``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.offis.nearness import Nearness
from navfw.offis.percept_kernels import label_cells
from navfw.robot import CameraModel

_LOW_CAMERA = 0.2
"""Height of a camera [m] below which the tolerances of the floor are relative to it."""


def floor_nearness(points: Array, camera: CameraModel) -> Array:
    """Nearness [1/m] of the empty floor at ``points`` (..., 2) [px]; 0 at and above the horizon."""
    return np.maximum(camera.fall_per_depth(points), 0.0) / camera.mount_height


@dataclass(frozen=True)
class FloorModel:
    """Classifies cells as floor, obstacle, drop or overhead by their height (METHOD 2.8).

    Points at a height of ``top`` [m] or more do not obstruct the robot. The tests compare nearness,
    whose errors are symmetric. An obstacle exceeds the floor's nearness by ``sigmas`` standard
    deviations and is higher than ``obstacle_height`` [m]; a drop falls short of it by
    ``drop_sigmas`` standard deviations and is deeper than ``drop_depth`` [m]; floor is within
    ``floor_tolerance`` [m] (or ``sigmas`` standard deviations) of height 0, if the standard
    deviation of the height is below ``floor_resolution`` [m]. All else is UNKNOWN. Below a camera
    lower than _LOW_CAMERA, both lengths shrink in proportion to its height.
    """

    camera: CameraModel
    top: float
    minimum_confidence: float = 0.15
    sigmas: float = 2.0
    drop_sigmas: float = 3.0
    obstacle_height: float = 0.05
    floor_tolerance: float = 0.04
    floor_resolution: float = 0.10
    drop_depth: float = 0.08

    @cached_property
    def _limits(self) -> Array:
        share = min(self.camera.mount_height / _LOW_CAMERA, 1.0)
        return np.array(
            [
                self.minimum_confidence,
                self.sigmas,
                self.drop_sigmas,
                self.obstacle_height,
                self.floor_tolerance * share,
                self.floor_resolution * share,
                self.drop_depth,
                self.top,
            ]
        )

    def classify(
        self, points: Array, seen: Nearness, fall: Array | None = None
    ) -> tuple[Array, npt.NDArray[np.int8]]:
        """Height [m] above the floor and label of each cell, both (rows, cols).

        Where nearness is unknown the height is that of a point 1 km away: use it only together with
        the label or the confidence. ``fall`` (n,) is ``camera.fall_per_depth(points)``, computed
        here if it is None.
        """
        if fall is None:
            fall = self.camera.fall_per_depth(points).flatten()
        shape = seen.nearness.shape
        height, label = label_cells(
            *seen.flat,
            fall,
            float(self.camera.mount_height),
            self._limits,
        )
        return height.reshape(shape), label.reshape(shape)
