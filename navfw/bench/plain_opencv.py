"""OpenCV's flow at the centres of the grid's cells, as it is: no confidence, no sigma."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import cv2
import numpy as np

from navfw.flow.confidence import SIGMA_UNKNOWN
from navfw.flow.grid_flow import GridFlow, MatchedFlow
from navfw.numerics.arrays import Floats
from navfw.robot import RobotModel
from navfw.signals import Array, Image

_DenseMethod = Callable[[Image, Image], Floats]
"""Displacement (height, width, 2) [px] of each pixel of the first image in the second."""

_DIS = {
    "ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    "fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
    "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}


class PlainDense(MatchedFlow):
    """A dense method of OpenCV, at the pixels of the cells' centres."""

    name: ClassVar[str] = "plain_dense"

    def __init__(self, robot: RobotModel, method: _DenseMethod) -> None:
        super().__init__(robot, GridFlow.Params())
        self._method = method

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        dense = self._method(now, past)
        height, width = now.shape
        # a cell's centre lies between pixels where the cell has an even number of them
        x = (self._points[..., 0] + 0.5 * width - 0.5).astype(np.float32)
        y = (self._points[..., 1] + 0.5 * height - 0.5).astype(np.float32)
        back = cv2.remap(dense, x, y, cv2.INTER_LINEAR)
        shape = self._points.shape[:2]
        return -np.asarray(back, dtype=np.float64), np.ones(shape), np.full(shape, SIGMA_UNKNOWN)


class PlainPoints(MatchedFlow):
    """OpenCV's pyramidal Lucas-Kanade at the cells' centres; confidence 1 where it finds a point.

    ``window`` [px] is the side of a window, ``levels`` the number of halvings of the image.
    """

    name: ClassVar[str] = "plain_points"

    def __init__(self, robot: RobotModel, window: int, levels: int) -> None:
        super().__init__(robot, GridFlow.Params())
        self._size, self._levels = (window, window), levels
        pixels = self._points + 0.5 * np.array([robot.camera.width, robot.camera.height]) - 0.5
        self._seeds = pixels.reshape(-1, 1, 2).astype(np.float32)

    def _match(
        self, now: Image, past: Image, visible: tuple[int, int, int, int]
    ) -> tuple[Array, Array, Array]:
        there, found, _ = cv2.calcOpticalFlowPyrLK(
            now, past, self._seeds, self._seeds.copy(), winSize=self._size, maxLevel=self._levels
        )
        shape = self._points.shape[:2]
        vectors = (self._seeds - np.asarray(there)).reshape(self._points.shape).astype(np.float64)
        confidence = np.asarray(found).reshape(shape).astype(np.float64)
        return vectors, confidence, np.full(shape, SIGMA_UNKNOWN)


def plain_processors(robot: RobotModel) -> dict[str, MatchedFlow]:
    """OpenCV's processors by name: DIS by preset and finest scale, LK and Farneback by window."""
    found: dict[str, MatchedFlow] = {}
    for preset in _DIS:
        for finest in (0, 1, 2):
            found[f"cv_dis_{preset}_{finest}"] = PlainDense(robot, _dis(preset, finest))
    for window in (11, 15, 21):
        found[f"cv_lk_{window}"] = PlainPoints(robot, window, 3)
    for window in (9, 15):
        found[f"cv_farneback_{window}"] = PlainDense(robot, _farneback(window))
    return found


def reference_processor(robot: RobotModel) -> MatchedFlow:
    """The most accurate of OpenCV's processors, and the most costly one."""
    return PlainDense(robot, _dis("medium", 0))


def _dis(preset: str, finest: int) -> _DenseMethod:
    dis = cv2.DISOpticalFlow.create(_DIS[preset])
    dis.setFinestScale(finest)

    def method(now: Image, past: Image) -> Floats:
        return np.asarray(dis.calc(now, past, np.zeros((*now.shape, 2), np.float32)), np.float32)

    return method


def _farneback(window: int) -> _DenseMethod:
    def method(now: Image, past: Image) -> Floats:
        start: Floats = np.zeros((*now.shape, 2), np.float32)
        flow = cv2.calcOpticalFlowFarneback(
            *(now, past, start),
            pyr_scale=0.5,
            levels=3,
            winsize=window,
            iterations=3,
            poly_n=5,
            poly_sigma=1.1,
            flags=0,
        )
        return np.asarray(flow, np.float32)

    return method
