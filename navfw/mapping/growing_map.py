"""The growing map: submaps at key poses, joined to one global grid of evidence.

A key pose is taken every 1.2 m or 0.8 rad, with a submap of what was observed since the last one.
Submaps are merged in their order, so that later observations supersede earlier ones. If the robot
comes back to known ground, the key poses are corrected, and the grid is recomputed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from navfw.localization.plan_field import PlanScan, ScanMemory, scan_of
from navfw.localmap import LocalMap
from navfw.mapping.evidence_grid import EvidenceGrid, KeyPose
from navfw.mapping.loop_closing import FAR, LoopClosing
from navfw.mapping.pose_graph import UNKNOWN, KeyPoseGraph, Relation
from navfw.mapping.submaps import SubmapCutter
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, OccupiedDisc, Odometry, Percept, Pose, wrap_angle

_NEAR, _SCAN_EVERY = 2.4, 0.15  # chosen
"""Path [m] whose points are matched together, and between two images that give points."""

_EXACT, _POINTS = 0.15, 400  # measured
"""Largest standard deviation [m] of matched points, and about how many are. In two tours 95 % of
the points below 0.1 m lay within 0.08 m of a true surface, below 0.2 m within 0.2 m."""

_KEPT = 150  # chosen
"""Approximate number of points that are kept for each key pose."""

_KEY_DISTANCE, _KEY_TURN = 1.2, 0.8  # chosen
"""Distance driven [m], or turn [rad], between key poses."""

_NO_SCAN = PlanScan(np.empty((0, 2)), np.empty(0), np.empty((0, 2)))  # defined

_UNRELATED = 100.0  # chosen
"""Path [m] assumed between two maps that are joined, as the path between them is unknown."""

_BLOCK = 32  # chosen
"""Cells along the side of the blocks that store when each cell was seen last."""

_SETTLED = 0.02  # chosen
"""Distance [m], or turn [rad], that a key pose may move before the grid is recomputed."""


class GrowingMap:
    """Joins what one robot's local map observes to a grid in the frame ``map``.

    With ``close_loops`` the poses are corrected when the robot sees known ground again. Without it,
    a localiser places each submap permanently, and no key poses are kept. ``correction`` is the
    pose of ``odom`` in ``map``. ``keys`` are the key poses that are kept, ``clouds`` some of the
    points seen around each.
    """

    def __init__(self, robot: RobotModel, close_loops: bool = True) -> None:
        self.robot = robot
        self._close_loops = close_loops
        self._cutter = SubmapCutter()
        self.reset()

    def reset(self, start: Pose | None = None) -> None:
        """Begin an empty map in which the robot is at ``start``, by default the origin."""
        self._start = start or Pose(0.0, 0.0, 0.0)
        self._cutter.reset()
        self.keys: list[KeyPose] = []
        self.loops = LoopClosing()
        self._graph = KeyPoseGraph()
        self._recent, self._scans = ScanMemory(_NEAR), ScanMemory(FAR)
        self._scanned_at = -math.inf
        self._path = 0.0
        self.correction = self._start
        self._grid: EvidenceGrid | None = None
        self._odometry: Odometry | None = None
        self._local_map: LocalMap | None = None
        self._moving: Sequence[OccupiedDisc] = ()
        self.clouds: list[PlanScan] = []
        self._seen: dict[tuple[int, ...], npt.NDArray[np.float32]] = {}
        self._driven = self._turned = 0.0

    # --- writing ---------------------------------------------------------------------------------

    def update(
        self,
        odometry: Odometry,
        local_map: LocalMap,
        moving: Sequence[OccupiedDisc] = (),
        percept: Percept | None = None,
        seen_from: Pose | None = None,
        placed: Pose | None = None,
    ) -> bool:
        """Take in a camera frame, after ``local_map`` has; return whether a key pose was added.

        Cells under ``moving`` obstacles (odom) are left out. ``percept``, seen from the odom pose
        ``seen_from``, shows the surfaces by which the robot recognises known ground. ``placed`` is
        a localiser's pose in ``map``, if there is one.
        """
        last, self._odometry = self._odometry, odometry
        self._local_map, self._moving = local_map, moving
        if last is None:
            self.correction = self._start.frame_of(odometry.pose)
            self._grid = EvidenceGrid(local_map.occupancy.params.cell)
        if placed is not None:
            self.correction = placed.frame_of(odometry.pose)
        if last is None:
            return False
        step = last.pose.relative(odometry.pose)
        self._path += math.hypot(step.x, step.y)
        self._driven += math.hypot(step.x, step.y)
        if percept is not None and seen_from is not None:
            self._remember(percept, seen_from)
        self._turned += abs(step.yaw)
        if self._driven < _KEY_DISTANCE and self._turned < _KEY_TURN:
            return False
        self.finish()
        return True

    def finish(self) -> None:
        """Add a key pose at the robot's pose, with what was observed since the last one."""
        if self._odometry is None or self._local_map is None or self._grid is None:
            return
        self._driven = self._turned = 0.0
        odom, time = self._odometry.pose, self._odometry.time
        submap = self._cutter.cut(self._local_map, odom, time, self._moving)
        key = KeyPose(submap, self.correction.compose(odom), self._path)
        self._grid.merge(key)
        self._note_time(key, self._grid.cell)
        if not self._close_loops:
            return
        step = self.keys[-1].submap.key.relative(odom) if self.keys else None
        self.keys.append(key)
        self._graph.add(key.pose, step)
        self._recent.forget(self._path - _NEAR)
        self.clouds.append(self._recent.cloud(odom, _KEPT) if len(self._recent) else _NO_SCAN)
        if len(self._recent):
            near, far = (scans.cloud(odom, _POINTS) for scans in (self._recent, self._scans))
            relations = self.loops.observe(self.keys, near, far, self._grid.cell)
            if relations:
                self._graph.matches += relations
                self._settle(len(self.keys))

    def end(self) -> None:
        """Add the last key pose; later observations are not added to this map."""
        self.finish()
        self._local_map = None

    def _note_time(self, key: KeyPose, cell: float) -> None:
        """Keep when the cells of the submap of ``key`` were seen."""
        canvas = EvidenceGrid(cell)
        canvas.merge(key)
        cells = np.argwhere(canvas.cells) + np.rint(np.array(canvas.origin[::-1]) / cell)
        unseen = np.full((_BLOCK, _BLOCK), np.nan, np.float32)
        for block in np.unique(cells // _BLOCK, axis=0):
            times = self._seen.setdefault(tuple(block.tolist()), unseen.copy())
            rows, columns = (cells[(cells // _BLOCK == block).all(axis=1)] % _BLOCK).T.astype(int)
            times[rows, columns] = key.submap.time

    def _remember(self, percept: Percept, seen_from: Pose) -> None:
        """Keep the points of ``percept`` that are exact, if the last ones are far enough behind."""
        if self._path - self._scanned_at < _SCAN_EVERY:
            return
        scan = scan_of(percept, self.robot)
        exact = scan.sigma < _EXACT
        if exact.any():
            parts = (scan.points[exact], scan.sigma[exact], scan.origins[exact])
            for scans in (self._recent, self._scans):
                scans.add(self._path, seen_from, PlanScan(*parts))
            self._scanned_at = self._path

    def join(self, other: GrowingMap, frame: Pose, relations: Sequence[Relation]) -> None:
        """Add all key poses of ``other``, whose frame ``map`` has the pose ``frame`` in this one's.

        ``relations`` are between key poses of this map and those of the other, numbered after them.
        """
        count, path = len(self.keys), self._path + _UNRELATED
        for before, key in zip([None, *other.keys], other.keys, strict=False):
            moved = replace(key, pose=frame.compose(key.pose), path=path + key.path)
            known = None if before is None else before.submap.key.relative(key.submap.key)
            step = self.keys[-1].pose.relative(moved.pose) if known is None else known
            self._graph.add(moved.pose, step, UNKNOWN if known is None else None)
            self.keys.append(moved)
        self.clouds += other.clouds
        self._graph.matches += [
            replace(match, first=match.first + count, second=match.second + count)
            for match in other.matches
        ]
        self._graph.matches += relations
        self._path = self.keys[-1].path
        self._settle(count)

    def _settle(self, count: int) -> None:
        """Fit the key poses; make the grid anew where some have moved.

        The first ``count`` are in the grid already; the last of them shows where ``odom`` is.
        """
        self._graph.optimize()
        before = self.keys[:count]
        self.keys = [
            key if _moved(key.pose, pose) < _SETTLED else replace(key, pose=pose)
            for key, pose in zip(self.keys, self._graph.poses, strict=True)
        ]
        changed = [
            at
            for old, new in zip(before, self.keys, strict=False)
            for at in (old, new)
            if new is not old
        ]
        changed += self.keys[count:]
        if self._odometry is not None:
            odom = self.keys[count - 1].submap.key
            self.correction = self._graph.poses[count - 1].frame_of(odom)
        if self._grid is not None:
            self._grid.renew(self.keys, changed)

    # --- reading ---------------------------------------------------------------------------------

    @property
    def begun(self) -> bool:
        """Whether there was an ``update``."""
        return self._odometry is not None

    @property
    def pose(self) -> Pose:
        """The robot's pose in ``map``, by corrected odometry."""
        if self._odometry is None:
            return self._start
        return self.correction.compose(self._odometry.pose)

    @property
    def matches(self) -> tuple[Relation, ...]:
        """The matches between key poses that closed loops."""
        return tuple(self._graph.matches)

    @property
    def grid(self) -> GrownGrid:
        """All that has been observed so far, also since the last key pose.

        Raises:
            RuntimeError: there was no ``update`` yet.

        """
        if self._odometry is None or self._grid is None:
            raise RuntimeError("the growing map has observed nothing yet; call update first")
        odom, time = self._odometry.pose, self._odometry.time
        canvas = self._grid.copy()
        if self._local_map is not None:
            newest = self._cutter.observed(self._local_map, odom, time, self._moving)
            canvas.merge(KeyPose(newest, self.pose))
        return GrownGrid(canvas.cells, canvas.origin, canvas.cell)

    def last_seen(self, x: float, y: float) -> float | None:
        """Return when [s] ground around x, y [m, map] was last seen; None if it never was."""
        cell = 1.0 if self._grid is None else self._grid.cell
        row, column = round(y / cell), round(x / cell)
        times = self._seen.get((row // _BLOCK, column // _BLOCK))
        time = math.nan if times is None else float(times[row % _BLOCK, column % _BLOCK])
        return None if math.isnan(time) else round(time, 2)

    @property
    def drops(self) -> Array:
        """Spots (n, 2) [m, map] whose floor is missing, seen around the key poses that are kept."""
        spots = [key.correction.points_to_parent(key.submap.drops) for key in self.keys]
        return np.concatenate(spots) if spots else np.empty((0, 2))


def _moved(a: Pose, b: Pose) -> float:
    """Return the distance [m] between two poses, or their turn [rad] if that is larger."""
    return max(math.hypot(a.x - b.x, a.y - b.y), abs(wrap_angle(a.yaw - b.yaw)))
