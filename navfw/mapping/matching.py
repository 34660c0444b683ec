"""Matches the points seen around a key pose to the map that earlier submaps make.

The map is a floor plan of surfaces, to which ``PlanField`` fits the points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navfw.localization.plan_field import PlanField, PlanScan
from navfw.mapping.evidence_grid import EvidenceGrid, KeyPose
from navfw.numerics import Array
from navfw.signals import GrownGrid, Pose
from navfw.topomap.occupancy_map import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from navfw.topomap.sharpening import sharpened

_POINT_SIGMA = 0.03  # chosen
"""Standard deviation [m] of a surface point in a submap."""

_MAX_POINTS = 300  # chosen
"""Approximate largest number of points of free ground that are compared."""

_MIN_POINTS, _MIN_SHARE = 40, 0.5  # chosen
"""Smallest number of points that the map must have seen before, and smallest share of all."""

_MIN_OVERLAP = 0.6  # chosen
"""Share of a submap's free ground that the map must know as free for them to be of one place: the
other side of a wall is 0.1 m from this one."""

_MIN_BELONGING, _MAX_CONTRADICTION = 0.5, 0.05  # chosen
"""Smallest share of the points in observed ground that lie on surfaces of the map, and largest
share of the free ground that is occupied in the map."""

_BEFORE = 0.2  # chosen
"""Distance [m] in front of a point at which the map must have free ground: it then shows the same
side of the surface."""

_REFERENCES = 30  # chosen
"""Largest number of earlier submaps that make the map: the nearest ones."""


@dataclass(frozen=True, slots=True)
class SubmapMatch:
    """A pose in ``map`` of a key pose at which its submap fits earlier ones.

    ``information`` (3, 3) is that of the points. ``rating`` is their mean log likelihood.
    """

    pose: Pose
    information: Array
    rating: float


def plan_of(grid: GrownGrid) -> OccupancyMap:
    """Convert a grid to a floor plan of free, occupied and unknown cells."""
    cells = np.full(grid.log_odds.shape, UNKNOWN, np.int8)
    cells[grid.free] = FREE
    cells[grid.occupied] = OCCUPIED
    x, y = (v - 0.5 * grid.cell for v in grid.origin)
    return OccupancyMap(cells, grid.cell, Pose(x, y, 0.0))


def free_ground(keys: Sequence[KeyPose], cell: float) -> Array:
    """Sample the free ground (n, 2) [m] of ``keys``, in the robot's frame at the last one.

    ``cell`` [m] is the edge of a cell of their submaps.
    """
    last, points = keys[-1], []
    for key in keys:
        rows, columns = np.nonzero(key.submap.evidence < 0)
        some = slice(None, None, max(1, len(keys) * len(rows) // _MAX_POINTS))
        cells = np.stack([columns, rows], axis=1)[some]
        centres = np.asarray(key.submap.corner + cells * cell, dtype=np.float64)
        points.append(last.submap.key.points_to_local(centres))
    return np.concatenate(points)


class LocalPlan:
    """The map around a place, made of earlier key poses, to which submaps are matched.

    ``field`` rates poses of points that were seen there.
    """

    def __init__(self, keys: Sequence[KeyPose], cell: float) -> None:
        canvas = EvidenceGrid(cell)
        for key in keys:
            canvas.merge(key)
        plan = plan_of(GrownGrid(sharpened(canvas.cells), canvas.origin, cell))
        self._plan, self.field = plan, PlanField(plan, surfaces=True)

    @classmethod
    def around(
        cls, pose: Pose, keys: Sequence[KeyPose], reach: float, cell: float
    ) -> LocalPlan | None:
        """Make the map of the ``keys`` within ``reach`` [m] of ``pose``; None if there are none."""
        away = [math.hypot(key.pose.x - pose.x, key.pose.y - pose.y) for key in keys]
        order = np.argsort(away, kind="stable")[:_REFERENCES]
        near = sorted(i for i in order.tolist() if away[i] <= reach)
        return cls([keys[i] for i in near], cell) if near else None

    def match(
        self, scan: PlanScan, floor: Array, start: Pose, information: Array
    ) -> SubmapMatch | None:
        """Fit ``scan`` from ``start`` with prior ``information``; None if it does not fit.

        ``floor`` (n, 2) [m] is free ground of the same submap, in the robot's frame.
        """
        pose = start
        for _ in range(2):
            seen = self._seen_before(scan, pose)
            needed = max(_MIN_POINTS, _MIN_SHARE * len(scan.points))
            if len(seen.points) < needed or len(floor) == 0:
                return None
            fit = self.field.match(seen, start, information)
            pose = fit.pose
        states = self._plan.state(pose.points_to_parent(floor))
        overlap = float((states == FREE).mean()) >= _MIN_OVERLAP
        agreed = float((states == OCCUPIED).mean()) <= _MAX_CONTRADICTION
        if not overlap or not agreed or fit.belonging < _MIN_BELONGING:
            return None
        at = np.array([[pose.x, pose.y, pose.yaw]])
        rating = float(self.field.rate(seen, at, _POINT_SIGMA)[0])
        return SubmapMatch(pose, fit.information, rating)

    def _seen_before(self, scan: PlanScan, pose: Pose) -> PlanScan:
        """Return the points of ``scan`` at ``pose`` that the map shows from the same side."""
        rays = scan.origins - scan.points
        length = np.maximum(np.hypot(rays[:, 0], rays[:, 1]), _BEFORE)
        before = scan.points + _BEFORE / length[:, None] * rays
        known = self._plan.state(pose.points_to_parent(before)) == FREE
        return PlanScan(scan.points[known], scan.sigma[known], scan.origins[known])
