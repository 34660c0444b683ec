"""Whether the camera shows the path ahead: texture and confidence in its part of the image."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navfw.robot import RobotModel
from navfw.signals import Array, Percept

__all__ = ["PathSight"]

REACH = 2.0
"""Distance ahead [m] up to which the floor of the path counts."""
BESIDE = 0.1
"""Width of the path beside the body, each side [m]."""
CONFIDENCE = 0.01
"""Least confidence of a cell with texture above the noise: it has been matched, however weakly."""
WEAK = 0.28
"""Mean confidence of the path's cells below which sight is weak. Usual texture gives about 0.5, a
contrast of 6 grey levels under a noise of 2 about 0.32, a contrast of 3 about 0.22."""
SEEN = 0.2
"""Share of the path's cells with texture below which nothing is seen. Usual texture gives nearly
all cells, edges between surfaces without texture give single ones."""
SHARE = 0.15
"""Weight of the newest percept in the mean over the percepts so far: single ones vary."""


class PathSight:
    """``texture``: the share of the path's cells that the newest percepts have matched.

    ``confidence``: the mean confidence of these cells.

    The path is the floor that the robot would drive over. A cell of the image that shows it, or
    what stands on it, has a confidence above 0 only with texture above the noise.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._points: Array | None = None
        self._path: npt.NDArray[np.bool_] = np.zeros((0, 0), np.bool_)
        self.reset()

    def reset(self) -> None:
        """Back to the start of a run: before the first percept there is no judgement."""
        self.texture = self.confidence = 1.0
        self._first = True

    @property
    def weak(self) -> bool:
        """Whether the path is seen so poorly that only floor seen as such is free."""
        return self.none or self.confidence < WEAK

    @property
    def none(self) -> bool:
        """Whether next to nothing of the path is seen."""
        return self.texture < SEEN

    @property
    def trouble(self) -> str:
        """What a person should know about the sight of the path; empty where it is good."""
        if not self.weak:
            return ""
        seen = "nothing" if self.none else "little"
        return f"{seen} is seen of the path ahead: too little texture above the noise"

    def observe(self, percept: Percept) -> None:
        """Take in the newest percept."""
        if percept.points is not self._points:
            self._points, self._path = percept.points, self._path_of(percept.points)
        confidence = percept.confidence[self._path]
        if not confidence.size:
            return  # a camera that sees no floor gives no judgement
        weight = 1.0 if self._first else SHARE
        self._first = False
        self.texture += weight * (float((confidence >= CONFIDENCE).mean()) - self.texture)
        self.confidence += weight * (float(confidence.mean()) - self.confidence)

    def _path_of(self, points: Array) -> npt.NDArray[np.bool_]:
        """(rows, cols) True for cells whose rays meet the floor of the path."""
        camera = self._robot.camera
        fall = camera.fall_per_depth(points)
        depth = camera.mount_height / np.maximum(fall, 1e-6)
        rays = np.concatenate([points / camera.focal, np.ones((*points.shape[:2], 1))], axis=-1)
        ahead, left, _ = np.moveaxis(depth[..., None] * (rays @ camera.base_from_camera.T), -1, 0)
        near = (ahead > 0.0) & (ahead <= REACH) & (fall > 0.0)
        return np.asarray(near & (np.abs(left) <= self._robot.radius + BESIDE))
