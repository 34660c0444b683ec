"""Dense flow of the lower image after alignment of the floor ("plane plus parallax").

The camera's motion and its height above the floor determine where each point of the floor was in
the past image. After the past image is warped accordingly, the floor has no flow, static objects on
the floor move only away from the focus of expansion (Sawhney 1994; Irani and Anandan 1998), and
displacements are small even right in front of the wheels. Cells can then be small enough to resolve
the outlines of moving objects.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from navfw.flow.cell_kernels import CELL, match_cells, unwarp_cells
from navfw.flow.grid_flow import check_frame
from navfw.numerics import Array, Image, Mask
from navfw.numerics.arrays import Floats
from navfw.numerics.linear_systems import inverse
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, FramePair
from navfw.signals.immutability import read_only

_CELLS_ABOVE = 3  # chosen
"""Rows of cells above the horizon. Near objects visible further up also extend down to here."""
_MIN_ROWS = 4  # chosen
"""Least number of cell rows below the horizon; with fewer the floor is hardly visible."""
_EDGE = 5  # chosen
"""Margin at the image's border [px] in which matches are unreliable and discarded."""
_COARSE_STRIDE = 8  # chosen
"""Distance [px] between matched patches in coarse mode: the patches do not overlap."""
_SIGMA = 0.2  # measured
"""Standard deviation of a cell's mean flow [px], measured on rendered frames."""

_UNIT = np.eye(3)  # defined


class FloorAlignedFlow:
    """Measures flow on a grid of small cells from 3 above the horizon to the image's lower border.

    Use it to detect moving objects, not for depth: for frames a short fixed time apart, regardless
    of the baseline.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        camera = robot.camera
        horizon = 0.5 * camera.height - camera.focal * math.tan(camera.pitch)
        most = camera.height // CELL
        self._rows = min(max(math.ceil((camera.height - horizon) / CELL) + _CELLS_ABOVE, 0), most)
        self._cols = camera.width // CELL
        self._top = camera.height - self._rows * CELL
        self._left = (camera.width - self._cols * CELL) // 2
        size = self._rows * CELL, self._cols * CELL
        self._pixel_y, self._pixel_x = np.mgrid[: size[0], : size[1]].astype(np.float32)
        # centres of the cells, in pixels from the top left of the whole image
        x = self._left + CELL * np.arange(self._cols) + 0.5 * (CELL - 1)
        y = self._top + CELL * np.arange(self._rows) + 0.5 * (CELL - 1)
        self._centres = np.stack(np.meshgrid(x, y), axis=-1)
        cx, cy = 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)
        self._points = read_only(self._centres - np.array([cx, cy]))
        last = camera.width - 1.0 - _EDGE, camera.height - 1.0 - _EDGE
        self._border = np.array([_EDGE, _EDGE, *last])
        f = camera.focal
        self._intrinsics = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
        self._rays = inverse(self._intrinsics)
        self._down = -camera.base_from_camera[2]
        self._corner = np.array([[1.0, 0.0, self._left], [0.0, 1.0, self._top], [0.0, 0.0, 1.0]])
        self._dis, self._coarse_dis = _matcher(), _matcher()
        self._coarse_dis.setPatchStride(_COARSE_STRIDE)

    @property
    def floor_visible(self) -> bool:
        """Whether the field of view has at least 4 rows of cells below the horizon."""
        return self._rows - _CELLS_ABOVE >= _MIN_ROWS

    def compute(self, pair: FramePair, coarse: bool = False) -> FlowField:
        """Measure the flow from ``pair.past`` to ``pair.now``, not derotated; confidence is 0 or 1.

        ``coarse`` matching takes less than half the time and misses some moving objects.

        Raises:
            ConfigError: size or type of a frame is not the camera's.

        """
        camera = self._robot.camera
        check_frame(pair.past, camera)
        check_frame(pair.now, camera)
        warp = self._past_from_now(pair.motion)
        rows, cols = self._pixel_x.shape
        warped = cv2.warpPerspective(
            pair.past.image,
            product(warp, self._corner),
            (cols, rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        now = np.ascontiguousarray(pair.now.image[self._top :, self._left : self._left + cols])
        past = np.asarray(warped, dtype=np.uint8)
        start: Floats = np.zeros((rows, cols, 2), dtype=np.float32)
        dis = self._coarse_dis if coarse else self._dis
        back: Floats = np.asarray(dis.calc(now, past, start), dtype=np.float32)
        good = self._matches(now, past, back)
        vectors = np.empty_like(self._centres)
        size = (self._cols, self._rows)
        means = np.asarray(cv2.resize(back, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
        unwarp_cells(self._centres, means, warp, self._border, good, vectors)
        return FlowField(
            time=pair.now.time,
            points=self._points,
            vectors=vectors,
            confidence=good.astype(np.float64),
            sigma=np.full(good.shape, _SIGMA),
            motion=pair.motion,
        )

    def _past_from_now(self, motion: CameraMotion) -> Array:
        """Homography (3, 3) from current to past pixels of points on the floor."""
        height = self._robot.camera.mount_height
        shift = _UNIT + motion.translation[:, None] * self._down / height
        return np.asarray(product(self._intrinsics, motion.rotation.T, shift, self._rays))

    def _matches(self, now: Image, past: Image, back: Floats) -> Mask:
        """Whether the past image matches the current one along the flow, for each cell."""
        moved = cv2.remap(
            past,
            self._pixel_x + back[..., 0],
            self._pixel_y + back[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        good = np.empty((self._rows, self._cols), dtype=np.bool_)
        match_cells(now, np.asarray(moved, dtype=np.uint8), good)
        return good


def _matcher() -> cv2.DISOpticalFlow:
    matcher = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    # the preset stops at a coarser scale, where the outline of a foot is lost
    matcher.setFinestScale(0)
    return matcher
