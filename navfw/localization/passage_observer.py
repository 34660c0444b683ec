"""When the walls beside the passages of a map correct the pose: in corridors, and before doors."""

from __future__ import annotations

import math

from navfw.localization.passage_walls import (
    PassageAxis,
    PassageFix,
    corridor_fix,
    door_fix,
    passage_axes,
)
from navfw.localization.plan_scan import PlanScan, scan_of
from navfw.localization.scan_memory import ScanMemory
from navfw.robot import RobotModel
from navfw.signals import Odometry, Percept, Pose
from navfw.topomap import TopoMap

_SCAN_EVERY = 0.1
"""Distance driven [m] between two scans."""

MEMORY, POINTS = 2.0, 2000
"""Distance driven [m] whose scans show a corridor, and their number of points."""

_CORRIDOR_EVERY, _DOOR_EVERY = 1.0, 0.3
"""Distance driven [m] between two fixes: nearer ones would share most of their points."""

_ALONG = 0.6
"""Largest angle [rad] between heading and passage: the camera sees both of its sides."""

MARGIN = 0.2
"""Distance [m] beyond the passage at which the believed pose may be, as it may be wrong."""

_MIN_DOOR_DISTANCE, _MAX_DOOR_DISTANCE = 0.4, 2.0
"""Distances [m] ahead between which a door's posts are in view and seen well."""


class PassageObserver:
    """Collects scans of walls, and finds what they tell of the pose in the passages of a map."""

    def __init__(self, topo_map: TopoMap, robot: RobotModel) -> None:
        axes = passage_axes(topo_map)
        self._corridors = [axis for axis in axes if not axis.is_door]
        self._doors = [axis for axis in axes if axis.is_door]
        self._robot = robot
        self._scans = ScanMemory(MEMORY)
        self._last: Pose | None = None
        self._driven = 0.0
        self._scanned_at = self._corridor_at = self._door_at = -math.inf

    def observe(self, here: Pose, odometry: Odometry, percept: Percept | None) -> list[PassageFix]:
        """What the newest ``percept`` tells of the believed pose ``here`` (map)."""
        odom = odometry.pose
        if self._last is not None:
            self._driven += math.dist((self._last.x, self._last.y), (odom.x, odom.y))
        self._last = odom
        if percept is None or self._driven - self._scanned_at < _SCAN_EVERY:
            return []
        scan = scan_of(percept, self._robot)
        self._scanned_at = self._driven
        self._scans.add(self._driven, odom, scan)
        found = (self._corridor(here, odom), self._door(here, scan))
        return [fix for fix in found if fix is not None]

    def _corridor(self, here: Pose, odom: Pose) -> PassageFix | None:
        """By the corridor that the robot is in."""
        if self._driven - self._corridor_at < _CORRIDOR_EVERY:
            return None
        axis = next((axis for axis in self._corridors if _is_in(axis, here)), None)
        if axis is None:
            return None
        fix = corridor_fix(axis, here, self._scans.cloud(odom, POINTS))
        if fix is not None:
            self._corridor_at = self._driven
        return fix

    def _door(self, here: Pose, scan: PlanScan) -> PassageFix | None:
        """By the door ahead."""
        if self._driven - self._door_at < _DOOR_EVERY:
            return None
        axis = next((axis for axis in self._doors if _is_ahead(axis, here)), None)
        fix = None if axis is None else door_fix(axis, here, scan)
        if fix is not None:
            self._door_at = self._driven
        return fix


def _is_in(axis: PassageAxis, here: Pose) -> bool:
    at = axis.frame(here)
    inside = abs(at.y) <= 0.5 * axis.width + MARGIN
    return inside and -MARGIN <= at.x <= axis.length + MARGIN and axis.heading_off(here) <= _ALONG


def _is_ahead(axis: PassageAxis, here: Pose) -> bool:
    at = axis.frame(here)
    ahead = -at.x if abs(at.yaw) < 0.5 * math.pi else at.x
    in_front = _MIN_DOOR_DISTANCE <= ahead <= _MAX_DOOR_DISTANCE and abs(at.y) <= 0.5 * axis.width
    return in_front and axis.heading_off(here) <= _ALONG
