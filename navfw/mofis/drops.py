"""Where the floor is missing: points seen below it, collected over many looks (METHOD 2.8).

One cell of one image that seems to lie below the floor says little. A spot of floor counts as
missing when looks through it exceed those at it by far.
"""

from __future__ import annotations

import math

import numpy as np

from navfw.robot import RobotModel
from navfw.signals import Label, Percept, Pose

__all__ = ["DropMemory"]

SPOT = 0.25
"""Edge of a spot [m]."""

RANGE = 2.5
"""Spots farther away are not judged [m]: the floor is seen too flat."""

CONFIDENCE = 0.3
"""Least confidence of what counts."""

INTERVAL = 0.2
"""Looks nearer in time count as one [s]: they see the same flow."""

_ROUNDING = 1e-6
"""Frames come in step with the interval, but for rounding [s]."""

CERTAIN = 6
"""Looks, net, after which the floor is taken for missing."""


class DropMemory:
    """Counts, for spots of floor in the odom frame, looks that went through and that did not."""

    def __init__(self, robot: RobotModel) -> None:
        self._camera = robot.camera
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._votes: dict[tuple[int, int], int] = {}
        self._time = -math.inf

    def enter(self, percept: Percept, pose: Pose) -> None:
        """Count what ``percept`` shows, seen from odom ``pose``."""
        if percept.time - self._time < INTERVAL - _ROUNDING:
            return
        self._time = percept.time
        label = percept.label.ravel()
        kept = (percept.confidence.ravel() >= CONFIDENCE) & (
            (label == Label.DROP) | (label == Label.FLOOR)
        )
        if not kept.any():
            return
        camera = self._camera
        rays = percept.points.reshape(-1, 2)[kept] / camera.focal
        rays = np.column_stack([rays, np.ones(len(rays))]) @ camera.base_from_camera.T
        below = rays[:, 2] < -1e-3
        # where each ray meets the floor, if there is one
        depth = camera.mount_height / np.maximum(-rays[:, 2], 1e-3)
        ahead = camera.mount_forward + depth * rays[:, 0]
        left = depth * rays[:, 1]
        below &= np.hypot(ahead, left) <= RANGE
        through = label[kept] == Label.DROP
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        x, y = pose.x + c * ahead - s * left, pose.y + s * ahead + c * left
        spots = np.floor(np.column_stack([x, y])[below] / SPOT).astype(int)
        self._count(spots, through[below])

    def _count(
        self, spots: np.ndarray[tuple[int, int], np.dtype[np.int64]], through: object
    ) -> None:
        seen: dict[tuple[int, int], int] = {}
        for (i, j), drop in zip(spots.tolist(), np.asarray(through).tolist(), strict=True):
            seen[i, j] = seen.get((i, j), 0) + (1 if drop else -1)
        for spot, votes in seen.items():
            step = (votes > 0) - (votes < 0)
            self._votes[spot] = min(max(self._votes.get(spot, 0) + step, -CERTAIN), 2 * CERTAIN)

    def points(self) -> list[tuple[float, float]]:
        """The middles (x, y) [m] in odom of the spots whose floor is missing."""
        return [
            ((i + 0.5) * SPOT, (j + 0.5) * SPOT)
            for (i, j), votes in self._votes.items()
            if votes >= CERTAIN
        ]
