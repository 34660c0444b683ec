"""The metric filter: an EKF over pose and gyro bias that does not believe every landmark."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from navfw.localization.landmark_existence import LandmarkExistence
from navfw.localization.landmark_model import GATE, Association, associate
from navfw.localization.landmark_observations import Look, agreeing
from navfw.localization.motion_model import (
    REST,
    MotionParams,
    motion_noise,
    predict,
    process_noise,
    transition,
)
from navfw.robot import RobotModel
from navfw.signals import Array, Odometry, Pose, wrap_angle

__all__ = ["FilterParams", "MetricFilter"]

NonNegative = Annotated[float, Field(ge=0.0)]

WIDENING = 4.0
"""Factor on the covariance, at each look, when landmarks agree that the pose is wrong."""

SURPRISE = 4.0
"""Squared Mahalanobis distance from which one landmark alone is not believed: it may have been
moved. Two that agree with each other are: then it is the pose that is wrong."""

HELD = 10.0
"""A surprise is remembered until the robot has driven so much farther [m]."""


class FilterParams(MotionParams):
    """Noise of odometry and map, and how much landmarks are trusted."""

    start_xy: Annotated[NonNegative, Field(description="of the start x and y [m]")] = 0.03
    start_yaw: Annotated[NonNegative, Field(description="of the start yaw [rad]")] = 0.02
    placed: Annotated[
        NonNegative, Field(description="how exactly the map has its landmarks, one sigma [m]")
    ] = 0.03
    prior: Annotated[
        float, Field(gt=0.0, lt=1.0, description="share of landmarks that stand where mapped")
    ] = 0.85
    least_xy: Annotated[
        NonNegative, Field(description="no landmark makes the position surer than this [m]")
    ] = 0.02
    least_yaw: Annotated[
        NonNegative, Field(description="no landmark makes the yaw surer than this [rad]")
    ] = 0.006


class MetricFilter:
    """Keeps (x, y, yaw, bias) with covariance (4, 4); ``trust`` is shared with others."""

    def __init__(self, params: FilterParams, trust: LandmarkExistence, robot: RobotModel) -> None:
        self.params = params
        self.noise = motion_noise(params, robot)
        self.trust = trust
        self.updates = 0

    def begin(self, pose: Pose, covariance: Array, odometry: Odometry) -> None:
        """Start at ``pose`` (map) with ``covariance`` (3, 3); the bias is what odometry has."""
        self.state = np.array((pose.x, pose.y, pose.yaw, odometry.yaw_bias))
        self.covariance = np.zeros((4, 4))
        self.covariance[:3, :3] = covariance
        self.covariance[3, 3] = self.noise.bias**2
        self._last = odometry
        self._bias_heard = odometry.time
        self._held: dict[str, tuple[Look, float]] = {}
        self._driven = 0.0

    @property
    def pose(self) -> Pose:
        """The pose in ``map``."""
        return Pose(*self.state[:3].tolist())

    @property
    def pose_covariance(self) -> Array:
        """(3, 3) of (x, y, yaw)."""
        return self.covariance[:3, :3].copy()

    def advance(self, odometry: Odometry) -> None:
        """Move as odometry has since the last time."""
        last, self._last = self._last, odometry
        dt = odometry.time - last.time
        if dt <= 0.0:
            return
        self._hear_bias(odometry, last)
        self._driven += math.hypot(odometry.pose.x - last.pose.x, odometry.pose.y - last.pose.y)
        moved = last.pose.relative(odometry.pose)
        # odometry holds the heading of a robot that stands still
        turning_dt = 0.0 if odometry.still else dt
        drift = (odometry.yaw_bias - float(self.state[3])) * turning_dt
        jacobian = transition(self.state, moved, drift, turning_dt)
        noise = process_noise(float(self.state[2]), moved, turning_dt, self.noise, odometry.silent)
        noise[3, 3] = self.noise.bias_walk**2 * dt
        self.state = predict(self.state, moved, drift)
        self.covariance = jacobian @ self.covariance @ jacobian.T + noise

    def see(self, looks: Sequence[Look]) -> None:
        """Correct the pose by landmarks, as far as they are trusted and fit."""
        for look in looks:
            self._see(look)

    def _see(self, look: Look) -> None:
        found = self._associate(look)
        if found.distance > SURPRISE and self._agreed(look):
            self.covariance[:3, :] *= math.sqrt(WIDENING)
            self.covariance[:, :3] *= math.sqrt(WIDENING)
            self.trust.pardon(self._held.__contains__)
            found = self._associate(look)
        elif found.distance > SURPRISE:
            if found.distance > GATE:
                self.trust.hear(look.landmark.identity, 0.0, look.weight)
            return
        if found.share > 0.5:
            self.updates += 1
            self._held.clear()
            self.trust.hear(look.landmark.identity, max(found.likelihood, 1.0), look.weight)
        self.state, self.covariance = found.state, found.covariance
        self._keep_doubt()

    def _associate(self, look: Look) -> Association:
        mark, noise = look.landmark, look.noise / look.weight
        trust = self.trust.of(mark.identity)
        return associate(self.state, self.covariance, look.seen, noise, (mark.x, mark.y), trust)

    def _agreed(self, look: Look) -> bool:
        """Whether this surprise and the last ones, at other landmarks, tell of the same mistake."""
        self._held = {k: v for k, v in self._held.items() if self._driven - v[1] <= HELD}
        self._held[look.landmark.identity] = look, self._driven
        return len(agreeing(list(self._held.values()))) >= 2

    def _keep_doubt(self) -> None:
        """Errors that all detections share (of the map, of the camera) do not average out."""
        p = self.params
        for axis, least in enumerate((p.least_xy, p.least_xy, p.least_yaw)):
            short = least**2 - self.covariance[axis, axis]
            if short > 0.0:
                self.covariance[axis, axis] += short

    def _hear_bias(self, odometry: Odometry, last: Odometry) -> None:
        """Odometry learns the bias at rest, and corrects it when the flow contradicts the gyro."""
        change = odometry.yaw_bias - last.yaw_bias
        rested = odometry.still and odometry.time - self._bias_heard >= REST
        if not rested and (odometry.still or change == 0.0):
            return
        self._bias_heard = odometry.time
        noise = self.noise.bias**2
        if not odometry.still:
            self.covariance[3, 3] += change**2
            noise += change**2
        spread = float(self.covariance[3, 3]) + noise
        if spread <= 0.0:
            return  # a gyro without errors: nothing is left to learn
        gain = self.covariance[:, 3] / spread
        self.state = self.state + gain * (odometry.yaw_bias - self.state[3])
        self.state[2] = wrap_angle(float(self.state[2]))
        row = self.covariance[3:4, :]
        updated = self.covariance - np.outer(gain, row)
        self.covariance = 0.5 * (updated + updated.T)
