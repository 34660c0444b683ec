"""The search for an unknown pose on a floor plan, by the scans of the last metres.

What was seen is kept in the frame ``odom``, whose pose in ``map`` is then the one unknown. All
poses of the robot on free ground are rated coarsely, the best ones refined and rated again; the
pose is found when one of them is much more probable than all others, several times in a row.
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from navfw.localization.plan_field import PlanField, PlanScan, ScanMemory
from navfw.numerics import Array
from navfw.signals import Pose, wrap_angle
from navfw.topomap.occupancy_map import OccupancyMap

MEMORY = 8.0  # chosen
"""Distance driven [m] for which scans are kept: odometry is exact enough over it."""

EVERY = 0.75  # chosen
"""Distance driven [m] between two searches."""

_MIN_SCANS = 10  # chosen
"""Least number of scans for a search, each of one image."""

SPACING = 0.25  # chosen
"""Distance [m] between the poses of the coarse search; more on plans with more than _MAX_POSES."""

HEADINGS = 24  # chosen
"""Number of headings of the coarse search."""

_MAX_POSES = 250_000  # chosen
"""Largest number of poses of the coarse search."""

_COARSE_SIGMA, _FINE_SIGMA = 0.25, 0.06  # chosen
"""Standard deviation [m] of the walls in the coarse rating, whose poses are off by as much, and in
the fine one."""

_COARSE_POINTS, _FINE_POINTS = 80, 400  # chosen
"""Number of points in the two ratings."""

_MAX_RATED = 4000  # chosen
"""Number of coarse poses whose rays are followed."""

_CANDIDATES = 40  # chosen
"""Number of coarse poses that are refined."""

APART = 0.6, math.radians(25.0)  # chosen
"""Distance [m] and angle [rad] beyond which two poses are different ones."""

_LOOSE = np.diag([0.2**-2, 0.2**-2, 0.12**-2])  # chosen
"""Information of a coarse pose."""

_EVIDENCE = 2.0  # chosen
"""Number of independent points of a scan: its columns of cells share walls and errors."""

_MAX_EVIDENCE = 40.0  # chosen
"""Largest number of independent points of all scans: things that the plan does not show are in many
of them, at the same place."""

_BLOCKED = 4.0  # chosen
"""Log likelihood that a ray costs which a wall of the plan would have blocked: the plan may show
walls that are not there."""

_THROUGH_WALLS = 0.5  # chosen
"""Log likelihood that it costs if the robot's path leads through walls of the plan."""

_MIN_CLEARANCE = 0.08  # chosen
"""Clearance [m] below which the robot cannot have stood at a point of the plan."""

_AGREEING = 3  # chosen
"""Number of searches in a row that must find the same pose."""

CERTAIN = 0.98  # chosen
"""Probability above which a pose is found."""

_RATED_AT_ONCE, _FOLLOWED_AT_ONCE, _REFINED_AT_ONCE = 2000, 200, 2  # chosen
"""Poses that one part of a search rates, whose rays it follows, and that it refines: some 5 ms."""

_PARTS, _MAX_PARTS = 60.0, 12  # chosen
"""Parts of a search in a second, and in one call: all of it at once would stop a robot."""


class PlanSearch:
    """Collects scans with their poses in ``odom``, and searches the plan for where they fit.

    ``hypotheses`` is the number of poses that the last search could not distinguish, including the
    best; 0 before the first. ``least`` scans are needed for a search.
    """

    def __init__(
        self, plan: OccupancyMap, field: PlanField, radius: float, least: int = _MIN_SCANS
    ) -> None:
        self._least = least
        self._field = field
        self._grid = _free_poses(plan, field, radius)
        self._scans = ScanMemory(MEMORY)
        self._searched_at = -math.inf
        self.hypotheses = 0
        self._search: Generator[None, None, Pose | None] | None = None
        self._previous_frame: Pose | None = None  # that of odom in map, by the last search
        self._agreed = 0

    def add(self, driven: float, odom: Pose, scan: PlanScan) -> None:
        """Add a scan that was seen from ``odom`` after ``driven`` [m]."""
        self._scans.add(driven, odom, scan)

    def forget(self, before: float) -> None:
        """Drop the scans that were seen less than ``before`` [m] after the start."""
        self._scans.forget(before)
        self._search = None

    def begin(self) -> None:
        """Begin a search, unless one goes on, or scans or distance driven do not suffice yet."""
        if self._search is not None or len(self._scans) < self._least:
            return
        driven, odom = self._scans.newest
        if driven - self._searched_at >= EVERY:
            self._searched_at = driven
            self._search = self._best(odom)

    @property
    def searching(self) -> bool:
        """Whether a search was begun and is not finished."""
        return self._search is not None

    def go_on(self, seconds: float) -> Pose | None:
        """Do the part of a search that is due after ``seconds``, if one was begun.

        Returns the pose of ``odom`` in ``map`` when three searches in a row found it, else None.
        """
        if self._search is None:
            return None
        try:
            for _ in range(min(max(round(_PARTS * seconds), 1), _MAX_PARTS)):
                next(self._search)
        except StopIteration as end:
            self._search, frame = None, end.value
            return self._agreed_on(frame)
        return None

    def _agreed_on(self, frame: Pose | None) -> Pose | None:
        """Return ``frame`` if several searches in a row have found it, else None."""
        previous, odom = self._previous_frame, self._scans.newest[1]
        self._previous_frame = frame
        if frame is None:
            return None
        again = previous is not None and are_close(previous.compose(odom), frame.compose(odom))
        self._agreed = self._agreed + 1 if again else 1
        return frame if self._agreed >= _AGREEING else None

    def advantage(self, pose: Pose, other: Pose, odom: Pose) -> float:
        """Return the mean log likelihood of the scans at ``pose`` minus that at ``other``.

        Both are poses in ``map`` of the robot at ``odom``.
        """
        cloud = self._scans.cloud(odom, _FINE_POINTS)
        poses = np.array([(at.x, at.y, at.yaw) for at in (pose, other)])
        better, worse = self._rating(cloud, poses).tolist()
        return float(better - worse)

    def _rating(self, cloud: PlanScan, poses: Array) -> Array:
        """Rate ``poses`` (m, 3) by the scans' mean log likelihood, blocked rays included."""
        blocked = self._field.blocked(cloud, poses)
        return self._field.rate(cloud, poses, _FINE_SIGMA) - _BLOCKED * blocked

    def _best(self, odom: Pose) -> Generator[None, None, Pose | None]:
        """Find the one frame of ``odom`` that explains the scans, if others are improbable."""
        coarse, cloud = (self._scans.cloud(odom, n) for n in (_COARSE_POINTS, _FINE_POINTS))
        path = np.array([(at.x, at.y) for at in map(odom.relative, self._scans.poses)])
        evidence = min(_EVIDENCE * len(self._scans), _MAX_EVIDENCE)
        kept = yield from self._rated(coarse, self._grid, _COARSE_SIGMA)
        refined: list[Pose] = []
        for number, k in enumerate(kept):
            start = Pose(*self._grid[k].tolist())
            refined.append(self._field.match(cloud, start, _LOOSE).pose)
            if number % _REFINED_AT_ONCE == 0:
                yield
        poses = np.array([(pose.x, pose.y, pose.yaw) for pose in refined])
        rating = self._rating(cloud, poses)
        impossible = self._impossible(poses, path)
        rating -= _THROUGH_WALLS * impossible
        needed = math.log(CERTAIN / (1.0 - CERTAIN)) / evidence
        fitting: list[Pose] = []
        order = np.argsort(-rating, kind="stable")
        for k in order[rating[order] > rating[order[0]] - needed].tolist():
            if not any(are_close(refined[k], other) for other in fitting):
                fitting.append(refined[k])
        self.hypotheses = len(fitting)
        one = self.hypotheses == 1 and not impossible[order[0]]
        return fitting[0].frame_of(odom) if one else None

    def _rated(
        self, cloud: PlanScan, poses: Array, sigma: float
    ) -> Generator[None, None, list[int]]:
        """Rate ``poses`` (m, 3); return the best by index, best first, all of them apart."""
        ratings = []
        for first in range(0, len(poses), _RATED_AT_ONCE):
            ratings.append(self._field.rate(cloud, poses[first : first + _RATED_AT_ONCE], sigma))
            yield
        rating = np.concatenate(ratings)
        best = np.argsort(-rating, kind="stable")[:_MAX_RATED]
        blocked = []
        for first in range(0, len(best), _FOLLOWED_AT_ONCE):
            some = poses[best[first : first + _FOLLOWED_AT_ONCE]]
            blocked.append(self._field.blocked(cloud, some))
            yield
        rating = rating[best] - _BLOCKED * np.concatenate(blocked)
        kept: list[int] = []
        for k in best[np.argsort(-rating, kind="stable")].tolist():
            if all(_gap(poses[k], poses[other]) > 1.0 for other in kept):
                kept.append(k)
            if len(kept) == _CANDIDATES:
                break
        return kept

    def _impossible(self, poses: Array, path: Array) -> Array:
        """Return which of ``poses`` (m, 3) would have led the robot through a wall or off the plan.

        ``path`` (n, 2) [m] is where it came from, in its own frame.
        """
        blocked = []
        for pose in poses.tolist():
            clearance = self._field.clearance(Pose(*pose).points_to_parent(path))
            blocked.append(not bool((clearance > _MIN_CLEARANCE).all()))
        return np.array(blocked)


def _free_poses(plan: OccupancyMap, field: PlanField, radius: float) -> Array:
    """Return poses (m, 3) all over the free ground where a robot of ``radius`` [m] fits."""
    fits = plan.free & (field.cells * plan.resolution > 0.8 * radius)
    area = float(fits.sum()) * plan.resolution**2
    spacing = max(SPACING, math.sqrt(area * HEADINGS / _MAX_POSES))
    step = max(1, round(spacing / plan.resolution))
    coarse = np.zeros_like(fits)
    coarse[::step, ::step] = True
    places = plan.centres(*np.nonzero(fits & coarse))
    headings = 2.0 * math.pi / HEADINGS * np.arange(HEADINGS)
    return np.column_stack([np.repeat(places, HEADINGS, axis=0), np.tile(headings, len(places))])


def _gap(a: Array, b: Array) -> float:
    """Return the difference of two poses (3,), 1 where they begin to be different ones."""
    distance = math.hypot(a[0] - b[0], a[1] - b[1]) / APART[0]
    return max(distance, abs(wrap_angle(float(a[2] - b[2]))) / APART[1])


def are_close(a: Pose, b: Pose) -> bool:
    """Return whether two poses are the same to within 0.6 m and 25 degrees."""
    return _gap(np.array([a.x, a.y, a.yaw]), np.array([b.x, b.y, b.yaw])) < 1.0
