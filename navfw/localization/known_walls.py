"""Walls of the map's floor plan around the robot, where it knows well enough where it is.

A camera does not see what is beside the robot. A round body may turn there; the corners of another
one swing out to walls that it has never seen: of the corridor that it enters through a door.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import binary_erosion

from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Belief, Pose
from navfw.topomap.occupancy_map import OccupancyMap

REACH = 2.0
"""Distance [m] from the robot up to which walls count."""
SURE_XY, SURE_YAW = 0.1, 0.1
"""Largest standard deviations [m, rad] of the pose with which they count."""


class KnownWalls:
    """The surfaces of the walls of ``plan``."""

    def __init__(self, plan: OccupancyMap) -> None:
        occupied = plan.occupied
        surface = occupied & ~binary_erosion(occupied)
        self._points = plan.centres(*np.nonzero(surface))

    @classmethod
    def of(cls, plan: OccupancyMap | None, robot: RobotModel) -> KnownWalls | None:
        """The walls of ``plan``; None without one, and for a round body: it may turn anywhere."""
        return None if plan is None or robot.footprint is None else cls(plan)

    def around(self, belief: Belief, pose: Pose) -> Array:
        """Points (n, 2) [m] in ``odom`` of the walls near odom ``pose``; none while unsure."""
        at = belief.pose
        unsure = belief.sigma > SURE_XY or math.sqrt(belief.covariance[2, 2]) > SURE_YAW
        if belief.lost or unsure:
            return np.empty((0, 2))
        off = np.abs(self._points - (at.x, at.y)).max(axis=1, initial=0.0)
        return pose.points_to_parent(at.points_to_local(self._points[off <= REACH]))
