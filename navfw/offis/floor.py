"""Height of the seen points above the floor, and what that makes of them (METHOD 2.8).

A ray through image point (x, y) of a camera pitched down by ``a`` at height ``h`` falls by
``g = (y cos a + f sin a) / f`` per metre of depth, so a point of nearness q stands
``H = h - g / q`` above the floor, and the floor itself would show ``q_floor = g / h``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from navfw.offis.nearness import Nearness
from navfw.offis.percept_kernels import label_cells
from navfw.robot import CameraModel
from navfw.signals import Array

__all__ = ["FloorModel", "floor_nearness"]


def floor_nearness(points: Array, camera: CameraModel) -> Array:
    """Nearness [1/m] of the empty floor at ``points`` (..., 2) [px]; 0 at and above the horizon."""
    return np.maximum(camera.fall_per_depth(points), 0.0) / camera.mount_height


@dataclass(frozen=True)
class FloorModel:
    """Tells floor, obstacles, drops and what passes overhead apart (METHOD 2.8).

    ``top`` [m] is the height below which things concern the robot. The tests are made in nearness,
    where errors are symmetric: an obstacle exceeds the floor's nearness by ``sigmas`` standard
    deviations and stands higher than ``obstacle_height``; a drop falls short of it by
    ``drop_sigmas`` and lies deeper than ``drop_depth``; floor is within ``floor_tolerance`` (or
    ``sigmas`` standard deviations) of height 0, where height is known better than
    ``floor_resolution``. All else is UNKNOWN.
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
        return np.array(
            [
                self.minimum_confidence,
                self.sigmas,
                self.drop_sigmas,
                self.obstacle_height,
                self.floor_tolerance,
                self.floor_resolution,
                self.drop_depth,
                self.top,
            ]
        )

    def classify(
        self, points: Array, seen: Nearness, fall: Array | None = None
    ) -> tuple[Array, npt.NDArray[np.int8]]:
        """(height [m] above the floor, label) of each cell, both (rows, cols).

        Where nearness is not known the height is that of a point 1 km away: use it only with the
        label, or the confidence. ``fall`` (n,) is ``camera.fall_per_depth(points)``, if known.
        """
        if fall is None:
            fall = self.camera.fall_per_depth(points).flatten()
        shape = seen.nearness.shape
        height, label = label_cells(
            seen.nearness.reshape(-1),
            seen.sigma.reshape(-1),
            seen.confidence.reshape(-1),
            fall,
            float(self.camera.mount_height),
            self._limits,
        )
        return height.reshape(shape), label.reshape(shape)
