"""Detections of moving objects by their numbers, without images."""

import math

import numpy as np

from navfw.movers import Tracker
from navfw.robot import RobotModel
from navfw.signals import MovingObject, Pose

ROBOT = RobotModel()
AHEAD = ROBOT.camera.mount_forward
START = Pose(0.0, 0.0, 0.0)


def detection(
    time: float,
    bearing: float,
    distance: float,
    *,
    width: float = 0.13,
    velocity: tuple[float, float] = (0.0, 0.0),
    certainty: float = 0.0,
) -> MovingObject:
    """A detection with ``velocity`` [m/s] in base_link; ``certainty`` is its information."""
    information = certainty * np.eye(2)
    return MovingObject(
        time, bearing, width, distance, information, information @ np.array(velocity)
    )


def cross(tracker: Tracker, velocity: float, seconds: float, certainty: float = 0.0) -> float:
    """Track an object that crosses to the left, 1.5 m ahead; the time [s] of the last detection."""
    time = 0.0
    for k in range(round(10 * seconds)):
        time = 0.1 * k
        y = -0.6 + velocity * time
        bearing, away = math.atan2(y, 1.5), math.hypot(1.5, y)
        crossing = detection(time, bearing, away, velocity=(0.0, velocity), certainty=certainty)
        tracker.update([crossing], START)
    return time
