"""Readings, odometry and local maps for tests of safety."""

import numpy as np

from navfw.localmap import LocalMap
from navfw.localmap.free_distances import FreeDistance
from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.safety import SafetyMonitor, SafetyParams
from navfw.signals import Encoders, Frame, Inertial, Odometry, Pose, SensorReading, Twist

ROBOT = RobotModel()
ORIGIN = Pose(0.0, 0.0, 0.0)
RNG = np.random.default_rng(1)


def picture(mean: float = 120.0, spread: float = 30.0) -> Image:
    """A valid image: noise of this mean and standard deviation [grey levels]."""
    noise = RNG.normal(mean, spread, (120, 160))
    return np.clip(noise, 0, 255).astype(np.uint8)


def reading(
    time: float,
    image: Image | None = None,
    *,
    frame_age: float = 0.0,
    gyro_age: float = 0.0,
    encoder_age: float = 0.0,
) -> SensorReading:
    """A reading at ``time`` [s], with time stamps that are so old [s]."""
    return SensorReading(
        time,
        Inertial(time - gyro_age, 0.0, 0.0, 0.0),
        Encoders(time - encoder_age, 0, 0),
        None if image is None else Frame(time - frame_age, image),
    )


def odometry(
    time: float, x: float = 0.0, yaw: float = 0.0, v: float = 0.0, *, silent: bool = False
) -> Odometry:
    """Odometry at (x, 0, yaw) with speed ``v`` [m/s]."""
    return Odometry(time, Pose(x, 0.0, yaw), Twist(v, 0.0), 0.0, still=False, silent=silent)


class FixedDistances(LocalMap):
    """A local map with the same free distances [m] for every pose and twist."""

    def __init__(self, contact: float, unobserved: float) -> None:
        super().__init__(ROBOT)
        self.distances = FreeDistance(contact, unobserved)

    def free_distance(self, pose: Pose, twist: Twist) -> FreeDistance:
        return self.distances


def monitor_with(contact: float = 10.0, unobserved: float = 10.0, **params: float) -> SafetyMonitor:
    """A monitor with these free distances [m] and parameters."""
    return SafetyMonitor(ROBOT, FixedDistances(contact, unobserved), SafetyParams(**params))


def started(**params: float) -> SafetyMonitor:
    """A monitor with these parameters after a valid reading at time 0."""
    monitor = monitor_with(**params)
    monitor.update(reading(0.0, picture()), odometry(0.0))
    return monitor
