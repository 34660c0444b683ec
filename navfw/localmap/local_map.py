"""The local map as one object: updated by the stack, queried by MOFIS, safety and planning."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import cv2
import numba
import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.localmap import free_distances
from navfw.localmap.cell_arrays import clipped_cells
from navfw.localmap.local_planner import LocalGoal, LocalPlanner, LocalPlannerParams
from navfw.localmap.occupancy_grid import OccupancyGrid, OccupancyParams
from navfw.localmap.path_sight import PathSight
from navfw.localmap.traversability import (
    MAX_SIGMA,
    TraversabilityCheck,
    TraversabilityParams,
    find_opening,
)
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Label,
    OccupiedDisc,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    SightLines,
    Stixels,
    Twist,
)

SPOT = 0.25  # chosen
"""Side of a square spot of floor [m]."""

RANGE = 1.6  # chosen
"""Largest distance of a spot that is judged [m]; farther off the floor is seen at too flat an
angle."""

CONFIDENCE = 0.3  # chosen
"""Least confidence of a flow cell that counts."""

INTERVAL = 0.1  # chosen
"""Least time between two votes [s]: nearer observations share their flow."""

_ROUNDING = 1e-6  # chosen
"""Tolerance [s] for frames that come exactly at the interval."""

_CLEAR_SIGMAS = 5.0  # chosen
CLEAR_SHARE = 0.85  # chosen
"""A point is clearly below the floor when its nearness is _CLEAR_SIGMAS standard deviations and a
factor of CLEAR_SHARE below the floor's. False positives on existing floor are very rare."""

_MIN_SIGMA = 0.02  # chosen
"""Lower bound of the sigma of nearness [1/m]."""

CLEAR_VOTES = 2  # chosen
"""Votes of an observation that is clearly below the floor."""

CERTAIN = 4  # chosen
"""Net votes from which the floor of a spot counts as missing."""

_MAX_FLOOR_VOTES = 2  # chosen
"""Bound of the votes for existing floor: from far away a drop may look like floor."""

FLOOR, DROP = int(Label.FLOOR), int(Label.DROP)

_MIN_FALL = 1e-3  # chosen
"""Least fall of a ray per metre of depth [m] at which its floor point is computed."""

_DISC_RADIUS = 0.6  # chosen
"""Radius of a missing spot as an obstacle, in sides of the spot: nearly up to its corners."""

_MIN_SPEED, _MAX_TURN = 0.15, 0.4  # chosen
"""Speed [m/s] and rate of turn [rad/s] between which the robot drives straight on."""

_COVERED = 1.5  # chosen
"""Distance [m] up to which the map says that something stands on the end of a leg."""

_LINES_TO, _SPACING = 6.0, 0.25  # chosen
"""Largest distance [m] of points on the route to which straight lines lead, and their spacing."""
_SHARES = np.linspace(0.0, 1.0, 61)[1:]  # chosen
"""Shares of a straight line at which it is checked."""


class DropMap:
    """Collects votes for missing floor, by square spots of 0.25 m in the odom frame (METHOD 2.8).

    A single flow vector below the floor is weak evidence: block matching is off by several standard
    deviations at times. One that falls short of the floor's flow by far is stronger.
    """

    def __init__(self, robot: RobotModel) -> None:
        camera = robot.camera
        self._base_from_camera = camera.base_from_camera
        self._camera = (camera.focal, float(camera.mount_height), float(camera.mount_forward))
        self.reset()

    def reset(self) -> None:
        """Drop all votes."""
        self._votes: dict[tuple[int, int], int] = {}
        # read at every frame, but changing seldom
        self._points: list[tuple[float, float]] = []
        self._time = -math.inf

    def integrate(self, percept: Percept, pose: Pose) -> None:
        """Count the votes of ``percept``, seen from odom ``pose``; at most once in 0.1 s."""
        if percept.time - self._time < INTERVAL - _ROUNDING:
            return
        self._time = percept.time
        spots, votes = _votes(
            percept.points.reshape(-1, 2),
            percept.label.ravel(),
            percept.confidence.ravel(),
            percept.nearness.ravel(),
            percept.sigma.ravel(),
            self._base_from_camera,
            self._camera,
            (pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)),
        )
        decided = False
        for (i, j), vote in zip(spots.tolist(), votes.tolist(), strict=True):
            if vote != 0:
                before = self._votes.get((i, j), 0)
                after = min(max(before + vote, -_MAX_FLOOR_VOTES), 2 * CERTAIN)
                self._votes[i, j] = after
                decided = decided or (before >= CERTAIN) != (after >= CERTAIN)
        if decided:
            self._points = [
                ((i + 0.5) * SPOT, (j + 0.5) * SPOT)
                for (i, j), count in self._votes.items()
                if count >= CERTAIN
            ]

    def points(self) -> list[tuple[float, float]]:
        """Return the centres (x, y) [m] in odom of the spots whose floor is missing."""
        return list(self._points)

    def discs(self) -> tuple[OccupiedDisc, ...]:
        """Return the spots whose floor is missing as occupied discs in odom."""
        return tuple(OccupiedDisc(x, y, _DISC_RADIUS * SPOT) for x, y in self._points)


@numba.njit(cache=True)
def _votes(
    points: Array,
    label: npt.NDArray[np.int8],
    confidence: Array,
    nearness: Array,
    sigma: Array,
    turn: Array,
    camera: tuple[float, float, float],
    pose: tuple[float, float, float, float],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Find the spots (k, 2) of floor that a percept's cells show, and a vote (k,) for each.

    The vote follows the majority of the spot's cells; a tie is 0. ``turn`` is ``base_from_camera``;
    ``camera`` its focal length [px], height, place ahead [m]; ``pose`` x, y, cos yaw, sin yaw.
    """
    focal, height, forward = camera
    x, y, c, s = pose
    spots = np.empty((label.size, 2), np.int64)
    # of each spot: its cells, those below the floor, those of them clearly below
    counts = np.zeros((label.size, 3), np.int64)
    count = 0
    for n in range(label.size):
        below = label[n] == DROP
        if not confidence[n] >= CONFIDENCE or not (below or label[n] == FLOOR):
            continue
        u, v = points[n, 0] / focal, points[n, 1] / focal
        fall = -(turn[2, 0] * u + turn[2, 1] * v + turn[2, 2])
        if not fall > _MIN_FALL:
            continue
        # where the ray meets the floor, if there is one
        depth = height / fall
        ahead = forward + depth * (turn[0, 0] * u + turn[0, 1] * v + turn[0, 2])
        left = depth * (turn[1, 0] * u + turn[1, 1] * v + turn[1, 2])
        if not math.hypot(ahead, left) <= RANGE:
            continue
        i = math.floor((x + c * ahead - s * left) / SPOT)
        j = math.floor((y + s * ahead + c * left) / SPOT)
        k = 0
        while k < count and (spots[k, 0] != i or spots[k, 1] != j):
            k += 1
        if k == count:
            spots[k, 0], spots[k, 1] = i, j
            count += 1
        counts[k, 0] += 1
        if below:
            counts[k, 1] += 1
            clear = 1.0 / depth - nearness[n] > _CLEAR_SIGMAS * max(sigma[n], _MIN_SIGMA)
            if clear and nearness[n] < CLEAR_SHARE / depth:
                counts[k, 2] += 1
    votes = np.zeros(count, np.int64)
    for k in range(count):
        cells, drops, clear_ones = counts[k]
        if 2 * drops > cells:
            votes[k] = CLEAR_VOTES if 2 * clear_ones > drops else 1
        elif 2 * drops < cells:
            votes[k] = -1
    return spots[:count], votes


class LocalMapParams(StrictModel):
    """Parameters of the local map's parts."""

    occupancy: OccupancyParams = OccupancyParams()
    local_planner: LocalPlannerParams = LocalPlannerParams()
    traversability: TraversabilityParams = TraversabilityParams()
    margin: float = Field(
        0.04, ge=0.0, le=0.3, description="clearance kept from the body's rim on arcs [m]"
    )
    memory: bool = Field(
        True, description="keep evidence from frame to frame; false: the newest percept only"
    )
    planning: bool = Field(
        True, description="local goal on the cheapest way through the grid; false: the waypoint"
    )


class LocalMap:
    """What is known of the floor around one robot, in ``odom``: it is updated, then queried."""

    def __init__(self, robot: RobotModel, params: LocalMapParams | None = None) -> None:
        self.params = params or LocalMapParams()
        self.occupancy = OccupancyGrid(robot, self.params.occupancy)
        self.drops = DropMap(robot)
        self.sight = PathSight(robot)
        self.local_planner = LocalPlanner(self.params.local_planner)
        self.traversability = TraversabilityCheck(self.params.traversability)

    def reset(self) -> None:
        """Empty the map; it has no position until the next ``update``."""
        for part in (self.occupancy, self.drops, self.sight, self.traversability):
            part.reset()
        self.local_planner.reset()

    def update(
        self,
        odometry: Odometry,
        percepts: Sequence[Percept],
        stixels: Stixels | None,
        seen_from: Pose,
        low_things: Array | None = None,
    ) -> None:
        """Move the map with the robot and integrate what the newest frame shows.

        ``seen_from`` is the odom pose of the frame. Percepts without depth add no evidence.
        """
        if not self.params.memory:
            self.occupancy.reset()
        self.occupancy.update(odometry.pose, odometry.time)
        is_straight = odometry.twist.v > _MIN_SPEED and abs(odometry.twist.w) < _MAX_TURN
        for percept in percepts:
            self.sight.observe(percept)
            if is_straight and self.sight.appeared:
                self.occupancy.doubt_view(seen_from)
            if percept.sees_depth:
                self.occupancy.integrate(percept, seen_from, weak=self.sight.weak)
                self.drops.integrate(percept, seen_from)
        if stixels is not None:
            self.occupancy.integrate_stixels(stixels, seen_from)
        if low_things is not None:
            self.occupancy.integrate_low(low_things, seen_from)

    def set_obstacles(self, moving_obstacles: tuple[OccupiedDisc, ...]) -> None:
        """Count missing floor, and ``moving_obstacles``, as occupied until the next call."""
        drops = self.drops.discs() if self.params.memory else ()
        self.occupancy.set_obstacles((*moving_obstacles, *drops))

    def forget_track(self, discs: tuple[OccupiedDisc, ...]) -> None:
        """Count floor within ``discs`` of moving obstacles as driven over no longer."""
        grid = self.occupancy
        for disc in discs:
            reach = round((disc.radius + grid.robot.reach) / grid.params.cell)
            cv2.circle(grid.driven, grid.index(disc.x, disc.y)[::-1], reach, 0, cv2.FILLED)

    # --- queries ---------------------------------------------------------------------------------

    def free_distance(self, pose: Pose, twist: Twist) -> free_distances.FreeDistance:
        """Return the free lengths [m] of ``twist`` from odom ``pose``; 0 before any ``update``."""
        return free_distances.free_distance(self.occupancy, pose, twist)

    def free_turn(self, pose: Pose, w: float) -> float:
        """Return the angle [rad] that the robot may turn on the spot in the sense of ``w``."""
        return free_distances.free_turn(self.occupancy, pose, w)

    def arcs(self, pose: Pose, speeds: Array, turns: Array) -> free_distances.Arcs:
        """Return how far all ``speeds`` x ``turns`` are free; RuntimeError before ``update``."""
        return free_distances.arcs_of(self.occupancy, pose, speeds, turns, self.params.margin)

    def ranges(self, pose: Pose) -> free_distances.Ranges:
        """Return distances from the rim all around odom ``pose``; raises like ``arcs``."""
        return free_distances.ranges_around(self.occupancy, pose)

    def local_goal(
        self,
        pose: Pose,
        target: tuple[float, float],
        moving_obstacles: tuple[OccupiedDisc, ...] = (),
    ) -> LocalGoal:
        """Plan from odom ``pose`` to ``target`` (x, y) [m, base_link]; return the local goal.

        ``moving_obstacles`` bar the path, although arcs and ranges may not count them.
        """
        if not self.params.planning:
            return LocalGoal(*target, math.hypot(*target), reachable=True, detour=1.0)
        x, y = pose.to_parent(*target)
        return self.local_planner.plan(self.occupancy, pose, x, y, moving_obstacles)

    def passage_report(
        self, queries: Callable[[], Sequence[PassageQuery]], odometry: Odometry, belief: Belief
    ) -> PassageReport | None:
        """Check the legs of the route if a check is due; None if not, or before any ``update``.

        ``queries`` returns the legs in order, the first from the robot. Drops are reported too.
        """
        pose, time = odometry.pose, odometry.time
        if not (self.occupancy.located and self.traversability.due(time)):
            return None
        asked = queries()
        passages = self.traversability.check(self.occupancy, asked, pose, belief, time)
        drops = (pose.to_local(*point) for point in self.drops.points())
        covered = [query for query in asked if self._covers(query.end, pose, belief)]
        places = ((q.end, find_opening(self.occupancy, q, pose, belief)) for q in covered)
        in_map = tuple(belief.pose.to_parent(*drop) for drop in drops)
        lines = self._sight_lines(asked, pose, belief)
        ends = tuple(query.end for query in covered)
        openings = tuple((end, opening) for end, opening in places if opening is not None)
        return PassageReport(time, passages, in_map, ends, lines, openings)

    def _sight_lines(
        self, legs: Sequence[PassageQuery], pose: Pose, belief: Belief
    ) -> SightLines | None:
        """Look along straight lines from odom ``pose`` to points on all ``legs`` but the first."""
        ends, indices = [], []
        for i, leg in enumerate(legs[1:], 1):
            count = max(round(math.dist(leg.start, leg.end) / _SPACING), 1)
            along = np.linspace(leg.start, leg.end, count + 1)[1:]
            near = along[np.hypot(*(along - (belief.pose.x, belief.pose.y)).T) <= _LINES_TO]
            ends.append(near)
            indices.append(np.full(len(near), i))
        if belief.sigma > MAX_SIGMA or not sum(map(len, ends)):
            return None
        grid, points = self.occupancy, np.concatenate(ends)
        to = pose.points_to_parent(belief.pose.points_to_local(points))
        start = np.array((pose.x, pose.y))
        line = start + _SHARES[:, None] * (to - start)[:, None]
        at, inside = clipped_cells(line, grid.origin, grid.params.cell, grid.size)
        clearance = np.where(inside, grid.clearance[at], grid.params.extent)
        observed = inside & (grid.observed[at] > 0)
        return SightLines(points, np.concatenate(indices), clearance - grid.robot.radius, observed)

    def _covers(self, end: tuple[float, float], pose: Pose, belief: Belief) -> bool:
        """Return whether something near stands on ``end`` [m, map]: the body has no room there."""
        grid, local = self.occupancy, belief.pose.to_local(*end)
        at = pose.to_parent(*local)
        if math.hypot(*local) > _COVERED or not grid.contains(*at):
            return False
        sure = belief.sigma <= MAX_SIGMA
        return sure and bool(grid.clearance[grid.index(*at)] < grid.robot.radius)
