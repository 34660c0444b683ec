"""The floor, and what depends only on the grid and the camera: computed once for all frames.

Height above the floor, and labels (METHOD 2.8): a ray through image point (x, y) of a camera
pitched down by ``a`` at height ``h`` descends by ``g = (y cos a + f sin a) / f`` per metre of
depth. A point of nearness q is therefore at the height ``H = h - g / q`` above the floor, and the
floor has the nearness ``q_floor = g / h``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer_rows, load_system
from navfw.offis.nearness import Nearness
from navfw.offis.percept_kernels import blind_border, label_cells
from navfw.offis.pyramid import Pyramid
from navfw.robot import CameraModel, RobotModel
from navfw.signals import FlowField

MINIMUM_CONFIDENCE = 0.15  # chosen
"""Least confidence of a known cell [1]."""
_SIGMAS, _DROP_SIGMAS, _FLOOR_TOLERANCE, _FLOOR_RESOLUTION = 2.0, 3.0, 0.04, 0.10  # chosen
_LOW_CAMERA = 0.2  # chosen
"""Height of a camera [m] below which the tolerances of the floor are relative to it."""


def floor_nearness(points: Array, camera: CameraModel) -> Array:
    """Compute the nearness [1/m] of empty floor at ``points`` (..., 2) [px]; 0 above horizon."""
    return np.maximum(camera.fall_per_depth(points), 0.0) / camera.mount_height


@dataclass(frozen=True)
class FloorModel:
    """Classifies cells as floor, obstacle, drop or overhead by their height (METHOD 2.8).

    Points at a height of ``top`` [m] or more do not obstruct the robot. The tests compare nearness,
    whose errors are symmetric. An obstacle exceeds the floor's nearness by 2 standard deviations
    and is higher than ``obstacle_height`` [m]; a drop falls short of it by 3 and is deeper than
    ``drop_depth`` [m]; floor is within 0.04 m (or 2 standard deviations) of height 0, if the
    standard deviation of the height is below 0.1 m. All else is UNKNOWN. For a camera lower than
    0.2 m, the 0.04 m and the 0.1 m shrink in proportion to its height.
    """

    camera: CameraModel
    top: float
    obstacle_height: float = 0.05
    drop_depth: float = 0.08

    @cached_property
    def _limits(self) -> Array:
        share = min(self.camera.mount_height / _LOW_CAMERA, 1.0)
        return np.array(
            [
                MINIMUM_CONFIDENCE,
                _SIGMAS,
                _DROP_SIGMAS,
                self.obstacle_height,
                _FLOOR_TOLERANCE * share,
                _FLOOR_RESOLUTION * share,
                self.drop_depth,
                self.top,
            ]
        )

    def classify(
        self, points: Array, seen: Nearness, fall: Array | None = None
    ) -> tuple[Array, npt.NDArray[np.int8]]:
        """Compute height [m] above the floor and label of each cell, both (rows, cols).

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


_LOW_SHARE = 0.3  # chosen
"""Weight of cells below the horizon in the fits of planes.

There, noise lets cells of the floor pass as obstacles, always nearer than the walls."""


@dataclass(frozen=True, slots=True)
class GridGeometry:
    """A grid of image points of the robot's camera; arrays (rows, cols) or flat (n,).

    ``upward`` is true above the horizon. ``lateral``, ``ahead`` and ``fall`` (n,) are the
    components of each ray to the right, forward and down in the level body frame, per unit of
    depth; ``lateral_edge`` (n,) is ``lateral`` of the cell's edge towards the border of the image.
    ``halves`` (2, n) masks the image halves of the left and the right plane, ``half_cells`` is the
    number of cells of a half, ``column`` (n,) the column of each cell. ``middle`` (n,) masks the
    cells straight ahead and above the horizon; ``path`` (n,) masks the ``path_cells`` cells of the
    floor that the robot would drive over. ``off_axis`` (2, n) are |x| and |y| of the points [px].
    ``wall_top`` (n,) is the nearness [1/m] at the height of the top of walls: a cell of less
    nearness shows something above them. ``wall_share`` (n,) weights cells in the fits of planes.
    ``mount_height`` and ``wall_height`` [m above the floor] are those of the camera and of walls.
    """

    points: Array
    pyramid: Pyramid
    upward: npt.NDArray[np.bool_]
    lateral: Array
    lateral_edge: Array
    ahead: Array
    fall: Array
    halves: npt.NDArray[np.bool_]
    half_cells: float
    column: npt.NDArray[np.int64]
    middle: Array
    path: Array
    path_cells: float
    off_axis: Array
    wall_top: Array
    wall_share: Array
    mount_height: float
    wall_height: float

    @classmethod
    def of(
        cls, points: Array, layers: int, robot: RobotModel, path_length: float, wall_height: float
    ) -> GridGeometry:
        """Compute the geometry of the grid ``points`` (rows, cols, 2) [px] with a pyramid on it.

        The path is the floor up to ``path_length`` [m] ahead; walls are ``wall_height`` [m] high.
        """
        camera = robot.camera
        focal = camera.focal
        rows, cols = points.shape[:2]
        fall = camera.fall_per_depth(points)
        x, y = points[..., 0] / focal, points[..., 1] / focal
        ahead = math.cos(camera.pitch) - y * math.sin(camera.pitch)

        column = np.broadcast_to(np.arange(cols), (rows, cols)).astype(np.int64)
        halves = np.stack([column < (cols + 1) // 2, column >= cols // 2]).reshape(2, -1)
        edge = (2.0 * column / cols - 1.0 + (column >= cols // 2) * 2.0 / cols) * (
            0.5 * camera.width / focal
        )

        nearness = floor_nearness(points, camera)
        reach = 1.0 / np.maximum(nearness, 1e-6)
        path = (reach * ahead <= path_length) & (np.abs(x) * reach <= robot.radius + 0.1)
        upward = fall <= 0.0
        return cls(
            points=points,
            pyramid=Pyramid((rows, cols), layers),
            upward=upward.reshape(-1),
            lateral=x.flatten(),
            lateral_edge=edge.flatten(),
            ahead=ahead.flatten(),
            fall=fall.flatten(),
            halves=halves,
            half_cells=float(halves[0].sum()),
            column=column.flatten(),
            middle=((np.abs(x) < 0.25) & upward).reshape(-1).astype(np.float64),
            path=path.reshape(-1).astype(np.float64),
            path_cells=float(path.sum()),
            off_axis=np.abs(points).reshape(-1, 2).T.copy(),
            wall_top=(-fall / (wall_height - camera.mount_height)).flatten(),
            wall_share=np.where(upward, 1.0, _LOW_SHARE).flatten(),
            mount_height=float(camera.mount_height),
            wall_height=wall_height,
        )


_BEYOND = 1.4  # measured
"""Nearness of such an obstacle relative to the least nearness outside the search range; a typical
value from measurements."""

_SLACK = 1.5  # chosen
"""Distance [px] beyond the outermost column up to which the past image still shows enough of it."""


@dataclass(frozen=True, slots=True)
class BlindBorders:
    """Near obstacles at the borders; ``hidden`` (2, columns): nearness [1/m], degree [0, 1]."""

    hidden: Array
    evaluation: FuzzyEvaluation


def find_blind_borders(
    flow: FlowField, geometry: GridGeometry, focal: float, longest: float
) -> BlindBorders:
    """Infer near obstacles at both borders of ``flow``.

    ``longest`` [px] is the longest vector that the flow processor can measure.
    """
    motion = flow.motion
    columns = blind_border(
        flow.points.reshape(-1, 2),
        geometry.fall,
        geometry.column,
        flow.vectors.reshape(-1, 2),
        flow.confidence.reshape(-1),
        motion.rotation,
        focal,
        float(geometry.off_axis[0].max()) + _SLACK,
        float(motion.translation[2]),
        longest,
    )
    evaluation = infer_rows(load_system("border"), np.ascontiguousarray(columns[:, :2].T))
    degree = evaluation.degree("border", "near") * (columns[:, 1] >= 0.0)
    hidden = np.zeros((2, flow.shape[1]))
    last_left, first_right = int(columns[0, 3]), int(columns[1, 3])
    if degree[0] > 0.0:
        hidden[0, : last_left + 1], hidden[1, : last_left + 1] = _BEYOND * columns[0, 2], degree[0]
    if degree[1] > 0.0:
        hidden[0, first_right:], hidden[1, first_right:] = _BEYOND * columns[1, 2], degree[1]
    return BlindBorders(hidden, evaluation)
