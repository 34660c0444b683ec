"""Motion model: prediction of pose and gyro bias from odometry, with its process noise.

The state is (x [m], y [m], yaw [rad], b [rad/s]) in ``map``; b is the gyro's bias. Odometry has
already subtracted its own bias estimate from the heading, so only the difference counts.

The process noise follows from the sensors' data sheets (``RobotModel.odometry``). A wheel slip of
standard deviation s with correlation time T, independent for both wheels, gives ``s sqrt(T v)`` [m]
per root of a metre at speed v. A mean slip m grows with the distance, not with its root; it is
covered up to the distance ``_BETWEEN`` by ``m sqrt(_BETWEEN)``. Unequal wheels do not affect the
heading, which comes from the gyro. A gyro with noise g at the rate r gives ``g / sqrt(r)`` [rad]
per root of a second, and a bias uncertainty of ``g / sqrt(r REST)`` after a rest.

The localiser ``dead_reckoning`` is nothing else: odometry from a known start, without landmarks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw.interfaces import Params
from navfw.localization import place_probabilities
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose, wrap_angle
from navfw.topomap import TopoMap

NonNegative = Annotated[float, Field(ge=0.0, le=10.0)]
"""Sigmas in metres and radians, and of their growth: 10 says that nothing is known."""

_BETWEEN = 5.0  # chosen
"""Usual distance driven between two landmark observations [m]."""

REST = 1.0  # chosen
"""Shortest rest in which odometry estimates the gyro's bias, and the interval between two uses of
that estimate while the robot rests [s]."""

MEMORY = 10.0  # chosen
"""Averaging time of odometry's bias estimate [s]: it lags behind a bias that drifts."""

_TURN_MEMORY = 0.5  # chosen
"""Turn [rad] over which the point keeps its place about which skidding wheels turn the robot."""

BY_FLOOR = 0.01  # measured
"""Error of the distance that the floor's motion in the images measures [m per root of m]: measured
0.002 to 0.004."""

_INTEGRATION = 0.002  # chosen
"""Error of encoder quantisation and midpoint integration [m per root of m]."""


class MotionParams(Params):
    """Process noise, one standard deviation each; None: derived from the data sheets."""

    along: NonNegative | None = Field(
        None, description="of the distance driven [m per root of m; default: by robot.odometry]"
    )
    aside: NonNegative = Field(0.01, description="of sideways slip [m per root of m]")
    yaw_by_turning: NonNegative = Field(
        0.005, description="of yaw by turning [rad per root of rad]"
    )
    bias: NonNegative | None = Field(
        None, description="of the gyro's bias after a rest [rad/s; by robot.odometry]"
    )
    margin: float = Field(1.5, ge=1.0, le=10.0, description="factor on the data sheets' values")


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Process noise with all values derived; meaning and units as in ``MotionParams``.

    Besides: ``yaw_by_time`` [rad per root of s] by the gyro's noise, ``bias_walk`` [rad/s per root
    of s] by its bias' random walk, and ``aside_by_turning`` [m per root of rad] by skidding.
    """

    along: float
    aside: float
    aside_by_turning: float
    yaw_by_time: float
    yaw_by_turning: float
    bias: float
    bias_walk: float


def motion_noise(params: MotionParams, robot: RobotModel) -> MotionNoise:
    """Derive the process noise from ``params``, where those are None from ``robot.odometry``."""
    sheet = robot.odometry
    slipping = sheet.slip**2 * sheet.slip_time * robot.max_v + sheet.slip_mean**2 * _BETWEEN
    noise = sheet.gyro_noise**2 / robot.control_rate
    lag = sheet.gyro_bias_walk**2 * MEMORY / 3.0

    def or_derived(value: float | None, variance: float) -> float:
        return params.margin * math.sqrt(variance) if value is None else value

    return MotionNoise(
        or_derived(params.along, slipping + _INTEGRATION**2),
        params.aside,
        params.margin * robot.skid * math.sqrt(_TURN_MEMORY),
        params.margin * math.sqrt(noise),
        params.yaw_by_turning,
        or_derived(params.bias, noise / REST + lag),
        params.margin * sheet.gyro_bias_walk,
    )


def predict(state: Array, moved: Pose, drift: float, dt: float) -> tuple[Array, Array]:
    """Predict the state (4,) after the odometry increment ``moved`` (in the old pose's frame).

    ``drift`` [rad] is added to the yaw: (the odometry's bias - that of the state) times ``dt`` [s].
    The second result is the Jacobian (4, 4) of the first.
    """
    heading = state[2] + 0.5 * drift
    c, s = math.cos(heading), math.sin(heading)
    x, y = state[0] + c * moved.x - s * moved.y, state[1] + s * moved.x + c * moved.y
    dx, dy = c * moved.x - s * moved.y, s * moved.x + c * moved.y
    jacobian = np.eye(4)
    jacobian[0, 2], jacobian[1, 2] = -dy, dx
    jacobian[0, 3], jacobian[1, 3] = 0.5 * dt * dy, -0.5 * dt * dx
    jacobian[2, 3] = -dt
    return np.array((x, y, wrap_angle(state[2] + moved.yaw + drift), state[3])), jacobian


def _slip(yaw: float, along: float, aside: float) -> Array:
    """Return the covariance (2, 2) of x, y with variances ``along`` and ``aside`` of ``yaw``."""
    c, s = math.cos(yaw), math.sin(yaw)
    cross = c * s * (along - aside)
    return np.array(
        [[c * c * along + s * s * aside, cross], [cross, s * s * along + c * c * aside]]
    )


def process_noise(
    yaw: float, moved: Pose, dt: float, sigma: MotionNoise, odometry: Odometry
) -> Array:
    """Compute the covariance (4, 4) of x, y, yaw and gyro bias that ``moved`` adds, at ``yaw``.

    ``moved`` is by ``odometry`` in ``dt`` [s]. While the encoders are silent it follows commanded
    wheel speeds, and its error along the path is as large as the path, unless the floor measures
    it.
    """
    distance = math.hypot(moved.x, moved.y)
    along = sigma.along**2 * distance
    aside = sigma.aside**2 * distance + sigma.aside_by_turning**2 * abs(moved.yaw)
    if odometry.by_floor:
        along = min(along, BY_FLOOR**2 * distance)
    elif odometry.silent:
        along += distance**2
    noise = np.zeros((4, 4))
    noise[:2, :2] = _slip(yaw, along, aside)
    noise[2, 2] = sigma.yaw_by_time**2 * dt + sigma.yaw_by_turning**2 * abs(moved.yaw)
    noise[3, 3] = sigma.bias_walk**2 * dt
    return noise


class DeadReckoning(place_probabilities.PlaceLocalizer):
    """Adds the odometry to a known start pose; nothing corrects the pose.

    The covariance of (x, y, yaw) is propagated as in an EKF without measurements: it grows with
    the distance driven, the angle turned and, through the yaw, with the distance from where a
    heading error arose. Place probabilities follow from the distance to the pose.
    """

    name: ClassVar[str] = "dead_reckoning"

    class Params(place_probabilities.PlaceLocalizer.Params):
        """Standard deviations; those per root of a unit accumulate as a random walk."""

        start_xy: NonNegative = Field(0.02, description="of the start x and y [m]")
        start_yaw: NonNegative = Field(0.01, description="of the start yaw [rad]")
        along: NonNegative = Field(0.03, description="of the distance driven [m per root of m]")
        aside: NonNegative = Field(0.01, description="of sideways slip [m per root of m]")
        yaw_by_distance: NonNegative = Field(
            0.005, description="of yaw by driving [rad per root of m]"
        )
        yaw_by_turning: NonNegative = Field(
            0.01, description="of yaw by turning [rad per root of rad]"
        )
        places: int = Field(
            place_probabilities.COUNT,
            ge=1,
            le=1000,
            description="number of places that the belief lists",
        )
        refresh: NonNegative = Field(
            place_probabilities.REFRESH,
            description="distance moved until place probabilities are computed again [m]",
        )

    params: Params

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map).

        Raises:
            InputError: ``pose`` is None: without landmarks an unknown start cannot be found.

        """
        pose = place_probabilities.known_start(
            pose, self.name, "a localizer that recognises landmarks"
        )
        p = self.params
        self._posterior = place_probabilities.PlacePosterior(topo_map, p.places, p.refresh)
        self._map_from_odom = pose.frame_of(odometry.pose)
        self._last = odometry.pose
        self._covariance = np.diag([p.start_xy**2, p.start_xy**2, p.start_yaw**2])

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """Return the belief after the newest odometry; percept and detections are not used."""
        posterior = self.posterior
        moved = self._last.relative(odometry.pose)
        pose = self._map_from_odom.compose(odometry.pose)
        self._covariance = self._propagated(moved, pose.yaw)
        self._last = odometry.pose
        places = posterior.at(pose, self._covariance)
        confidence = place_probabilities.probability_within(self._covariance)
        return Belief(odometry.time, pose, self._covariance, places, confidence)

    def _propagated(self, moved: Pose, yaw: float) -> Array:
        """Propagate the covariance over ``moved`` (in the old pose's frame), now at ``yaw``."""
        p = self.params
        distance, turned = math.hypot(moved.x, moved.y), abs(moved.yaw)
        before = wrap_angle(yaw - moved.yaw)
        jacobian = predict(np.array((0.0, 0.0, before, 0.0)), moved, 0.0, 0.0)[1][:3, :3]
        noise = np.zeros((3, 3))
        noise[:2, :2] = _slip(before, p.along**2 * distance, p.aside**2 * distance)
        noise[2, 2] = p.yaw_by_distance**2 * distance + p.yaw_by_turning**2 * turned
        propagated: Array = product(jacobian, self._covariance, jacobian.T) + noise
        return propagated
