"""Ways of a long body that cannot turn where it stands: three-point turns, and backing out.

A round body follows the cheapest way of the local planner as it is. A long one sweeps more than
that: in a corridor narrower than its turning circle it must know before how it will turn.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from navfw.localmap.free_distances import blind_ground, ground_of
from navfw.localmap.manoeuvre_kernels import search_lattice
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.localmap.ray_kernels import SLACK, Ground, body_room
from navfw.numerics import Array
from navfw.signals import Pose

_GAPS = np.ones((3, 3), np.uint8)
_NO_WAY: Array = np.empty((0, 4))
_PROGRESS = 2.0
"""Distance [m] by which a way comes nearer to the waypoint."""
_OFF = 0.12
"""Distance [m] off the way, a radian off its heading as _LEVER [m], at which it is left."""
_LEVER = 0.3
_GOAL_MOVED = 0.4
"""Distance [m] by which the waypoint moves before the way is planned anew."""
_RETRY = 30
"""Plans between two searches when there was no way."""
_LEAD = 0.25
"""Distance [m] along the way of the point to head for."""
_WINDOW = 8
"""Poses ahead on the way among which the robot looks for its own."""
_SPARE = (0.06, 0.0)
"""Clearances [m] beyond the margin, of which the first with which there is a way is kept."""
_TOUCH = 0.02
"""Distance [m], with each radian of a turn as _LEVER [m], within which the body stands."""
_STALLED = 90
"""Plans that a body stands before its way is dropped, for as many plans."""
_AHEAD = 15
"""Poses ahead on the way by which it is narrow."""
_FAR = 8
"""Poses ahead on the way of the point to head for where there is room."""
_TIGHT = 0.15
"""Clearance [m] beyond the margin below which the body keeps to the way at a manoeuvre's speed."""


class Manoeuvres:
    """The way of one long body to the waypoint; it is kept until it is driven, barred or left."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Back to no way."""
        self._way: Array = _NO_WAY
        self._goal = (math.inf, math.inf)
        self._wait = 0
        self._stood = Pose(0.0, 0.0, 0.0), 0
        self._room = math.inf

    def next_point(
        self,
        occupancy: OccupancyGrid,
        pose: Pose,
        goal: tuple[float, float],
        value: Array,
        margin: float,
    ) -> tuple[float, float, int | None] | None:
        """The odom point (x, y) [m] to head for from odom ``pose``, and the gear to it.

        The gear is 1 ahead, -1 back and 0 for a turn on the spot toward the point; None where there
        is room, and the body may drive as it likes. No point: there is no way to ``goal`` (odom).
        ``value`` is the local planner's cost-to-go; the body keeps ``margin`` [m].
        """
        seen = cv2.dilate(occupancy.observed, _GAPS).astype(np.uint8, copy=False)
        ground, discs = ground_of(occupancy, seen), np.array(occupancy.robot.discs)
        same = math.dist(goal, self._goal) <= _GOAL_MOVED
        if self._stalled(pose):
            self._way, self._wait = _NO_WAY, _STALLED
        if not (same and self._holds(ground, discs, margin, pose)):
            self._way = _NO_WAY
            self._wait = self._wait - 1 if same else 0
            if self._wait > 0:
                return None
            self._goal = goal
            start, blind = (pose.x, pose.y, pose.yaw), blind_ground(occupancy)
            for spare in _SPARE:
                self._way = search_lattice(
                    ground, blind, discs, margin + spare, value, start, _PROGRESS
                )
                if len(self._way):
                    break
            self._wait = 0 if len(self._way) else _RETRY
            if not self._holds(ground, discs, margin, pose):
                return None
        if self._room > _TIGHT and not (self._way[1:, 3] < 1.0).any():
            x, y, _, _ = self._way[min(_FAR, len(self._way) - 1)]
            return float(x), float(y), None
        return self._lead(pose)

    def _holds(self, ground: Ground, discs: Array, margin: float, pose: Pose) -> bool:
        """Whether the robot is on the way, with a rest of it, and the rest is free."""
        if len(self._way) < 2:
            return False
        away = np.hypot(self._way[:, 0] - pose.x, self._way[:, 1] - pose.y)
        turned = np.abs((self._way[:, 2] - pose.yaw + math.pi) % (2.0 * math.pi) - math.pi)
        near = int(np.argmin(away[:_WINDOW] + _LEVER * turned[:_WINDOW]))
        if away[near] + _LEVER * turned[near] > _OFF or near >= len(self._way) - 1:
            return False
        self._way = self._way[near:]
        rooms = [body_room(ground, x, y, yaw, discs, margin) for x, y, yaw, _ in self._way]
        self._room = min(rooms[:_AHEAD])
        return min(rooms) >= min(0.0, rooms[0]) - SLACK

    def _stalled(self, pose: Pose) -> bool:
        """Whether the body has stood for _STALLED plans since this was last so."""
        at, count = self._stood
        if math.hypot(pose.x - at.x, pose.y - at.y) + _LEVER * abs(pose.yaw - at.yaw) > _TOUCH:
            self._stood = pose, 0
            return False
        self._stood = at, (count + 1) % _STALLED
        return count + 1 == _STALLED

    def _lead(self, pose: Pose) -> tuple[float, float, int]:
        """The point of the first run of one gear that is _LEAD ahead, or its end."""
        gear = int(self._way[1, 3])
        run = 1
        way = 0.0
        while run + 1 < len(self._way) and self._way[run + 1, 3] == gear and way < _LEAD:
            way += math.dist(self._way[run, :2], self._way[run - 1, :2])
            run += 1
        x, y, yaw = self._way[run, :3]
        if gear == 0:
            while run + 1 < len(self._way) and self._way[run + 1, 3] == gear:
                run += 1
            yaw = self._way[run, 2]
            return pose.x + math.cos(yaw), pose.y + math.sin(yaw), 0
        return float(x), float(y), gear
