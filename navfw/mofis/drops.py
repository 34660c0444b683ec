"""Where the floor is missing: points seen below it, collected over many looks (METHOD 2.8).

One cell of one image that seems to lie below the floor says little, as block matching errs by a few
standard deviations at times; one that falls short of the floor's flow by far says more. A spot of
floor counts as missing when looks through it outweigh those at it.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navfw.mofis.tracks import Disc
from navfw.robot import RobotModel
from navfw.signals import Array, Label, Percept, Pose

__all__ = ["DropMemory"]

SPOT = 0.25
"""Edge of a spot [m]."""

RANGE = 1.6
"""Spots farther away are not judged [m]: the floor is seen too flat."""

CONFIDENCE = 0.3
"""Least confidence of what counts."""

INTERVAL = 0.1
"""Looks nearer in time count as one [s]: they see the same flow."""

_ROUNDING = 1e-6
"""Frames come in step with the interval, but for rounding [s]."""

CLEAR_SIGMAS = 5.0
CLEAR_SHARE = 0.85
"""A point is clearly below the floor when its nearness falls short of the floor's by so many
standard deviations, to less than that share. Hardly any floor that is there ever looks like it."""

_SHARPEST = 0.02
"""Sigma [1/m] below which no reading is taken at its word."""

CLEAR_VOTES = 2
"""A look that is clear weighs as much as so many others."""

CERTAIN = 4
"""Votes, net, after which the floor is taken for missing."""

FIRM = 2
"""Looks at the floor add up to no more than this: from afar a drop may pass for floor."""

_RIM = 0.6
"""Radius of what a missing spot takes from the ego map, in its edges: nearly up to its corners."""


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
        confident = percept.confidence.ravel() >= CONFIDENCE
        label = percept.label.ravel()
        kept = confident & ((label == Label.DROP) | (label == Label.FLOOR))
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
        nearness, sigma = percept.nearness.ravel()[kept], percept.sigma.ravel()[kept]
        clear = 1.0 / depth - nearness > CLEAR_SIGMAS * np.maximum(sigma, _SHARPEST)
        clear &= nearness < CLEAR_SHARE / depth
        through = label[kept] == Label.DROP
        votes = np.where(through, np.where(clear, CLEAR_VOTES, 1), -1)
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        x, y = pose.x + c * ahead - s * left, pose.y + s * ahead + c * left
        self._count(np.column_stack([x, y])[below], votes[below])

    def _count(self, points: Array, votes: npt.NDArray[np.int64]) -> None:
        """One vote for each spot: what most of its ``points`` (N, 2) [m] say, and how clearly."""
        seen: dict[tuple[int, int], list[int]] = {}
        spots = np.floor(points / SPOT).astype(int)
        for (i, j), vote in zip(spots.tolist(), votes.tolist(), strict=True):
            seen.setdefault((i, j), []).append(vote)
        for spot, said in seen.items():
            drops = [vote for vote in said if vote > 0]
            if 2 * len(drops) == len(said):
                continue
            clear = 2 * sum(vote == CLEAR_VOTES for vote in drops) > len(drops)
            vote = (CLEAR_VOTES if clear else 1) if 2 * len(drops) > len(said) else -1
            self._votes[spot] = min(max(self._votes.get(spot, 0) + vote, -FIRM), 2 * CERTAIN)

    def points(self) -> list[tuple[float, float]]:
        """The middles (x, y) [m] in odom of the spots whose floor is missing."""
        return [
            ((i + 0.5) * SPOT, (j + 0.5) * SPOT)
            for (i, j), votes in self._votes.items()
            if votes >= CERTAIN
        ]

    def discs(self) -> tuple[Disc, ...]:
        """What the missing spots take from the floor, in odom: nobody can be there."""
        return tuple(Disc(x, y, _RIM * SPOT) for x, y in self.points())
