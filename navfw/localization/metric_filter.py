"""The metric filter, an EKF over pose and gyro bias, robust to displaced landmarks (METHOD 4.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydantic import Field

from navfw.localization.landmark_model import (
    GATE,
    Association,
    LandmarkExistence,
    LandmarkObservation,
    associate,
    consistent_observations,
)
from navfw.localization.motion_model import (
    REST,
    MotionParams,
    NonNegative,
    motion_noise,
    predict,
    process_noise,
)
from navfw.localization.passage_walls import PassageFix
from navfw.numerics import Array
from navfw.numerics.linear_systems import solve
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Odometry, Pose, wrap_angle

INFLATION = 4.0  # chosen
"""Factor on the pose covariance, at each observation, while consistent landmarks contradict the
pose: the filter then follows the landmarks."""

SURPRISE = 4.0  # chosen
"""Squared Mahalanobis distance from which a single landmark is not used: it may be displaced. When
two or more consistent landmarks exceed it, the pose is wrong instead."""

_SURPRISE_DISTANCE = 10.0  # chosen
"""Distance driven [m] for which a surprising observation is kept for comparison with others."""


class MetricFilterParams(MotionParams):
    """Noise of odometry and of the map, and the landmarks' prior existence probability."""

    start_xy: NonNegative = Field(0.03, description="of the start x and y [m]")
    start_yaw: NonNegative = Field(0.02, description="of the start yaw [rad]")
    prior: float = Field(
        0.85, gt=0.0, lt=1.0, description="prior probability that a landmark is where mapped"
    )
    least_xy: NonNegative = Field(
        0.02, description="least sigma of x and y after an observation [m]"
    )
    least_yaw: NonNegative = Field(
        0.006, description="least sigma of the yaw after an observation [rad]"
    )


class MetricFilter:
    """EKF that tracks a known pose: state (x [m], y [m], yaw [rad], gyro bias [rad/s]) in ``map``.

    ``state`` is (4,), ``covariance`` (4, 4). ``existence`` holds the landmarks' existence
    probabilities; it may be shared with another filter.
    """

    def __init__(
        self, params: MetricFilterParams, existence: LandmarkExistence, robot: RobotModel
    ) -> None:
        self.params = params
        self.noise = motion_noise(params, robot)
        self.existence = existence
        self.updates = 0

    def initialize(self, pose: Pose, covariance: Array, odometry: Odometry) -> None:
        """Start at ``pose`` (map) with ``covariance`` (3, 3); the bias is odometry's estimate."""
        self.state = np.array((pose.x, pose.y, pose.yaw, odometry.yaw_bias))
        self.covariance = np.zeros((4, 4))
        self.covariance[:3, :3] = covariance
        self.covariance[3, 3] = self.noise.bias**2
        self._last = odometry
        self._bias_observed_at = odometry.time
        self._surprises: dict[str, tuple[LandmarkObservation, float]] = {}
        self._driven = 0.0

    @property
    def pose(self) -> Pose:
        """Estimated pose in ``map``."""
        return Pose(*self.state[:3].tolist())

    @property
    def pose_covariance(self) -> Array:
        """Covariance (3, 3) of (x, y, yaw) in ``map``."""
        return self.covariance[:3, :3].copy()

    def predict(self, odometry: Odometry) -> None:
        """Move state and covariance by the odometry since the last call."""
        last, self._last = self._last, odometry
        dt = odometry.time - last.time
        if dt <= 0.0:
            return
        self._observe_bias(odometry, last)
        self._driven += math.hypot(odometry.pose.x - last.pose.x, odometry.pose.y - last.pose.y)
        moved = last.pose.relative(odometry.pose)
        # odometry holds the heading of a robot at rest
        turning_dt = 0.0 if odometry.still else dt
        drift = (odometry.yaw_bias - float(self.state[3])) * turning_dt
        noise = process_noise(float(self.state[2]), moved, turning_dt, self.noise, odometry)
        noise[3, 3] = self.noise.bias_walk**2 * dt
        self.state, jacobian = predict(self.state, moved, drift, turning_dt)
        self.covariance = product(jacobian, self.covariance, jacobian.T) + noise

    def observe(self, observations: Sequence[LandmarkObservation]) -> None:
        """Correct the state by landmark observations, weighted by existence probability and fit."""
        for observation in observations:
            self._observe(observation)

    def observe_passage(self, fix: PassageFix) -> None:
        """Correct the state by the walls of a passage, unless they contradict it."""
        rows, off, variances = fix.rows()
        shared = product(self.covariance[:, :3], rows.T)
        spread = product(rows, shared[:3]) + np.diag(variances)
        if float(product(off, solve(spread, off))) > GATE:
            return
        gain = solve(spread, shared.T).T
        self._correct(product(gain, off), product(gain, shared.T))
        self._limit_certainty()
        self.updates += 1

    def adopt(self, pose: Pose, information: Array) -> None:
        """Correct the state by a pose that was fitted with this filter's pose as the prior.

        ``pose`` (map) is the most probable one, given the filter and the observation;
        ``information`` (3, 3) is that of the observation by itself, and may be singular.
        """
        prior, columns = self.covariance[:3, :3], self.covariance[:, :3]
        off = np.array((pose.x, pose.y, pose.yaw)) - self.state[:3]
        off[2] = wrap_angle(float(off[2]))
        share = solve(np.eye(3) + product(information, prior), information)
        reduction = product(columns, share, self.covariance[:3, :])
        self._correct(product(columns, solve(prior, off)), reduction)
        self._limit_certainty()
        self.updates += 1

    def inflate(self, factor: float) -> None:
        """Multiply the covariance of the pose by ``factor``: the pose may be wrong."""
        self.covariance[:3, :] *= math.sqrt(factor)
        self.covariance[:, :3] *= math.sqrt(factor)

    def diffuse(self, xy: float, yaw: float) -> None:
        """Add the variances of sigmas ``xy`` [m] and ``yaw`` [rad] to those of the pose."""
        self.covariance[:3, :3] += np.diag([xy**2, xy**2, yaw**2])

    def _correct(self, step: Array, reduction: Array) -> None:
        """Add ``step`` (4,) to the state, subtract ``reduction`` (4, 4) from the covariance."""
        self.state = self.state + step
        self.state[2] = wrap_angle(float(self.state[2]))
        updated = self.covariance - reduction
        self.covariance = 0.5 * (updated + updated.T)

    def _observe(self, observation: LandmarkObservation) -> None:
        identity, weight = observation.landmark.identity, observation.weight
        update = self._associate(observation)
        if update.distance > SURPRISE and self._is_corroborated(observation):
            self.inflate(INFLATION)
            self.existence.reset(self._surprises.__contains__)
            update = self._associate(observation)
        elif update.distance > SURPRISE:
            if update.distance > GATE:
                self.existence.update(identity, 0.0, weight)
            return
        if update.probability > 0.5:
            self.updates += 1
            self._surprises.clear()
            self.existence.update(identity, max(update.likelihood_ratio, 1.0), weight)
        self.state, self.covariance = update.state, update.covariance
        self._limit_certainty()

    def _associate(self, observation: LandmarkObservation) -> Association:
        mark, noise = observation.landmark, observation.noise / observation.weight
        existence, at = self.existence.probability(mark.identity), (mark.x, mark.y)
        return associate(self.state, self.covariance, observation.measured, noise, at, existence)

    def _is_corroborated(self, observation: LandmarkObservation) -> bool:
        """Return whether recent surprises at other landmarks are consistent with this one."""
        self._surprises = {
            identity: kept
            for identity, kept in self._surprises.items()
            if self._driven - kept[1] <= _SURPRISE_DISTANCE
        }
        self._surprises[observation.landmark.identity] = observation, self._driven
        return len(consistent_observations(list(self._surprises.values()))) >= 2

    def _limit_certainty(self) -> None:
        """Keep the variances above a floor: errors common to all detections do not average out."""
        p = self.params
        for axis, least in enumerate((p.least_xy, p.least_xy, p.least_yaw)):
            short = least**2 - self.covariance[axis, axis]
            if short > 0.0:
                self.covariance[axis, axis] += short

    def _observe_bias(self, odometry: Odometry, last: Odometry) -> None:
        """Correct the state by odometry's bias estimate, as a measurement of the bias.

        Odometry estimates the bias at rest, and changes it in motion when the optical flow
        contradicts the gyro.
        """
        change = odometry.yaw_bias - last.yaw_bias
        rested = odometry.still and odometry.time - self._bias_observed_at >= REST
        if not rested and (odometry.still or change == 0.0):
            return
        self._bias_observed_at = odometry.time
        noise = self.noise.bias**2
        if not odometry.still:
            self.covariance[3, 3] += change**2
            noise += change**2
        spread = float(self.covariance[3, 3]) + noise
        if spread <= 0.0:
            return  # a gyro without bias errors
        gain = self.covariance[:, 3] / spread
        step = gain * (odometry.yaw_bias - self.state[3])
        self._correct(step, np.outer(gain, self.covariance[3:4, :]))
