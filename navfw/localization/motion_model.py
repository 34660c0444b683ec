"""How odometry moves a pose with a gyro bias, and how uncertain that makes it.

The state is (x [m], y [m], yaw [rad], b [rad/s]) in ``map``; b is the gyro's bias. Odometry has
already taken its own estimate of the bias out of the heading, so only the difference counts.

How uncertain a move is follows from what the robot's data sheets promise (``RobotModel.odometry``).
A slip of standard deviation s that keeps its value for a time T, different for both wheels, makes
``s sqrt(T v)`` [m] per root of a metre at speed v. A mean slip m grows with the way, not with its
root; it is covered up to the way ``BETWEEN`` by ``m sqrt(BETWEEN)``. Unequal wheels turn nobody
whose heading comes from the gyro. A gyro with noise g at the rate r makes ``g / sqrt(r)`` [rad]
per root of a second, and leaves ``g / sqrt(r REST)`` of its bias unknown after standing still.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from navfw.interfaces import Params
from navfw.robot import RobotModel
from navfw.signals import Array, Pose, wrap_angle

__all__ = [
    "MotionNoise",
    "MotionParams",
    "motion_noise",
    "predict",
    "process_noise",
    "transition",
]

NonNegative = Annotated[float, Field(ge=0.0)]

BETWEEN = 5.0
"""Landmarks are usually seen again within this way [m]."""

REST = 1.0
"""The shortest rest [s] in which odometry learns the gyro's bias, and the time between two words on
it while the robot rests."""

MEMORY = 10.0
"""Odometry's mean of the bias reaches back so far [s], and lags behind a bias that walks."""

INTEGRATION = 0.002
"""What encoder steps and midpoints leave of the way [m per root of m]."""


class MotionParams(Params):
    """Process noise, one standard deviation each; what is none follows from the data sheets."""

    along: Annotated[
        NonNegative | None,
        Field(description="of the distance driven [m per root of m; default: by robot.odometry]"),
    ] = None
    aside: Annotated[NonNegative, Field(description="of sideways slip [m per root of m]")] = 0.01
    yaw_by_time: Annotated[
        NonNegative | None,
        Field(description="of yaw by the gyro's noise [rad per root of s; by robot.odometry]"),
    ] = None
    yaw_by_turning: Annotated[
        NonNegative, Field(description="of yaw by turning [rad per root of rad]")
    ] = 0.005
    bias: Annotated[
        NonNegative | None,
        Field(description="of the gyro's bias once learnt at rest [rad/s; by robot.odometry]"),
    ] = None
    bias_walk: Annotated[
        NonNegative | None,
        Field(description="of the bias' walk [rad/s per root of s; by robot.odometry]"),
    ] = None
    margin: Annotated[
        float, Field(ge=1.0, le=10.0, description="factor on what the data sheets promise")
    ] = 1.5


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Standard deviations of a move, all of them known; units as in ``MotionParams``."""

    along: float
    aside: float
    yaw_by_time: float
    yaw_by_turning: float
    bias: float
    bias_walk: float


def motion_noise(params: MotionParams, robot: RobotModel) -> MotionNoise:
    """What ``params`` say, and for the rest what the data sheets of ``robot`` promise."""
    sheet = robot.odometry
    slipping = sheet.slip**2 * sheet.slip_time * robot.max_v + sheet.slip_mean**2 * BETWEEN
    noise = sheet.gyro_noise**2 / robot.control_rate
    lag = sheet.gyro_bias_walk**2 * MEMORY / 3.0

    def known(value: float | None, variance: float) -> float:
        return params.margin * math.sqrt(variance) if value is None else value

    return MotionNoise(
        known(params.along, slipping + INTEGRATION**2),
        params.aside,
        known(params.yaw_by_time, noise),
        params.yaw_by_turning,
        known(params.bias, noise / REST + lag),
        known(params.bias_walk, sheet.gyro_bias_walk**2),
    )


def predict(state: Array, moved: Pose, drift: float) -> Array:
    """The state (4,) after odometry has moved by ``moved`` (seen from before) and ``drift`` more.

    ``drift`` [rad] is what the odometry's yaw is short of, by the difference of the two estimates
    of the bias.
    """
    heading = state[2] + 0.5 * drift
    c, s = math.cos(heading), math.sin(heading)
    return np.array(
        (
            state[0] + c * moved.x - s * moved.y,
            state[1] + s * moved.x + c * moved.y,
            wrap_angle(state[2] + moved.yaw + drift),
            state[3],
        )
    )


def transition(state: Array, moved: Pose, drift: float, dt: float) -> Array:
    """(4, 4) the Jacobian of ``predict`` where ``drift = (bias known to odometry - b) dt``."""
    heading = state[2] + 0.5 * drift
    c, s = math.cos(heading), math.sin(heading)
    dx, dy = c * moved.x - s * moved.y, s * moved.x + c * moved.y
    jacobian = np.eye(4)
    jacobian[0, 2], jacobian[1, 2] = -dy, dx
    jacobian[0, 3], jacobian[1, 3] = 0.5 * dt * dy, -0.5 * dt * dx
    jacobian[2, 3] = -dt
    return jacobian


def process_noise(yaw: float, moved: Pose, dt: float, sigma: MotionNoise, guess: bool) -> Array:
    """(4, 4) what ``moved`` in ``dt`` [s] adds to the covariance, at ``yaw`` [rad].

    ``guess``: the encoders were silent, and the way is what the wheels were told.
    """
    distance = math.hypot(moved.x, moved.y)
    along, aside = sigma.along**2 * distance, sigma.aside**2 * distance
    if guess:
        along += distance**2
    c, s = math.cos(yaw), math.sin(yaw)
    cross = c * s * (along - aside)
    noise = np.zeros((4, 4))
    noise[0, 0], noise[1, 1] = c * c * along + s * s * aside, s * s * along + c * c * aside
    noise[0, 1] = noise[1, 0] = cross
    noise[2, 2] = sigma.yaw_by_time**2 * dt + sigma.yaw_by_turning**2 * abs(moved.yaw)
    noise[3, 3] = sigma.bias_walk**2 * dt
    return noise
