"""The localiser ``dead_reckoning``: odometry from a known start, without landmarks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw.localization import place_probabilities
from navfw.localization.motion_model import NonNegative
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose, wrap_angle
from navfw.topomap import TopoMap


class DeadReckoning(place_probabilities.PlaceLocalizer):
    """Map pose = start pose composed with the odometry since the start.

    The covariance of (x, y, yaw) is propagated as in an EKF without measurements: it grows with
    the distance driven, the angle turned and, through the yaw, with the distance from where a
    heading error arose. Place probabilities follow from the distance to the pose.
    """

    name: ClassVar[str] = "dead_reckoning"

    class Params(place_probabilities.PlaceLocalizer.Params):
        """Standard deviations; those per root of a unit accumulate as a random walk."""

        start_xy: Annotated[NonNegative, Field(description="of the start x and y [m]")] = 0.02
        start_yaw: Annotated[NonNegative, Field(description="of the start yaw [rad]")] = 0.01
        along: Annotated[
            NonNegative, Field(description="of the distance driven [m per root of m]")
        ] = 0.03
        aside: Annotated[NonNegative, Field(description="of sideways slip [m per root of m]")] = (
            0.01
        )
        yaw_by_distance: Annotated[
            NonNegative, Field(description="of yaw by driving [rad per root of m]")
        ] = 0.005
        yaw_by_turning: Annotated[
            NonNegative, Field(description="of yaw by turning [rad per root of rad]")
        ] = 0.01
        place_radius: Annotated[
            float,
            Field(gt=0.0, le=20.0, description="of the position of a robot at a place [m]"),
        ] = place_probabilities.PLACE_RADIUS
        places: Annotated[
            int, Field(ge=1, le=1000, description="number of places that the belief lists")
        ] = place_probabilities.COUNT
        refresh: Annotated[
            NonNegative,
            Field(description="distance moved until place probabilities are computed again [m]"),
        ] = place_probabilities.REFRESH

    params: Params

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame).

        Raises:
            InputError: ``pose`` is None: without landmarks an unknown start cannot be found.

        """
        pose = place_probabilities.known_start(
            pose, self.name, "a localizer that recognises landmarks"
        )
        p = self.params
        self._posterior = place_probabilities.PlacePosterior(
            topo_map, p.place_radius, p.places, p.refresh
        )
        self._map_from_odom = pose.frame_of(odometry.pose)
        self._last = odometry.pose
        self._covariance = np.diag([p.start_xy**2, p.start_xy**2, p.start_yaw**2])

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry; percept and detections are not used."""
        posterior = self.posterior
        moved = self._last.relative(odometry.pose)
        pose = self._map_from_odom.compose(odometry.pose)
        self._covariance = self._propagated(moved, pose.yaw)
        self._last = odometry.pose
        places = posterior.at(pose, self._covariance)
        confidence = place_probabilities.probability_within(self._covariance)
        return Belief(odometry.time, pose, self._covariance, places, confidence)

    def _propagated(self, moved: Pose, yaw: float) -> Array:
        """The covariance after ``moved`` (in the frame of the old pose), now heading ``yaw``."""
        p = self.params
        distance, turned = math.hypot(moved.x, moved.y), abs(moved.yaw)
        before = wrap_angle(yaw - moved.yaw)
        c, s = math.cos(before), math.sin(before)
        dx, dy = c * moved.x - s * moved.y, s * moved.x + c * moved.y
        jacobian = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        along, aside = p.along**2 * distance, p.aside**2 * distance
        noise = np.array(
            [
                [c * c * along + s * s * aside, c * s * (along - aside), 0.0],
                [c * s * (along - aside), s * s * along + c * c * aside, 0.0],
                [0.0, 0.0, p.yaw_by_distance**2 * distance + p.yaw_by_turning**2 * turned],
            ]
        )
        propagated: Array = product(jacobian, self._covariance, jacobian.T) + noise
        return propagated
