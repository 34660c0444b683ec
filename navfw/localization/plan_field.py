"""A floor plan as a field of distances from its walls, and seen points matched to it.

Seen points are those of a percept on upright surfaces, in base_link, with their sigmas; the memory
keeps scans in the odom frame while the robot moves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.localization import plan_kernels
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Label, Percept, Pose
from navfw.topomap.occupancy_map import OccupancyMap

_MIN_HEIGHT, MAX_HEIGHT = 0.12, 2.0  # chosen
"""Heights [m above the floor] between which seen points count: below is the floor with its error,
above may be the ceiling."""

MAX_DEPTH = 4.0  # chosen
"""Largest depth [m] of a point."""

MIN_CONFIDENCE = 0.3  # chosen
"""Least confidence of a cell."""

MIN_SIGMA = 0.03  # chosen
"""Least standard deviation of a depth, as a part of it: what the cells of a percept share."""


@dataclass(frozen=True, slots=True)
class PlanScan:
    """Seen points (n, 2) [m, base_link], with standard deviations (n,) [m] along the rays.

    ``origins`` (n, 2) [m, base_link] is where the camera was when it saw each point.
    """

    points: Array
    sigma: Array
    origins: Array


def scan_of(percept: Percept, robot: RobotModel) -> PlanScan:
    """Extract the points of upright surfaces in ``percept``: 0.12 to 2 m high, up to 4 m deep."""
    camera = robot.camera
    nearness = percept.nearness
    upright = (percept.label == Label.OBSTACLE) | (percept.label == Label.ABOVE)
    used = (
        upright
        & (percept.confidence >= MIN_CONFIDENCE)
        & (nearness > 1.0 / MAX_DEPTH)
        & (percept.height > _MIN_HEIGHT)
        & (percept.height < MAX_HEIGHT)
    )
    depth = 1.0 / nearness[used]
    image = percept.points[used] / camera.focal
    rays = product(np.column_stack([image, np.ones(len(image))]), camera.base_from_camera.T)
    lens = np.array([camera.mount_forward, 0.0])
    points = np.ascontiguousarray(depth[:, None] * rays[:, :2] + lens)
    relative = np.maximum(percept.sigma[used] * depth, MIN_SIGMA)
    sigma = relative * depth * np.hypot(rays[:, 0], rays[:, 1])
    return PlanScan(points, np.ascontiguousarray(sigma), np.tile(lens, (len(points), 1)))


class ScanMemory:
    """Keeps the scans of the last ``length`` [m] driven, with the robot's poses in ``odom``."""

    def __init__(self, length: float) -> None:
        self._length = length
        self._scans: deque[tuple[float, Pose, PlanScan]] = deque()

    def __len__(self) -> int:
        return len(self._scans)

    def add(self, driven: float, odom: Pose, scan: PlanScan) -> None:
        """Add a scan that was seen from odom pose ``odom`` after ``driven`` [m]."""
        self._scans.append((driven, odom, scan))
        self.forget(driven - self._length)

    def forget(self, before: float) -> None:
        """Drop scans seen before ``before`` [m] were driven; the newest one is kept."""
        while len(self._scans) > 1 and self._scans[0][0] < before:
            self._scans.popleft()

    @property
    def newest(self) -> tuple[float, Pose]:
        """Distance driven [m] and pose in ``odom`` at the newest scan; IndexError without one."""
        driven, odom, _ = self._scans[-1]
        return driven, odom

    @property
    def poses(self) -> Iterator[Pose]:
        """The robot's poses in ``odom`` from which the kept scans were seen, oldest first."""
        return (odom for _, odom, _ in self._scans)

    def cloud(self, viewpoint: Pose, count: int) -> PlanScan:
        """Return about ``count`` points of all scans, evenly picked, in the frame ``viewpoint``."""
        points, sigma, origins = [], [], []
        for _, odom, scan in self._scans:
            pose = viewpoint.relative(odom)
            points.append(pose.points_to_parent(scan.points))
            origins.append(pose.points_to_parent(scan.origins))
            sigma.append(scan.sigma)
        step = max(1, sum(map(len, sigma)) // count)
        picked = (np.concatenate(arrays)[::step] for arrays in (points, sigma, origins))
        return PlanScan(*map(np.ascontiguousarray, picked))


CORRELATION = 12.0  # chosen
"""Number of points with a common error: a column of cells shows one wall, by one pair of frames."""

SCALE_SIGMA = 0.06  # chosen
"""Standard deviation of the distances' common scale: that of the motion between the frames."""

_SEEN_THROUGH = 12  # chosen
"""Number of rays through a wall, above that of points on it, that shows that it is gone."""


@dataclass(frozen=True, slots=True)
class PlanMatch:
    """The pose at which seen points fit the plan: ``pose`` in ``map``, ``information`` (3, 3).

    The information is that of the points only. ``belonging`` in [0, 1] is the share of the points
    that belong to the plan.
    """

    pose: Pose
    information: Array
    belonging: float


class PlanField:
    """Matches seen points to the walls of ``plan``, by signed distances [cells], inside < 0.

    A wall that was seen through, from poses that explain what was seen behind it, is removed. With
    ``surfaces`` the occupied cells of the plan are surfaces, of which only one side was seen: the
    distances are those from their centres, and never negative.
    """

    def __init__(self, plan: OccupancyMap, *, surfaces: bool = False) -> None:
        self._occupied = plan.occupied.copy()
        self._through = np.zeros(self._occupied.shape, np.int64)
        if surfaces:
            self.cells = _distances(~self._occupied).astype(np.float32)
        else:
            self.cells = _signed_distances(self._occupied)
        self.resolution = plan.resolution
        self.origin = plan.origin
        c, s = np.cos(plan.origin.yaw), np.sin(plan.origin.yaw)
        self._map_from_grid = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def match(self, scan: PlanScan, start: Pose, information: Array) -> PlanMatch:
        """Fit the pose (map) to the scan, from ``start`` with prior ``information`` (3, 3)."""
        turn = self._map_from_grid
        on_grid = self.origin.relative(start)
        prior = np.diag([0.0, 0.0, 0.0, SCALE_SIGMA**-2])
        prior[:3, :3] = product(turn.T, information, turn)
        state, by_points, belonging = plan_kernels.match_points(
            scan.points,
            scan.sigma,
            scan.origins,
            self.cells,
            self.resolution,
            np.array([on_grid.x, on_grid.y, on_grid.yaw, 0.0]),
            CORRELATION * prior,
        )
        by_points = by_points / CORRELATION
        shared = by_points[:3, 3]  # with the scale, which is not known either
        pose_alone = by_points[:3, :3] - np.outer(shared, shared) / (by_points[3, 3] + prior[3, 3])
        return PlanMatch(
            self.origin.compose(Pose(*state[:3].tolist())),
            product(turn, pose_alone, turn.T),
            float(belonging),
        )

    def rate(self, scan: PlanScan, poses: Array, plan_sigma: float) -> Array:
        """Compute the mean log likelihood (m,) of a scan's points at ``poses`` (m, 3) in ``map``.

        ``plan_sigma`` [m] is the standard deviation of the walls: a wide one for coarse poses.
        """
        rating = plan_kernels.rate_poses(
            scan.points,
            scan.sigma,
            self.cells,
            self.resolution,
            self._on_grid(poses),
            plan_sigma,
        )
        return np.asarray(rating, dtype=np.float64)

    def blocked(self, scan: PlanScan, poses: Array) -> Array:
        """Compute the share (m,) of a scan's rays that walls would block at ``poses`` (m, 3)."""
        shares = plan_kernels.share_of_blocked_rays(
            scan.points, scan.origins, self.cells, self.resolution, self._on_grid(poses)
        )
        return np.asarray(shares, dtype=np.float64)

    def see_through(self, scan: PlanScan, pose: Pose) -> None:
        """Count rays of ``scan`` from ``pose`` (map) through walls; remove those often crossed."""
        plan_kernels.count_rays_through_walls(
            scan.points,
            scan.origins,
            self.cells,
            self.resolution,
            self._on_grid(np.array([[pose.x, pose.y, pose.yaw]]))[0],
            self._through,
        )
        gone = self._occupied & (self._through >= _SEEN_THROUGH)
        if gone.any():
            self._occupied &= ~gone
            self.cells = _signed_distances(self._occupied)

    def clearance(self, points: Array) -> Array:
        """Return distances (n,) [m] of ``points`` (n, 2) [m, map] from walls; NaN off the plan."""
        x, y = (self._on_grid(points).T[:2] / self.resolution).astype(np.intp)
        rows, columns = self.cells.shape
        inside = (x >= 0) & (y >= 0) & (x < columns) & (y < rows)
        clearances = np.full(len(points), np.nan)
        clearances[inside] = self.cells[y[inside], x[inside]] * self.resolution
        return clearances

    def _on_grid(self, poses: Array) -> Array:
        """Convert ``poses`` (n, 2 or 3) from ``map`` to the axes of the grid, from its corner."""
        moved = poses.astype(np.float64)
        from_corner = poses[:, :2] - (self.origin.x, self.origin.y)
        moved[:, :2] = product(from_corner, self._map_from_grid[:2, :2])
        moved[:, 2:] -= self.origin.yaw
        return moved


def _signed_distances(occupied: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
    """Compute distances [cells] of cell centres from the nearest surface, inside walls < 0."""
    outside, inside = _distances(~occupied), _distances(occupied)
    return np.where(occupied, 0.5 - inside, outside - 0.5).astype(np.float32)


def _distances(away: npt.NDArray[np.bool_]) -> Array:
    """Compute the distance [cells] of each cell's centre from the nearest cell that is False.

    OpenCV's precise transform is not used: its last bits differ from process to process.
    """
    from scipy.ndimage import distance_transform_edt  # takes a tenth of a start's time

    if away.all():
        return np.full(away.shape, float(max(away.shape)))
    return np.asarray(distance_transform_edt(away), dtype=np.float64)
