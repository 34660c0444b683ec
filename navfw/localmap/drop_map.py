"""Where the floor is missing: points seen below it, collected over many looks (METHOD 2.8).

One cell of one image that seems to lie below the floor says little, as block matching errs by a few
standard deviations at times; one that falls short of the floor's flow by far says more. A spot of
floor counts as missing when looks through it outweigh those at it.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.movers.tracking import Disc
from navfw.robot import RobotModel
from navfw.signals import Array, Label, Percept, Pose

__all__ = ["DropMap"]

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

FLOOR, DROP = int(Label.FLOOR), int(Label.DROP)

_FLATTEST = 1e-3
"""Fall per metre of depth of the flattest ray that meets any floor."""

_RIM = 0.6
"""Radius of what a missing spot takes from the ego map, in its edges: nearly up to its corners."""


class DropMap:
    """Counts, for spots of floor in the odom frame, looks that went through and that did not."""

    def __init__(self, robot: RobotModel) -> None:
        camera = robot.camera
        self._base_from_camera = camera.base_from_camera
        self._camera = (camera.focal, float(camera.mount_height), float(camera.mount_forward))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._votes: dict[tuple[int, int], int] = {}
        # asked for at every frame, but changing seldom
        self._points: list[tuple[float, float]] = []
        self._time = -math.inf

    def enter(self, percept: Percept, pose: Pose) -> None:
        """Count what ``percept`` shows, seen from odom ``pose``."""
        if percept.time - self._time < INTERVAL - _ROUNDING:
            return
        self._time = percept.time
        spots, votes = _votes(
            percept.points.reshape(-1, 2),
            percept.label.ravel(),
            percept.confidence.ravel(),
            percept.nearness.ravel(),
            percept.sigma.ravel(),
            self._base_from_camera,
            self._camera,
            (pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)),
        )
        decided = False
        for (i, j), vote in zip(spots.tolist(), votes.tolist(), strict=True):
            if vote != 0:
                before = self._votes.get((i, j), 0)
                after = min(max(before + vote, -FIRM), 2 * CERTAIN)
                self._votes[i, j] = after
                decided = decided or (before >= CERTAIN) != (after >= CERTAIN)
        if decided:
            self._points = [
                ((i + 0.5) * SPOT, (j + 0.5) * SPOT)
                for (i, j), count in self._votes.items()
                if count >= CERTAIN
            ]

    def points(self) -> list[tuple[float, float]]:
        """The middles (x, y) [m] in odom of the spots whose floor is missing."""
        return list(self._points)

    def discs(self) -> tuple[Disc, ...]:
        """What the missing spots take from the floor, in odom: nobody can be there."""
        return tuple(Disc(x, y, _RIM * SPOT) for x, y in self._points)


@numba.njit(cache=True)
def _votes(
    points: Array,
    label: npt.NDArray[np.int8],
    confidence: Array,
    nearness: Array,
    sigma: Array,
    turn: Array,
    camera: tuple[float, float, float],
    pose: tuple[float, float, float, float],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Spots (k, 2) of floor that cells of a percept show, and one vote (k,) for each.

    A vote is what most of the spot's cells say, and how clearly; 0 where they are at odds. ``turn``
    is ``base_from_camera``; ``camera`` its focal length [px], height and place ahead [m]; ``pose``
    is (x, y, cos yaw, sin yaw).
    """
    focal, height, forward = camera
    x, y, c, s = pose
    spots = np.empty((label.size, 2), np.int64)
    # of each spot: cells, those that look through the floor, those of them that are clear about it
    said = np.zeros((label.size, 3), np.int64)
    count = 0
    for n in range(label.size):
        through = label[n] == DROP
        if not confidence[n] >= CONFIDENCE or not (through or label[n] == FLOOR):
            continue
        u, v = points[n, 0] / focal, points[n, 1] / focal
        fall = -(turn[2, 0] * u + turn[2, 1] * v + turn[2, 2])
        if not fall > _FLATTEST:
            continue
        # where the ray meets the floor, if there is one
        depth = height / fall
        ahead = forward + depth * (turn[0, 0] * u + turn[0, 1] * v + turn[0, 2])
        left = depth * (turn[1, 0] * u + turn[1, 1] * v + turn[1, 2])
        if not math.hypot(ahead, left) <= RANGE:
            continue
        i = math.floor((x + c * ahead - s * left) / SPOT)
        j = math.floor((y + s * ahead + c * left) / SPOT)
        k = 0
        while k < count and (spots[k, 0] != i or spots[k, 1] != j):
            k += 1
        if k == count:
            spots[k, 0], spots[k, 1] = i, j
            count += 1
        said[k, 0] += 1
        if through:
            said[k, 1] += 1
            clear = 1.0 / depth - nearness[n] > CLEAR_SIGMAS * max(sigma[n], _SHARPEST)
            if clear and nearness[n] < CLEAR_SHARE / depth:
                said[k, 2] += 1
    votes = np.zeros(count, np.int64)
    for k in range(count):
        cells, drops, clear_ones = said[k]
        if 2 * drops > cells:
            votes[k] = CLEAR_VOTES if 2 * clear_ones > drops else 1
        elif 2 * drops < cells:
            votes[k] = -1
    return spots[:count], votes
