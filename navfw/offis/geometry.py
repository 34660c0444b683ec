"""What depends on the grid and the camera alone: computed once per grid, used every frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfw.offis.floor import fall_per_depth, floor_nearness
from navfw.offis.pyramid import Pyramid
from navfw.robot import RobotModel
from navfw.signals import Array

__all__ = ["GridGeometry"]

LOW_SHARE = 0.3
"""Weight, in the fits of planes, of cells below the horizon.

Noise makes some of the floor look like obstacles there, always on the near side."""


@dataclass(frozen=True, slots=True)
class GridGeometry:
    """A grid of image points, seen by the robot's camera; arrays (rows, cols) or flat (n,).

    ``upward`` is true above the horizon. ``across`` (n,) and ``ahead`` (n,) are the sideways (away
    from the image's middle) and forward parts of each ray in the level body frame, per unit of
    depth. ``planes`` (4, n) masks the left plane, the right plane and their outer halves;
    ``middle`` (n,) masks the part just ahead and above the horizon; ``path`` (n,) the cells that
    would show the floor the robot is about to drive over. ``wall_top`` (rows, cols) is the nearness
    [1/m] below which a cell sees over walls; ``wall_share`` (rows, cols) weighs cells in the fits
    of planes.
    """

    points: Array
    pyramid: Pyramid
    upward: np.ndarray
    across: Array
    ahead: Array
    planes: Array
    middle: Array
    path: Array
    wall_top: Array
    wall_share: Array

    @classmethod
    def of(
        cls, points: Array, layers: int, robot: RobotModel, path_length: float, wall_height: float
    ) -> GridGeometry:
        """Geometry of ``points`` (rows, cols, 2) [px] for floor up to ``path_length`` [m] ahead.

        Walls end at ``wall_height`` [m] above the floor.
        """
        camera = robot.camera
        focal = camera.focal
        rows, cols = points.shape[:2]
        fall = fall_per_depth(points, camera)
        x, y = points[..., 0] / focal, points[..., 1] / focal
        ahead = math.cos(camera.pitch) - y * math.sin(camera.pitch)

        column = np.broadcast_to(np.arange(cols), (rows, cols))
        left, right = column < (cols + 1) // 2, column >= cols // 2
        outer = np.abs(x) >= 0.5 * np.abs(x).max()
        planes = np.stack([left, right, left & outer, right & outer])

        nearness = floor_nearness(points, camera)
        reach = 1.0 / np.maximum(nearness, 1e-6)
        path = (reach * ahead <= path_length) & (np.abs(x) * reach <= robot.radius + 0.1)
        upward = fall <= 0.0
        return cls(
            points=points,
            pyramid=Pyramid((rows, cols), layers),
            upward=upward,
            across=np.abs(x).reshape(-1),
            ahead=ahead.reshape(-1),
            planes=planes.reshape(4, -1).astype(np.float64),
            middle=((np.abs(x) < 0.25) & upward).reshape(-1).astype(np.float64),
            path=path.reshape(-1).astype(np.float64),
            wall_top=-fall / (wall_height - camera.mount_height),
            wall_share=np.where(upward, 1.0, LOW_SHARE),
        )
