"""Dense flow of the lower image, once the floor has been brought to rest in it.

The camera's motion and its height above the floor say where every point of the floor was imaged
before. With the past image warped so, the floor shows no flow at all, things at rest that stand on
it move away from the focus of expansion only ("plane plus parallax": Sawhney 1994; Irani and
Anandan 1998), and matching meets small displacements even right before the wheels. That leaves
pixels enough to see the outlines of what moves by itself.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from navfw.flow.cell_kernels import match_cells, unwarp_cells
from navfw.flow.dense_flow import Dense
from navfw.flow.grid import check_frame
from navfw.robot import RobotModel
from navfw.signals import Array, CameraMotion, FlowField, FramePair, Image

__all__ = ["FloorAlignedFlow"]

CELL = 4
"""Side of the cells [px] that flow is averaged over."""
CELLS_ABOVE = 3
"""Rows of cells above the horizon; higher up nothing is near that does not reach down here."""
LEAST_ROWS = 4
"""A camera that sees less of the floor than so many cells needs no flow of it."""
EDGE = 5
"""Matches nearer to the image's border than this are guesses [px]."""
DIFFERENCE = 8.0
"""Mean difference [grey levels] of a cell to its match from which on it is no match."""
GRADIENT = 1.5
"""Least gradient [grey levels/px] that a match can be told by."""
COARSE_STRIDE = 8
"""Distance [px] between matched patches in coarse mode: the patches do not overlap."""
SIGMA = 0.2
"""Standard deviation of a cell's mean flow [px], measured on rendered frames."""

Floats = npt.NDArray[np.float32]

_UNIT = np.eye(3)


class FloorAlignedFlow:
    """Flow on a grid of small cells from a little above the horizon down to the image's border.

    Made for frames a fixed short time apart, whatever way the robot has come: it is for movers, not
    for depth.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        camera = robot.camera
        horizon = 0.5 * camera.height - camera.focal * math.tan(camera.pitch)
        most = camera.height // CELL
        self._rows = min(max(math.ceil((camera.height - horizon) / CELL) + CELLS_ABOVE, 0), most)
        self._cols = camera.width // CELL
        self._top = camera.height - self._rows * CELL
        self._left = (camera.width - self._cols * CELL) // 2
        size = self._rows * CELL, self._cols * CELL
        self._pixel_y, self._pixel_x = np.mgrid[: size[0], : size[1]].astype(np.float32)
        # centres of the cells, in pixels of the whole image
        x = self._left + CELL * np.arange(self._cols) + 0.5 * (CELL - 1)
        y = self._top + CELL * np.arange(self._rows) + 0.5 * (CELL - 1)
        self._centres = np.stack(np.meshgrid(x, y), axis=-1)
        cx, cy = 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)
        self._points = self._centres - np.array([cx, cy])
        last = camera.width - 1.0 - EDGE, camera.height - 1.0 - EDGE
        self._border = np.array([EDGE, EDGE, *last])
        f = camera.focal
        self._intrinsics = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
        self._rays = np.linalg.inv(self._intrinsics)
        self._down = -camera.base_from_camera[2]
        self._corner = np.array([[1.0, 0.0, self._left], [0.0, 1.0, self._top], [0.0, 0.0, 1.0]])
        self._dis, self._coarse_dis = _matcher(), _matcher()
        self._coarse_dis.setPatchStride(COARSE_STRIDE)

    @property
    def floor_visible(self) -> bool:
        """Whether the camera looks down far enough to see any."""
        return self._rows - CELLS_ABOVE >= LEAST_ROWS

    def compute(self, pair: FramePair, coarse: bool = False) -> FlowField:
        """Flow of ``pair.now`` against ``pair.past``, not derotated; confidence is 0 or 1.

        ``coarse`` matching takes less than half the time and misses some moving objects.

        Raises:
            ConfigError: a frame is not the camera's.

        """
        camera = self._robot.camera
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        warp = self._past_from_now(pair.motion)
        rows, cols = self._pixel_x.shape
        warped = cv2.warpPerspective(
            pair.past.image,
            warp @ self._corner,
            (cols, rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        now = np.ascontiguousarray(pair.now.image[self._top :, self._left : self._left + cols])
        past = np.asarray(warped, dtype=np.uint8)
        start: Dense = np.zeros((rows, cols, 2), dtype=np.float32)
        dis = self._coarse_dis if coarse else self._dis
        back: Dense = np.asarray(dis.calc(now, past, start), dtype=np.float32)
        good = self._matches(now, past, back)
        vectors = np.empty_like(self._centres)
        unwarp_cells(self._centres, self._means(back), warp, self._border, good, vectors)
        return FlowField(
            time=pair.now.time,
            points=self._points,
            vectors=vectors,
            confidence=good.astype(np.float64),
            sigma=np.full(good.shape, SIGMA),
            motion=pair.motion,
        )

    def _past_from_now(self, motion: CameraMotion) -> Array:
        """(3, 3) homography from current to past pixels for points of the floor."""
        height = self._robot.camera.mount_height
        shift = _UNIT + motion.translation[:, None] * self._down / height
        return np.asarray(self._intrinsics @ motion.rotation.T @ shift @ self._rays)

    def _matches(self, now: Image, past: Image, back: Dense) -> npt.NDArray[np.bool_]:
        """(rows, cols) where the past image agrees with the current one along the flow."""
        moved = cv2.remap(
            past,
            self._pixel_x + back[..., 0],
            self._pixel_y + back[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        good = np.empty((self._rows, self._cols), dtype=np.bool_)
        match_cells(now, np.asarray(moved, dtype=np.uint8), CELL, DIFFERENCE, GRADIENT, good)
        return good

    def _means(self, values: Floats) -> Floats:
        """Means of ``values`` (height, width, ...) over the cells."""
        size = (self._cols, self._rows)
        return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _matcher() -> cv2.DISOpticalFlow:
    matcher = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    # outlines of the size of a foot are lost on the coarser scale where the preset ends
    matcher.setFinestScale(0)
    return matcher
