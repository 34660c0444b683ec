"""Loop closing: when the robot comes back to ground that it has seen, its pose is corrected.

At each key pose the points seen over the last metres are matched to the map of earlier submaps.
After a short drive the pose is known well enough for one match to count. After a long one, all
poses that odometry leaves possible are rated. Those that fit are hypotheses, and one of them is
accepted when it has been the best by far at several key poses in a row. Between the loops, walls
whose directions were seen before correct the heading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from navfw.egomotion.pairing import yaw_rotation
from navfw.localization.plan_field import PlanScan
from navfw.mapping.evidence_grid import KeyPose
from navfw.mapping.matching import LocalPlan, SubmapMatch, free_ground
from navfw.mapping.pose_graph import Relation
from navfw.mapping.wall_directions import WALL_SIGMA, WallDirections
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.signals import Pose, wrap_angle

_MIN_PATH, _MIN_AGE = 8.0, 30.0  # chosen
"""Path [m] and time [s] after which ground counts as seen before: until then the local map's own
evidence is in both."""

_REACH = 4.0  # chosen
"""Largest distance [m] of earlier key poses whose submaps are matched."""

_DRIFT, _DRIFT_SHARE = 0.02, 0.003  # measured
"""Standard deviation of the position by odometry [m]: a floor, and a share of the path since the
last closure. In four tours the error was 0.1 to 0.15 m after 50 m."""

_TURN, _TURN_SHARE = 0.006, 0.0005  # measured
"""Standard deviation of the heading [rad], and per path [rad/m]; it was 0.02 rad after 50 m."""

_CLOSE = 0.15  # chosen
"""Standard deviation [m] up to which a single match is sufficient."""

_MAX_SEARCH = 2.0  # chosen
"""Largest distance [m] from the predicted pose that is searched."""

_SEARCHED = 2.5  # chosen
"""Standard deviations up to which poses are searched around the predicted one."""

FAR = 6.0  # chosen
"""Length of path [m] whose points a search matches together: few places look like so much."""

_RATED = 100  # chosen
"""Number of points by which poses are rated."""

_STEP, _TURN_STEP = 0.1, 0.03  # chosen
"""Spacing [m, rad] of the poses that are rated."""

_SEARCH_SIGMA = 0.1  # chosen
"""Standard deviation [m] of the surfaces in that rating."""

_TRIED = 10  # chosen
"""Number of the best rated poses that are matched."""

_APART = 0.3, 0.06  # chosen
"""Distance [m] and turn [rad] from which on two hypotheses are different."""

_LOOSE = 0.1, 0.03  # chosen
"""Standard deviations [m, rad] of a rated pose."""

_BETTER = 0.15  # chosen
"""Mean log likelihood of the points by which the best hypothesis must exceed all others."""

_AGREEING, _MISSES = 2, 3  # chosen
"""Number of key poses that must have the same best hypothesis, and of key poses in a row without
one after which it is dropped."""

_SAME = 0.15, 0.04  # chosen
"""Distance [m] and turn [rad] up to which a hypothesis stays the same at the next key pose."""

_CAUTION = 0.5  # measured
"""Factor on a match's information: in four tours matches were off by 1.4 of their sigmas."""


class LoopClosing:
    """Finds relations between the newest key pose and earlier ones.

    ``hypotheses`` are poses in ``map`` of the newest key pose that fit the points, while none of
    them is certain. ``closed`` counts the closures, ``undecided`` those that never became certain.
    """

    def __init__(self) -> None:
        self.hypotheses: tuple[Pose, ...] = ()
        self.closed = self.undecided = 0
        self._closed_at = self._turned_at = 0.0  # path [m] of the last closure, and heading
        self._leading: Pose | None = None  # the correction by the best hypothesis so far
        self._relations: list[Relation] = []
        self._misses = 0
        self._walls = WallDirections()

    def observe(
        self, keys: Sequence[KeyPose], near: PlanScan, far: PlanScan, cell: float
    ) -> list[Relation]:
        """Match the points around the newest of ``keys``; return relations that are certain.

        ``near`` are the points of the last few metres, ``far`` those of a longer path. A relation
        of only the heading is one to the first key pose.
        """
        path, first, newest = keys[-1].path, keys[0].pose, keys[-1].pose
        turned = _TURN + _TURN_SHARE * (path - self._turned_at)
        relations = self._closed(keys, near, far, cell, turned)
        yaw = self._walls.heading(far.points, newest.yaw, turned)
        if yaw is not None:
            self._turned_at = path
            measured = Pose(0.0, 0.0, wrap_angle(yaw - first.yaw))
            information: Array = np.diag([0.0, 0.0, WALL_SIGMA**-2])
            relations.append(Relation(0, len(keys) - 1, measured, information))
        return relations

    def _closed(
        self, keys: Sequence[KeyPose], near: PlanScan, far: PlanScan, cell: float, turned: float
    ) -> list[Relation]:
        """Return the relations that close a loop; ``turned`` [rad] is the heading's error."""
        newest = keys[-1]
        earlier = [
            i
            for i, key in enumerate(keys)
            if newest.path - key.path > _MIN_PATH
            and newest.submap.time - key.submap.time > _MIN_AGE
        ]
        since = newest.path - self._closed_at
        sigma = _DRIFT + _DRIFT_SHARE * since, turned
        reach = _REACH + min(_SEARCHED * sigma[0], _MAX_SEARCH)
        plan = LocalPlan.around(newest.pose, [keys[i] for i in earlier], reach, cell)
        if plan is None:
            return []
        if sigma[0] <= _CLOSE:
            matcher = _Matcher(keys, earlier, plan, near, free_ground(keys[-1:], cell))
            match = matcher.match(newest.pose, sigma)
            self._relations = [] if match is None else [matcher.relation(match)]
            return self._confirmed(newest.path) if match is not None else []
        behind = [key for key in keys[-8:] if newest.path - key.path < FAR]
        matcher = _Matcher(keys, earlier, plan, far, free_ground(behind, cell))
        self._judge(matcher, matcher.search(sigma))
        return self._confirmed(newest.path) if len(self._relations) >= _AGREEING else []

    def _judge(self, matcher: _Matcher, matches: list[SubmapMatch]) -> None:
        """Take in the ``matches`` of one key pose, best first: one that leads again gains by it."""
        self.hypotheses = tuple(match.pose for match in matches)
        best = matches[0] if matches else None
        if best is None or any(best.rating - other.rating < _BETTER for other in matches[1:]):
            self._misses += 1
            if self._misses >= _MISSES:
                self.undecided += bool(self._relations)
                self._leading, self._relations = None, []
            return
        self._misses = 0
        newest = matcher.newest.pose
        if self._leading is None or _differ(self._leading.compose(newest), best.pose, _SAME):
            self._relations = []
        self._leading = best.pose.frame_of(newest)
        self._relations.append(matcher.relation(best))

    def _confirmed(self, path: float) -> list[Relation]:
        """Return the relations that are certain now, after ``path`` [m]."""
        relations, self._relations = self._relations, []
        self.hypotheses, self._leading, self._misses = (), None, 0
        self.closed += 1
        self._closed_at = self._turned_at = path
        return relations


def _differ(a: Pose, b: Pose, apart: tuple[float, float] = _APART) -> bool:
    """Return whether two poses are different hypotheses: farther ``apart`` [m, rad] than this."""
    turn = abs(wrap_angle(a.yaw - b.yaw))
    return math.dist((a.x, a.y), (b.x, b.y)) > apart[0] or turn > apart[1]


class _Matcher:
    """Matches one key pose to earlier ones."""

    def __init__(
        self,
        keys: Sequence[KeyPose],
        earlier: Sequence[int],
        plan: LocalPlan,
        scan: PlanScan,
        floor: Array,
    ) -> None:
        self.keys, self._earlier, self._plan = keys, earlier, plan
        self._scan, self._floor = scan, floor
        self.newest = keys[-1]

    def match(self, start: Pose, sigma: tuple[float, float]) -> SubmapMatch | None:
        """Match from ``start`` with standard deviations ``sigma`` [m, rad]."""
        information: Array = np.diag([sigma[0] ** -2, sigma[0] ** -2, sigma[1] ** -2])
        match = self._plan.match(self._scan, self._floor, start, information)
        if match is None:
            return None
        away = math.dist((match.pose.x, match.pose.y), (start.x, start.y)) / sigma[0]
        turned = abs(wrap_angle(match.pose.yaw - start.yaw)) / sigma[1]
        return match if max(away, turned) < 3.0 else None

    def search(self, sigma: tuple[float, float]) -> list[SubmapMatch]:
        """Return different matches at poses that odometry leaves possible, best first."""
        reach, turn = min(_SEARCHED * sigma[0], _MAX_SEARCH), _SEARCHED * sigma[1]
        along = np.arange(-reach, reach + 1e-6, _STEP)
        turns = np.arange(-turn, turn + 1e-6, _TURN_STEP)
        offsets = np.stack(np.meshgrid(along, along, turns, indexing="ij"), axis=-1).reshape(-1, 3)
        pose, scan = self.newest.pose, self._scan
        poses = offsets + np.array([pose.x, pose.y, pose.yaw])
        some = slice(None, None, max(1, len(scan.points) // _RATED))
        few = PlanScan(scan.points[some], scan.sigma[some], scan.origins[some])
        rating = self._plan.field.rate(few, poses, _SEARCH_SIGMA)
        tried: list[Pose] = []
        matches: list[SubmapMatch] = []
        for i in np.argsort(-rating, kind="stable").tolist():
            start = Pose(*poses[i].tolist())
            if not all(_differ(start, other) for other in tried):
                continue
            tried.append(start)
            match = self.match(start, _LOOSE)
            if match is not None:
                matches.append(match)
            if len(tried) == _TRIED:
                break
        different: list[SubmapMatch] = []
        for match in sorted(matches, key=lambda match: -match.rating):
            if all(_differ(match.pose, other.pose) for other in different):
                different.append(match)
        return different

    def relation(self, match: SubmapMatch) -> Relation:
        """Return the match as a relation between the nearest earlier key pose and the newest."""
        return relation_of(self.keys, self._earlier, match, len(self.keys) - 1)


def relation_of(
    keys: Sequence[KeyPose], earlier: Sequence[int], match: SubmapMatch, second: int
) -> Relation:
    """Return ``match`` of key pose ``second`` as a relation from the nearest ``earlier`` key."""
    at = match.pose.x, match.pose.y
    away = [math.dist((keys[i].pose.x, keys[i].pose.y), at) for i in earlier]
    first = earlier[int(np.argmin(away))]
    seen_from = keys[first].pose
    turn = yaw_rotation(seen_from.yaw)
    information = product(turn.T, _CAUTION * match.information, turn)
    return Relation(first, second, seen_from.relative(match.pose), information)
