"""Each filter of the localiser ``topological`` as a localiser: an EKF, a Bayes filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Belief, LandmarkDetection, Localizer, Odometry, Percept, Pose, TopoMap
from navfw.localization import place_probabilities
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_model import LandmarkExistence, LandmarkObserver
from navfw.localization.metric_filter import MetricFilter, MetricFilterParams
from navfw.localization.place_probabilities import observed_situations, situation_table


class Ekf(place_probabilities.PlaceLocalizer):
    """Odometry and gyro predict (x, y, yaw, gyro bias); landmark detections correct them.

    A detection passes a chi-square gate and is weighted by its landmark's existence probability, so
    that a displaced landmark is soon ignored.
    """

    name: ClassVar[str] = "ekf"

    class Params(MetricFilterParams, place_probabilities.PlaceLocalizer.Params):
        """Noise, the landmarks' prior, and when the belief is lost."""

        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which the belief is lost")
        ] = 0.2

    params: Params

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame).

        Raises:
            InputError: ``pose`` is None: an EKF cannot search the whole map.

        """
        instead = "the localizer 'topological' (see the stack 'landmarks')"
        pose = place_probabilities.known_start(pose, self.name, instead)
        p = self.params
        self._posterior = place_probabilities.PlacePosterior(topo_map)
        self.existence = LandmarkExistence(p.prior)
        self._observer = LandmarkObserver(topo_map)
        self.filter = MetricFilter(p, self.existence, self.robot)
        covariance = np.diag((p.start_xy**2, p.start_xy**2, p.start_yaw**2))
        self.filter.initialize(pose, covariance, odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and detections; percepts are not used."""
        posterior = self.posterior
        self.filter.predict(odometry)
        self.filter.observe(self._observer.observe(odometry, detections))
        pose, covariance = self.filter.pose, self.filter.pose_covariance
        confidence = place_probabilities.probability_within(covariance)
        return Belief(
            odometry.time,
            pose,
            covariance,
            posterior.at(pose, covariance),
            confidence,
            confidence < self.params.lost_below,
            self.filter.updates,
        )


class Bayes(Localizer):
    """Probability of every cell and heading of the map, by odometry, landmarks and OFFIS.

    Finds an unknown start; its pose is as coarse as its cells and headings. The belief is lost
    until enough of the probability lies at one pose that more than one landmark supports.
    """

    name: ClassVar[str] = "bayes"

    class Params(DiscreteParams, Localizer.Params):
        """The lattice, and the landmarks' accuracy and prior existence probability."""

        prior: Annotated[
            float,
            Field(gt=0.0, lt=1.0, description="prior probability that a landmark is where mapped"),
        ] = 0.85
        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which the belief is lost")
        ] = 0.5

    params: Params

    _map: TopoMap | None = None

    def reset(self) -> None:
        """Back to the state before ``start``."""
        self._map = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame), or anywhere when None."""
        self._map = topo_map
        self._observer = LandmarkObserver(topo_map)
        existence = LandmarkExistence(self.params.prior)
        table = situation_table(self.params.situations)
        self.filter = DiscreteFilter(topo_map, self.params, self.params.prior, existence, table)
        self.filter.initialize(pose, odometry)
        self._known_start = pose is not None
        self._updates = 0

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and, where there are any, percept and detections."""
        if self._map is None:
            raise RuntimeError("start() comes before update()")
        self.filter.predict(odometry)
        self.filter.observe_situations(observed_situations(percept))
        observations = self._observer.observe(odometry, detections)
        self.filter.observe(observations)
        self._updates += len(observations)
        cluster = self.filter.cluster
        support = 1.0 if self._known_start else self.filter.support_probability(cluster.pose)
        confidence = cluster.mass * support
        return Belief(
            odometry.time,
            cluster.pose,
            cluster.spread,
            self.filter.places,
            confidence,
            confidence < self.params.lost_below,
            self._updates,
        )
