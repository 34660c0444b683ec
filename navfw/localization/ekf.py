"""The localiser ``ekf``: a metric EKF from a known start, corrected by landmarks (METHOD 4.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw.interfaces import Localizer
from navfw.localization.landmark_model import LandmarkExistence
from navfw.localization.landmark_observations import LandmarkObserver
from navfw.localization.metric_filter import MetricFilter, MetricFilterParams
from navfw.localization.place_posterior import PlacePosterior, known_start, probability_within
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose
from navfw.topomap import TopoMap


class Ekf(Localizer):
    """Odometry and gyro predict (x, y, yaw, gyro bias); landmark detections correct them.

    A detection passes a chi-square gate and is weighted by its landmark's existence probability, so
    that a displaced landmark is soon ignored.
    """

    name: ClassVar[str] = "ekf"

    class Params(MetricFilterParams, Localizer.Params):
        """Noise, the landmarks' prior, and when the belief is lost."""

        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which the belief is lost")
        ] = 0.2

    params: Params

    _posterior: PlacePosterior | None = None

    def reset(self) -> None:
        """Back to the state before ``start``."""
        self._posterior = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame).

        Raises:
            InputError: ``pose`` is None: an EKF cannot search the whole map.

        """
        instead = "the localizer 'topological' (see the stack 'landmarks')"
        pose = known_start(pose, self.name, instead)
        p = self.params
        self._posterior = PlacePosterior(topo_map)
        self.existence = LandmarkExistence(p.prior)
        self._observer = LandmarkObserver(topo_map, p.map_sigma)
        self.filter = MetricFilter(p, self.existence, self.robot)
        covariance = np.diag((p.start_xy**2, p.start_xy**2, p.start_yaw**2))
        self.filter.initialize(pose, covariance, odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and detections; percepts are not used."""
        if self._posterior is None:
            raise RuntimeError("start() comes before update()")
        self.filter.predict(odometry)
        self.filter.observe(self._observer.observe(odometry, detections))
        pose, covariance = self.filter.pose, self.filter.pose_covariance
        confidence = probability_within(covariance)
        return Belief(
            odometry.time,
            pose,
            covariance,
            self._posterior.at(pose, covariance),
            confidence,
            confidence < self.params.lost_below,
            self.filter.updates,
        )
