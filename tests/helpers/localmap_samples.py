"""Occupancy grids with boxes, and percepts by their numbers, for tests of the local map."""

import numpy as np

from navfw.localmap import OccupancyGrid
from navfw.numerics import Array
from navfw.robot import Footprint, RobotModel
from navfw.signals import Label, Percept, Pose

ROBOT = RobotModel()
CART = RobotModel(footprint=Footprint(front=0.5, rear=0.1, width=0.3), track=0.2)
ORIGIN = Pose(0, 0, 0)
WALL_AHEAD = (1.0, 1.2, -3.0, 3.0)
"""A wall across the way (x from, x to, y from, y to) [m]."""


def grid_with(
    *boxes: tuple[float, float, float, float], observed: bool = True, robot: RobotModel = ROBOT
) -> OccupancyGrid:
    """A grid around the origin with occupied ``boxes`` (x from, x to, y from, y to) [m].

    All other cells are observed free, or unobserved but for the footprint of the robot.
    """
    occupancy = OccupancyGrid(robot)
    occupancy.update(ORIGIN, 0.0)
    if observed:
        occupancy.log_odds[:] = -1.0
    for x0, x1, y0, y1 in boxes:
        r0, c0 = occupancy.index(x0, y0)
        r1, c1 = occupancy.index(x1, y1)
        occupancy.log_odds[r0 : r1 + 1, c0 : c1 + 1] = 3.0
    return occupancy


def metric_percept(
    time: float,
    points: Array,
    nearness: Array | float,
    sigma: Array | float,
    label: Label,
    height: float = 0.0,
) -> Percept:
    """A percept of ``points`` (rows, columns, 2), sure of them, without a fuzzy part."""
    every = np.ones(points.shape[:2])
    return Percept(
        time=time,
        points=points,
        nearness=nearness * every,
        sigma=sigma * every,
        confidence=every,
        height=height * every,
        label=np.full(every.shape, label, np.int8),
        obstacles={},
        quadrants={},
        planes={},
        slopes={},
        situations={},
        floor_in_front=0.0,
        sentence="",
    )
