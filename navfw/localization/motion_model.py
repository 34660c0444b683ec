"""How odometry moves a pose with a gyro bias, and how uncertain that makes it.

The state is (x [m], y [m], yaw [rad], b [rad/s]) in ``map``; b is the gyro's bias. Odometry has
already taken its own estimate of the bias out of the heading, so only the difference counts.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from navfw.kinds import Params
from navfw.signals import Array, Pose, wrap_angle

__all__ = ["MotionParams", "predict", "process_noise", "transition"]

NonNegative = Annotated[float, Field(ge=0.0)]


class MotionParams(Params):
    """Process noise, one standard deviation each; the defaults cover the preset ``default``.

    A slip of 2 % that keeps its value over some 0.2 m makes 0.01 m per root of a metre; a mean slip
    of 0.5 % adds as much again between two landmarks. Unequal wheels turn nobody whose heading
    comes from the gyro.
    """

    along: Annotated[NonNegative, Field(description="of the distance driven [m per root of m]")] = (
        0.02
    )
    aside: Annotated[NonNegative, Field(description="of sideways slip [m per root of m]")] = 0.01
    yaw_by_time: Annotated[
        NonNegative, Field(description="of yaw by the gyro's noise [rad per root of s]")
    ] = 0.0007
    yaw_by_turning: Annotated[
        NonNegative, Field(description="of yaw by turning [rad per root of rad]")
    ] = 0.005
    bias: Annotated[
        NonNegative, Field(description="of the gyro's bias once learnt at rest [rad/s]")
    ] = 0.0004
    bias_walk: Annotated[
        NonNegative, Field(description="of the bias' walk [rad/s per root of s]")
    ] = 0.0002


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


def process_noise(yaw: float, moved: Pose, dt: float, params: MotionParams, guess: bool) -> Array:
    """(4, 4) what ``moved`` in ``dt`` [s] adds to the covariance, at ``yaw`` [rad].

    ``guess``: the encoders were silent, and the way is what the wheels were told.
    """
    distance = math.hypot(moved.x, moved.y)
    along, aside = params.along**2 * distance, params.aside**2 * distance
    if guess:
        along += distance**2
    c, s = math.cos(yaw), math.sin(yaw)
    cross = c * s * (along - aside)
    noise = np.zeros((4, 4))
    noise[0, 0], noise[1, 1] = c * c * along + s * s * aside, s * s * along + c * c * aside
    noise[0, 1] = noise[1, 0] = cross
    noise[2, 2] = params.yaw_by_time**2 * dt + params.yaw_by_turning**2 * abs(moved.yaw)
    noise[3, 3] = params.bias_walk**2 * dt
    return noise
